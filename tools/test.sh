#!/usr/bin/env bash
# Sets up, builds everything and runs every test. Arguments go to ctest: tools/test.sh -R render
#
#   tools/test.sh --sanitize [CTEST OPTIONS]         everything under the address and undefined-behaviour sanitizers,
#                                                    then what has threads under the thread sanitizer: hours
#   tools/test.sh --sanitize=short [CTEST OPTIONS]   of the first, what reads and writes caches: some minutes
set -euo pipefail

root=$(cd "$(dirname "${BASH_SOURCE[0]}")/.." && pwd)
# run PRESET [CTEST OPTIONS]: the tests of a build, none of which may be missing.
run() {
  local preset=$1
  shift
  ctest --test-dir "$root/build/$preset" --output-on-failure --no-tests=error -j2 "$@"
}

form=plain
case ${1:-} in
  --sanitize) form=whole && shift ;;
  --sanitize=short) form=short && shift ;;
esac

export ASAN_OPTIONS=detect_stack_use_after_return=1:strict_string_checks=1
export LSAN_OPTIONS=suppressions=$root/tests/lsan.supp:print_suppressions=0
export UBSAN_OPTIONS=halt_on_error=1:print_stacktrace=1
export TSAN_OPTIONS=suppressions=$root/tests/tsan.supp:halt_on_error=1

case $form in
  plain)
    # The smoke test of bench/ also draws with VTK; tests/stream/read_cache.py needs the others.
    "$root/tools/setup.sh" python3-vtk9 python3-numpy python3-zstandard python3-xxhash
    "$root/tools/build.sh"
    run release "$@"
    ;;
  short)
    "$root/tools/build.sh" --preset asan stream_tests
    run asan -L stream "$@"
    ;;
  whole)
    "$root/tools/build.sh" --preset asan
    run asan "$@"
    # TBB is not built with this sanitizer and its loops get one thread (support/one_tbb_thread.cpp): of conversion,
    # only what has threads of its own is worth the time.
    "$root/tools/build.sh" --preset tsan stream_tests preprocess_tests render_tests viewer_tests
    run tsan -R '^(stream|render|viewer)\.|^preprocess\.(Convert|Slabs|AddScalar|Resume)' "$@"
    ;;
esac
