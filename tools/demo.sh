#!/usr/bin/env bash
# Demonstrates curvisplat from a fresh clone: installs packages, builds, converts a grid and renders it.
#
#   tools/demo.sh                   a generated wake behind a cylinder
#   tools/demo.sh GRID SOLUTION     your PLOT3D files: grid, and Q solution or function file
#
# Writes the cache and the picture to out/, or to the folder OUT of the environment. CURVISPLAT names a program that is
# used instead of one built here.
set -euo pipefail

root=$(cd "$(dirname "${BASH_SOURCE[0]}")/.." && pwd)

if [[ $# -ne 0 && $# -ne 2 ]] || [[ ${1-} == -* ]]; then
  sed -n '2,8s/^# \?//p' "${BASH_SOURCE[0]}" >&2
  exit 2
fi
for file in "$@"; do
  if [[ ! -r $file || -d $file ]]; then
    echo "demo: $file: is not a readable file" >&2
    exit 2
  fi
done

curvisplat=${CURVISPLAT:-$root/build/release/tools/curvisplat}
if [[ -z ${CURVISPLAT:-} ]]; then
  [[ -x $curvisplat ]] || echo "demo: building takes about ten minutes on two cores; packages are installed first if any are missing"
  "$root/tools/build.sh" curvisplat
fi
out=${OUT:-$root/out}
mkdir -p "$out"

if [[ $# -eq 2 ]]; then
  inputs=("$1" "$2")
  name=$(basename "${1%.*}")
  look=()
else
  "$curvisplat" generate wake --size 192x128x96 -o "$out/wake"
  inputs=("$out/wake.xyz" "$out/wake.fun")
  name=demo
  look=(--tf inferno --background black --opacity-unit 0.034 --position 7.2,-10,8 --focal-point 3.2,0,2
        --view-up 0,0,1 --view-angle 34)
fi

"$curvisplat" convert "${inputs[@]}" -o "$out/$name.splats" --overwrite
"$curvisplat" render "$out/$name.splats" -o "$out/$name.png" --size 600x600 "${look[@]}"
echo "Wrote $out/$name.png"
