#!/usr/bin/env bash
# Sets up, configures and builds the release preset in build/release: the targets named, or everything. What is
# up to date is not built again.
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
  echo "build: cmake could not configure; see above" >&2
  exit 1
fi

targets=()
[[ $# -eq 0 ]] || targets=(--target "$@")
# A compiler takes up to 2 GB (OpenVDB's headers): no more of them at once than there is memory for.
memory_kb=$(awk '/^MemAvailable:/ { print $2 }' /proc/meminfo)
jobs=$(nproc)
((jobs * 2000000 <= memory_kb)) || jobs=$((memory_kb / 2000000))
cmake --build "build/$preset" --parallel "$((jobs > 0 ? jobs : 1))" "${targets[@]}"
