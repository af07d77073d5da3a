#!/usr/bin/env bash
# Installs a build into an empty folder, builds the project in example/ against it and runs it: its cache and its
# picture must be what they are to be.
#
#   tests/install/install_test.sh BUILD_FOLDER
set -euo pipefail

build=$(realpath "$1")
here=$(cd "$(dirname "${BASH_SOURCE[0]}")" && pwd)
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
prefix=$folder/prefix
quietly() { "$@" > "$folder/log" 2>&1 || { cat "$folder/log"; echo "FAILED: $*"; exit 1; }; }
expect() { "${@:2}" || { echo "FAILED: $1"; exit 1; }; }

# README's way builds two targets alone: all that is installed of what a build makes comes with them.
find "$build" -name cmake_install.cmake -exec grep -hoE "\"$build/[^\"]*\"" {} + | tr -d '"' | sed "s#^$build/##" | sort -u > "$folder/installed"
ninja -C "$build" -t targets all | sed '/^ninja: /d; s/: [^:]*$//' | sort -u > "$folder/made"
ninja -C "$build" -t inputs tools/curvisplat curvisplat_python | cat - <(echo tools/curvisplat) | sort -u > "$folder/with_both"
comm -12 "$folder/installed" "$folder/made" > "$folder/needed"
expect "what is installed is found" grep -qx 'tools/curvisplat-vdb.so' "$folder/needed"
expect "the targets curvisplat and curvisplat_python make all that is installed: $(comm -23 "$folder/needed" "$folder/with_both")" \
  test -z "$(comm -23 "$folder/needed" "$folder/with_both")"

quietly cmake --install "$build" --prefix "$prefix"
program=$prefix/bin/curvisplat
expect "--version names the version" grep -qx "curvisplat [0-9.]*" <("$program" --version)

# The example is copied: nothing beside it, such as our headers, may be found by chance.
cp -r "$here/example" "$folder/example"
quietly cmake -G Ninja -S "$folder/example" -B "$folder/build" -DCMAKE_PREFIX_PATH="$prefix" -DCMAKE_BUILD_TYPE=Release
quietly cmake --build "$folder/build"
root=$(realpath "$here/../..")
expect "the package names no file of the source" test -z "$(grep -rlF "$root" "$prefix" --include='*.cmake')"
quietly "$folder/build/example" "$folder"
"$program" info "$folder/bent.splats" --json > "$folder/info.json"
"$program" render "$folder/bent.splats" -o "$folder/again.png" --size 320x240 --tf inferno --range data --opacity ramp --opacity-unit 0.1 --view iso --background white > /dev/null
python3 - "$folder" <<'END'
import json, pathlib, sys
folder = pathlib.Path(sys.argv[1])
info = json.loads((folder / "info.json").read_text())
assert info["nodes"] == 64 * 24 * 16, info["nodes"]
assert info["variables"][0]["name"] == "temperature", info["variables"]
# The example's calls and the program's options ask for the same picture.
picture, again = (folder / "bent.png").read_bytes(), (folder / "again.png").read_bytes()
assert picture == again, "the example's picture differs from the program's"
assert len(picture) > 10_000, "the picture is empty"
END
echo "installed, found, built, drawn"
