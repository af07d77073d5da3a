#!/usr/bin/env bash
# Installs the packages that building and testing curvisplat needs, on Debian 12 or a derivative. Does nothing if all
# are installed.
#
#   tools/setup.sh [PACKAGE ...]     also installs the named packages
set -euo pipefail

packages=(
  # compiler and build
  g++ cmake ninja-build pkg-config
  # octree and conversion; OpenVDB's CMake module requires Boost.Iostreams
  libopenvdb-dev libboost-iostreams-dev libtbb-dev libzstd-dev libxxhash-dev
  # asynchronous reads
  liburing-dev
  # grid files
  libblosc-dev libcgns-dev libhdf5-dev libnetcdf-dev libproj-dev liblzma-dev
  # vectors, formatting, command line, JSON
  libglm-dev libfmt-dev libcli11-dev nlohmann-json3-dev
  # VTK files
  libpugixml-dev zlib1g-dev liblz4-dev
  # picture files, and OpenGL without a display
  libpng-dev libtinyexr-dev libosmesa6-dev libgl-dev libegl-dev libegl1
  # annotations
  libcairo2-dev fonts-dejavu-core
  # the window
  libglfw3-dev libimgui-dev
  # the server: Boost.Beast, pictures while they move
  libboost-dev libjpeg62-turbo-dev
  # SIMD for drawing on the processor
  libhwy-dev
  # several processes
  libopenmpi-dev openmpi-bin
  # the Python package
  pybind11-dev python3-dev python3-numpy
  # tests and benchmarks; the bundle
  libgtest-dev libbenchmark-dev python3 man-db patchelf zstd
  # window tests: a virtual display, simulated input, screenshots
  xvfb xdotool x11-apps libgl1-mesa-dri
  "$@"
)

if ! command -v dpkg-query >/dev/null; then
  echo "setup: dpkg-query not found: not a Debian system; install the equivalents of: ${packages[*]}" >&2
  exit 1
fi

missing=()
for package in "${packages[@]}"; do
  status=$(dpkg-query --show --showformat='${db:Status-Status}' "$package" 2>/dev/null || true)
  [[ $status == installed ]] || missing+=("$package")
done
[[ ${#missing[@]} -gt 0 ]] || exit 0

as_root=()
if [[ $(id -u) -ne 0 ]]; then
  if ! command -v sudo >/dev/null; then
    echo "setup: installing packages needs root; run as root: apt-get install ${missing[*]}" >&2
    exit 1
  fi
  as_root=(sudo)
fi

echo "setup: installing ${missing[*]}"
log=$(mktemp)
trap 'rm -f "$log"' EXIT
apt() {
  if ! "${as_root[@]}" env DEBIAN_FRONTEND=noninteractive apt-get --quiet --yes "$@" </dev/null >"$log" 2>&1; then
    cat "$log" >&2
    echo "setup: apt-get $1 failed" >&2
    exit 1
  fi
}
apt update
apt install --no-install-recommends "${missing[@]}"
