#!/usr/bin/env bash
# Installs what the build needs: system packages, and LibTorch in the virtual environment .venv.
# Does nothing where everything is there already.
set -euo pipefail
cd "$(dirname "$0")/.."

readonly TORCH=torch==2.13.0
readonly STAMP=.venv/antipode-setup
readonly PACKAGES=(
  cmake g++ make ninja-build ccache python3-venv python3-pip
  libopencv-dev libeigen3-dev libassimp-dev libembree-dev libcli11-dev nlohmann-json3-dev libspdlog-dev libceres-dev
  libssl-dev libzip-dev libexif-dev libgtest-dev libbenchmark-dev)

is_installed() {
  [ "$(dpkg-query -W -f='${db:Status-Status}' "$1" 2>/dev/null)" = installed ]
}

missing_packages() {
  local package
  for package in "${PACKAGES[@]}"; do
    is_installed "$package" || printf '%s ' "$package"
  done
}

# Runs a command as root, or fails with the line that the user has to run.
as_root() {
  if [ "$(id -u)" = 0 ]; then
    "$@"
  elif command -v sudo >/dev/null && { sudo -n true 2>/dev/null || [ -t 0 ]; }; then
    sudo "$@"
  else
    return 1
  fi
}

install_packages() {
  local missing
  missing=$(missing_packages)
  [ -n "$missing" ] || return 0
  echo "setup: installing $missing"
  # The list of packages may be empty or old; an update that fails is no reason not to try.
  as_root env DEBIAN_FRONTEND=noninteractive apt-get update -qq || true
  # shellcheck disable=SC2086  # one word a package
  as_root env DEBIAN_FRONTEND=noninteractive apt-get install -y -qq --no-install-recommends $missing && return 0
  echo "setup: could not install system packages; run this as root, then make again:" >&2
  echo "  apt-get update && apt-get install -y --no-install-recommends $missing" >&2
  exit 1
}

install_torch() {
  [ "$(cat "$STAMP" 2>/dev/null)" = "$TORCH" ] && return 0
  if ! .venv/bin/python -m pip --version >/dev/null 2>&1; then
    python3 -c 'import sys; sys.exit(sys.version_info < (3, 10))' || {
      echo "setup: python3 is $(python3 --version 2>&1), but 3.10 or newer is needed" >&2
      exit 1
    }
    python3 -m venv --clear .venv
  fi
  .venv/bin/python -m pip install "$TORCH"
  printf '%s' "$TORCH" >"$STAMP"
}

install_packages
install_torch
