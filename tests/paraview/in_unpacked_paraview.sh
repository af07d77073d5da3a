#!/usr/bin/env bash
# Runs plugin_test.py in Debian's ParaView without installing it, as python3-paraview conflicts with python3-vtk9: downloads it with
# the packages that it needs (apt-get, some 100 MB) and unpacks them into FOLDER. A FOLDER that has it already is used as it is.
#
#   in_unpacked_paraview.sh FOLDER PROGRAM PYTHON_FOLDER [PICTURE_FOLDER]
set -euo pipefail

(($# >= 3)) || { sed -n '2,5s/^# \{0,1\}//p' "$0" >&2; exit 2; }
mkdir -p "$1"
folder=$(realpath "$1")
shift

if [[ ! -x $folder/usr/bin/pvpython ]]; then
  packages=$(mktemp -d)
  trap 'rm -rf "$packages"' EXIT
  mapfile -t names < <(apt-get -s install python3-paraview | awk '$1 == "Inst" { print $2 }')
  ((${#names[@]})) || { echo "in_unpacked_paraview: apt-get knows no python3-paraview; run apt-get update" >&2; exit 1; }
  (cd "$packages" && apt-get -qq -o APT::Sandbox::User=root download "${names[@]}")
  for package in "$packages"/*.deb; do dpkg -x "$package" "$folder"; done
fi

export LD_LIBRARY_PATH=$folder/usr/lib/x86_64-linux-gnu PYTHONPATH=$folder/usr/lib/python3/dist-packages PATH=$folder/usr/bin:$PATH
/usr/bin/python3 "$(dirname "${BASH_SOURCE[0]}")/plugin_test.py" "$@"
