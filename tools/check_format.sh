#!/usr/bin/env bash
# Checks that all C++ sources are formatted as .clang-format says, by clang-format 14: other versions differ.
#
#   tools/check_format.sh          prints what differs; exit status 1 if anything does
#   tools/check_format.sh --fix    formats it
set -euo pipefail

root=$(cd "$(dirname "${BASH_SOURCE[0]}")/.." && pwd)
"$root/tools/setup.sh" clang-format-14
cd "$root"

how=(--dry-run --Werror)
[[ ${1:-} != --fix ]] || how=(-i)
find stream preprocess render tools tests bench \( -name '*.h' -o -name '*.cpp' \) -print0 |
  xargs -0 -n 32 -P "$(nproc)" clang-format-14 "${how[@]}" || exit 1
