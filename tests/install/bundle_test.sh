#!/usr/bin/env bash
# Makes a bundle and a wheel of a build. The bundle runs in a root that has the C library and a shell and nothing else, then beside libraries
# of other versions; the wheel beside Python modules with the same libraries.
#
#   tests/install/bundle_test.sh BUILD_FOLDER
#
# Where no root can be made (unshare), the bundle runs with an empty environment alone.
set -euo pipefail

build=$(realpath "$1")
root=$(cd "$(dirname "${BASH_SOURCE[0]}")/../.." && pwd)
command -v patchelf > /dev/null || { echo "skipped: patchelf not found; apt-get install patchelf"; exit 77; }
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
quietly() { "$@" > "$folder/log" 2>&1 || { cat "$folder/log"; echo "FAILED: $*"; exit 1; }; }
expect() { "${@:2}" || { echo "FAILED: $1"; exit 1; }; }

# refused TEXT ARGUMENT ...: bundle.sh says TEXT, and writes nothing
refused() {
  ! "$root/tools/packaging/bundle.sh" "${@:2}" "$folder/none" > "$folder/log" 2>&1 && grep -q "$1" "$folder/log" && [[ ! -e $folder/none ]]
}
expect "a folder without a build is refused" refused "is not a build folder" "$folder"
expect "an example that does not exist is refused" refused "needs a file that exists" --example "$folder/example" "$build"

wheel=$(grep -q '^CURVISPLAT_PYTHON:BOOL=ON' "$build/CMakeCache.txt" && echo --wheel || true)
quietly "$root/tools/packaging/bundle.sh" --fast $wheel --example "$root/tests/data/cgns/flow.cgns" "$build" "$folder/out"
version=$("$build/tools/curvisplat" --version)
bundle=$folder/out/${version/ /-}-linux-x86_64
expect "a bundle of at most 110 MB" test "$(du -sm "$bundle" | cut -f1)" -le 110

# ------------------------------------------------------------------------------------------------ the bundle alone
bare=$folder/bare
mkdir -p "$bare"/{bin,lib64,lib/x86_64-linux-gnu,proc,tmp} "$bare/any place"
cp /bin/sh "$bare/bin/"
cp /lib64/ld-linux-x86-64.so.2 "$bare/lib64/"
cp -L /lib/x86_64-linux-gnu/lib{c,m,dl,pthread,rt,resolv}.so.* "$bare/lib/x86_64-linux-gnu/"
mv "$bundle" "$bare/any place/curvisplat"
# The outputs lie in /tmp there.
cat > "$bare/tmp/commands.sh" << 'END'
set -e
here=$1
cd "$here/tmp"
bin="$here/any place/curvisplat/bin" examples="$here/any place/curvisplat/share/curvisplat/examples"
"$bin/curvisplat" --version > version
"$bin/curvisplat" generate wake --size 24x16x8 -o wake
"$bin/curvisplat" convert wake.xyz wake.fun -o wake.splats
"$bin/curvisplat" render wake.splats -o plain.png --size 200x150 --backend cpu
PATH=$bin curvisplat render wake.splats -o text.png --size 200x150 --backend cpu --scalar-bar
FONTCONFIG_FILE=none "$bin/curvisplat" render wake.splats -o no_text.png --size 200x150 --backend cpu --scalar-bar 2>&1
"$bin/curvisplat" export wake.splats -o wake.vdb --voxels 32
"$bin/curvisplat" convert "$examples/flow.cgns" -o flow.splats
[ ! -e map.nc ] || "$bin/curvisplat" convert map.nc -o map.splats
END
# A map of a projection: for libnetcdf and PROJ.
/usr/bin/python3 - "$bare/tmp/map.nc" << 'END' 2> "$folder/log" || echo "without a NetCDF file: python3-netcdf4 is not installed"
import sys
import netCDF4
import numpy
with netCDF4.Dataset(sys.argv[1], "w") as file:
    for axis, name, size in (("z", "height", 3), ("y", "projection_y_coordinate", 4), ("x", "projection_x_coordinate", 5)):
        file.createDimension(axis, size)
        variable = file.createVariable(axis, "f8", (axis,))
        variable[:], variable.units, variable.standard_name = 1000.0 * numpy.arange(size), "m", name
    mapping = file.createVariable("crs", "i4")
    mapping.setncatts({"grid_mapping_name": "lambert_conformal_conic", "standard_parallel": [30.0, 60.0],
                       "longitude_of_central_meridian": 10.0, "latitude_of_projection_origin": 45.0, "earth_radius": 6371000.0})
    variable = file.createVariable("t", "f4", ("z", "y", "x"), zlib=True)
    variable[:], variable.grid_mapping = numpy.arange(60).reshape(3, 4, 5), "crs"
END
if unshare --map-root-user --mount true 2> "$folder/log"; then
  quietly unshare --map-root-user --mount sh -c \
    'mount --rbind /proc "$1/proc" && exec env -i "$(command -v chroot)" "$1" /bin/sh /tmp/commands.sh ""' sh "$bare"
else
  echo "not in a root of its own, since none can be made here: $(cat "$folder/log")"
  quietly env -i /bin/sh "$bare/tmp/commands.sh" "$bare"
fi
# PROJ, fontconfig and the dynamic linker print what they miss.
expect "nothing is missed: $(cat "$folder/log")" test -z "$(grep -iE 'cannot|no version|not found' "$folder/log" | grep -v 'Fontconfig error')"
cd "$bare/tmp"
expect "--version" test "$(cat version)" = "$version"
quietly "$build/tools/curvisplat" render wake.splats -o here.png --size 200x150 --backend cpu
expect "the same picture as the build's program draws" cmp plain.png here.png
expect "texts are drawn by the bundle's font" test -n "$(cmp text.png no_text.png)"
expect "the plug-in for OpenVDB wrote a grid" test -s wake.vdb

# Libraries of the same names come first for others. None of these can be loaded.
mkdir "$folder/others"
for library in "$bare/any place/curvisplat/lib"/crv* "$bare/any place/curvisplat/lib/fallback"/*; do
  library=$(basename "$library")
  echo "of another version" > "$folder/others/${library/#crv/lib}"
done
expect "it runs beside others' libraries" env LD_LIBRARY_PATH="$folder/others" "$bare/any place/curvisplat/bin/curvisplat" info wake.splats > "$folder/log"
[[ $wheel ]] || { echo "a bundle of $(du -sm "$bare/any place" | cut -f1) MB, no wheel"; exit 0; }

# ------------------------------------------------------------------------------------------------ the wheel
cd "$folder"
/usr/bin/python3 -m venv --without-pip --system-site-packages venv 2> log ||
  { echo "without the wheel: $(cat log); apt-get install python3-venv"; exit 0; }
quietly venv/bin/python -m pip install --no-index --no-deps out/curvisplat-*.whl
expect "pip installs the program" test "$(venv/bin/curvisplat --version)" = "$version"
# Functions of the libraries' names, known to the whole process.
for name in H5open H5Fopen H5Fcreate nc_open cg_open inflate ZSTD_decompress XXH3_64bits; do
  echo "void $name(void) { __builtin_trap(); }"
done > clash.c
cc -shared -fno-builtin -o clash.so clash.c
cat > wheel.py << 'END'
import ctypes
import importlib
import pathlib
import sys
import urllib.request

flow, order = sys.argv[1:]


def import_others():
    for name in ("h5py", "netCDF4", "vtk"):
        try:
            importlib.import_module(name)
        except ImportError:
            print(f"without {name}, which is not installed")
    if "h5py" in sys.modules:  # works as before
        import h5py
        with h5py.File(flow) as file:
            assert "Base" in " ".join(file), list(file)


if order == "first":
    import_others()
    ctypes.CDLL("./clash.so", ctypes.RTLD_GLOBAL)
import curvisplat  # noqa: E402

site = pathlib.Path("venv").resolve()
assert pathlib.Path(curvisplat.__file__).is_relative_to(site) and pathlib.Path(curvisplat.program()).is_relative_to(site)
curvisplat.convert(f"{order}.splats", flow)
with curvisplat.open(f"{order}.splats") as cache:
    cache.render(size=(64, 48), scalar_bar=True).save(f"{order}.png")
    if order == "last":
        import_others()
    with cache.view() as view:
        assert b"<canvas" in urllib.request.urlopen(view.url).read()
END
for order in first last; do
  quietly env -u PYTHONPATH venv/bin/python wheel.py "$root/tests/data/cgns/flow.cgns" $order
  grep -a without log || true
done
expect "the same pictures in both orders" cmp first.png last.png
echo "a bundle of $(du -sm "$bare/any place" | cut -f1) MB, and a wheel"
