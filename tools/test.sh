#!/usr/bin/env bash
# Runs setup.sh, builds everything and runs the tests. Passes its arguments to ctest, for example -R render.
#
#   tools/test.sh [CTEST OPTIONS]                    all tests but those with the label `whole`
#   tools/test.sh --whole [CTEST OPTIONS]            all tests, and of damage and faults every place, not one in several; many
#                                                    kills, and long runs of ten minutes each; takes hours and 20 GB of /tmp
#   tools/test.sh --sanitize [CTEST OPTIONS]         all tests with the address and undefined-behaviour sanitizers, then
#                                                    the multithreaded ones with the thread sanitizer; takes hours
#   tools/test.sh --sanitize=short [CTEST OPTIONS]   only the tests of stream/ with the first two; takes minutes
set -euo pipefail

root=$(cd "$(dirname "${BASH_SOURCE[0]}")/.." && pwd)
# run PRESET [CTEST OPTIONS]: runs the tests of a build; fails if there are none. Twice as many as there are cores at a time: a third of
# the time they wait, for the disk, for windows or for servers. ctest leaves out what matches each -LE, not any: where another one is given,
# the tests of the label `whole` skip themselves.
run() {
  local preset=$1 left_out=(-LE '^whole$')
  shift
  if [[ -v CURVISPLAT_WHOLE || " $* " =~ \ (-LE|--label-exclude)[\ =] ]]; then left_out=(); fi
  ctest --test-dir "$root/build/$preset" --output-on-failure --no-tests=error -j"$(($(nproc) * 2))" "${left_out[@]}" "$@"
}

form=plain
case ${1:-} in
  --whole) export CURVISPLAT_WHOLE=1 && shift ;;
  --sanitize) form=whole && shift ;;
  --sanitize=short) form=short && shift ;;
esac

# Tests in Python cannot tell how the program was built (tests/support/memory_limit.h).
[[ $form == plain ]] || export CURVISPLAT_SANITIZED=1
export ASAN_OPTIONS=detect_stack_use_after_return=1:strict_string_checks=1
export LSAN_OPTIONS=suppressions=$root/tests/lsan.supp:print_suppressions=0
export UBSAN_OPTIONS=suppressions=$root/tests/ubsan.supp:halt_on_error=1:print_stacktrace=1
export TSAN_OPTIONS=suppressions=$root/tests/tsan.supp:halt_on_error=1

case $form in
  plain)
    echo "test: building takes about 12 minutes from nothing on two cores, all tests 12 to 20"
    "$root/tools/setup.sh"
    # While the program is built: the smoke test of bench/ also draws with VTK; tests/end_to_end/fuse_test.py needs fusepy; tests/serve a
    # browser and websocket; movies ffmpeg; tests/stream/read_cache.py, tests/python and the tests of files that others write need the others.
    "$root/tools/setup.sh" python3-vtk9 python3-numpy python3-zstandard python3-xxhash python3-netcdf4 zstd \
      python3-xarray python3-pip python3-setuptools python3-wheel python3-openvdb python3-fusepy \
      python3-websocket chromium ffmpeg python3-matplotlib python3-nbconvert python3-ipykernel python3-h5py python3-meshio &
    trap 'wait' EXIT
    "$root/tools/build.sh"
    wait $!
    run release "$@"
    ;;
  short)
    "$root/tools/build.sh" --preset asan stream_tests
    run asan -L stream "$@"
    ;;
  whole)
    "$root/tools/build.sh" --preset asan
    run asan "$@"
    # TBB is not built with this sanitizer, so its loops get one thread (tests/support/one_tbb_thread.cpp). Of the
    # conversion, run only the tests of code with threads of its own.
    "$root/tools/build.sh" --preset tsan stream_tests preprocess_tests render_tests viewer_tests
    run tsan -R '^(stream|render|viewer)\.|^preprocess\.(Convert|Slabs|AddScalar|Resume|RecordSorter)' "$@"
    ;;
esac
