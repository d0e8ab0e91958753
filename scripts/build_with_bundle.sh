#!/usr/bin/env bash
# Builds the program where there are torch, cmake and a compiler and nothing else, from an archive made by
# scripts/bundle_dependencies.sh.
#
# It trains on packs of meshes (antipode train pack) and cannot read other files of meshes.
#
# usage: scripts/build_with_bundle.sh BUNDLE [TORCH]
#   TORCH  the torch folder of a Python environment; without: that of python3
# Program: build/bundle/bin/antipode
set -euo pipefail

if [ $# -lt 1 ] || [ $# -gt 2 ]; then
  sed -n '2,9s/^# \{0,1\}//p' "$0" >&2
  exit 2
fi
bundle=$(realpath "$1")
torch=${2:-$(python3 -c 'import importlib.util as i; print(i.find_spec("torch").submodule_search_locations[0])')}
cd "$(dirname "$0")/.."

mkdir -p build/bundle
python3 -m tarfile -e "$bundle" build/bundle  # knows xz where tar may not
dependencies=$PWD/build/bundle/bundle
cmake -S . -B build/bundle -DCMAKE_BUILD_TYPE=Release -DANTIPODE_TESTS=OFF -DANTIPODE_MESH_FILES=OFF -DLIBTORCH="$torch" -DCMAKE_PREFIX_PATH="$dependencies" \
  -DOPENSSL_ROOT_DIR="$dependencies" -DOPENSSL_USE_STATIC_LIBS=ON
cmake --build build/bundle --target antipode --parallel "$(nproc)"
build/bundle/bin/antipode doctor
