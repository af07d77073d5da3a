#!/usr/bin/env bash
# Makes the Debian packages of a build, unpacks the program's into an empty root and runs it from there.
#
#   tests/install/debian_test.sh BUILD_FOLDER
set -euo pipefail

build=$(realpath "$1")
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
expect() { "${@:2}" || { echo "FAILED: $1"; exit 1; }; }

# Not compressed, as those that are published are: that takes most of the time.
cpack -G DEB -D CPACK_DEBIAN_COMPRESSION_TYPE=none --config "$build/CPackConfig.cmake" -B "$folder" > "$folder/log" 2>&1 ||
  { cat "$folder/log"; echo "FAILED: cpack"; exit 1; }
program=$(echo "$folder"/curvisplat_*.deb)
development=$(echo "$folder"/libcurvisplat-dev_*.deb)
version=$(dpkg-deb --field "$program" Version)

dpkg --extract "$program" "$folder/root"
expect "the unpacked program runs" test "$("$folder/root/usr/bin/curvisplat" --version)" = "curvisplat $version"
# Of every library that the program is linked with, the package is named.
for library in libc6 libcgns libhdf5 libnetcdf libopenvdb libpng16 libtbb12 liburing2; do
  expect "the program's package depends on $library" grep -q "$library" <(dpkg-deb --field "$program" Depends)
done
expect "the program's package has no libraries" test -z "$(dpkg-deb --contents "$program" | grep -E '\.(a|h|cmake)$')"

dpkg --extract "$development" "$folder/root"
for file in include/curvisplat/stream/cache/cache_reader.h lib/cmake/curvisplat/curvisplat-config.cmake; do
  expect "the development package has $file" test -f "$folder/root/usr/$file"
done
for depended in $(dpkg-deb --field "$development" Depends | tr -d ','); do
  expect "$depended is a package" dpkg-query --status "$depended" > /dev/null
done
for mpi in "$folder"/curvisplat-mpi_*.deb; do
  [[ -e $mpi ]] || continue  # built without it
  dpkg --extract "$mpi" "$folder/root"
  plug_in=$(find "$folder/root/usr/lib" -name curvisplat-mpi.so)
  expect "the plug-in is where the program looks for it" test "$(basename "$(dirname "$plug_in")")" = curvisplat
done
# Of the build's own package, all is tested by python_test.py.
pictures=(Pictures.test_are_annotated_as_by_the_command)
[[ ! -v CURVISPLAT_WHOLE ]] || pictures=(Pictures)
for python in "$folder"/python3-curvisplat_*.deb; do
  [[ -e $python ]] || continue  # built without it
  dpkg --extract "$python" "$folder/root"
  expect "the unpacked Python package is that version" test "$(PYTHONPATH=$folder/root/usr/lib/python3/dist-packages \
    /usr/bin/python3 -c 'import curvisplat; print(curvisplat.__version__)')" = "$version"
  expect "it has ParaView's plugin" test -f "$folder/root/usr/share/curvisplat/curvisplat_paraview.py"
  PYTHONPATH=$folder/root/usr/lib/python3/dist-packages /usr/bin/python3 \
    "$(dirname "$0")/../python/python_test.py" "$folder/root/usr/bin/curvisplat" "${pictures[@]}" > "$folder/log" 2>&1 ||
    { cat "$folder/log"; echo "FAILED: tests of the unpacked Python package"; exit 1; }
done
echo "$(basename "$program"): $(($(stat -c %s "$program") / 1024)) KiB;" \
  "$(basename "$development"): $(($(stat -c %s "$development") / 1024)) KiB"
