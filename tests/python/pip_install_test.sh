#!/usr/bin/env bash
# The package as pip installs it, without a network, draws an example's picture. pip_install_test.sh BUILD_FOLDER
set -euo pipefail
root=$(cd "$(dirname "${BASH_SOURCE[0]}")/../.." && pwd)
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
# A copy, since pip writes beside setup.py; the sources it needs are linked.
mkdir -p "$folder/source/tools"
cp -r "$root/tools/python" "$folder/source/tools/python"
cp "$root/CMakeLists.txt" "$folder/source/"
CURVISPLAT_BUILD=$1 /usr/bin/python3 -m pip install --quiet --no-index --no-deps --no-build-isolation \
  --target "$folder/installed" "$folder/source/tools/python"
cd "$folder"
PYTHONPATH=$folder/installed /usr/bin/python3 "$root/tools/python/examples/arrays.py" "$folder/duct"
[[ -s $folder/duct.png ]]
PYTHONPATH=$folder/installed /usr/bin/python3 -c '
import curvisplat, pathlib
assert pathlib.Path(curvisplat.__file__).is_relative_to(pathlib.Path("installed").resolve()), curvisplat.__file__
assert curvisplat.__version__'

# What the tests say of the build tree holds of the installed package; usually these, as others are asked of the Debian package.
classes=(CamerasAndFunctions Data)
[[ ! -v CURVISPLAT_WHOLE ]] || classes=(Pictures CamerasAndFunctions Data Arrays Errors)
cd "$folder"
PYTHONPATH=$folder/installed MALLOC_ARENA_MAX=1 /usr/bin/python3 "$root/tests/python/python_test.py" "$1/tools/curvisplat" \
  "${classes[@]}"
