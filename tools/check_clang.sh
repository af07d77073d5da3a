#!/usr/bin/env bash
# Compiles sources with Clang 14, without output, and checks them by .clang-tidy. A warning is an error. Needs the commands
# of a configured build, which tools/build.sh makes.
#
#   tools/check_clang.sh [FILE ...]    these; without any, all sources but the tests'
set -euo pipefail

root=$(cd "$(dirname "${BASH_SOURCE[0]}")/.." && pwd)
"$root/tools/setup.sh" clang-tidy-14
cd "$root"
if [[ ! -f build/release/compile_commands.json ]]; then
  echo "check_clang: build/release is not configured; run tools/build.sh first" >&2
  exit 1
fi

files=("$@")
[[ $# -gt 0 ]] || mapfile -t files < <(find stream preprocess render tools bench -name '*.cpp' | sort)
# GCC's commands: Clang does not know all of their warnings and pragmas, and warns of & between cheap conditions.
printf '%s\0' "${files[@]}" | xargs -0 -n 4 -P "$(nproc)" clang-tidy-14 -p build/release --quiet \
  --extra-arg=-Wno-unknown-warning-option --extra-arg=-Wno-bitwise-instead-of-logical --extra-arg=-Wno-unknown-pragmas 2>/dev/null
