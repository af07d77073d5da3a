#!/usr/bin/env bash
# Runs setup.sh, then configures and builds the named targets, or everything. The default preset, release, builds in
# build/release. Builds incrementally.
#
#   tools/build.sh [--preset NAME] [TARGET ...]
set -euo pipefail

root=$(cd "$(dirname "${BASH_SOURCE[0]}")/.." && pwd)
"$root/tools/setup.sh"

preset=release
if [[ ${1:-} == --preset ]]; then
  preset=$2
  shift 2
fi
cd "$root"
mkdir -p build
if ! cmake --preset "$preset" >"build/configure_$preset.log" 2>&1; then
  cat "build/configure_$preset.log" >&2
  echo "build: cmake failed to configure; see the output above" >&2
  exit 1
fi

targets=()
[[ $# -eq 0 ]] || targets=(--target "$@")
# A compiler process takes up to 2 GB (OpenVDB's headers), so available memory limits the number of jobs.
memory_kb=$(awk '/^MemAvailable:/ { print $2 }' /proc/meminfo)
jobs=$(nproc)
((jobs * 2000000 <= memory_kb)) || jobs=$((memory_kb / 2000000))
cmake --build "build/$preset" --parallel "$((jobs > 0 ? jobs : 1))" "${targets[@]}"
