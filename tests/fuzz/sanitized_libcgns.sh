#!/usr/bin/env bash
# Builds libcgns from Debian's source package with the address sanitizer, and so that libFuzzer sees what is reached in it, for the
# tests and the fuzz target that read ADF files by it: tests/fuzz/sanitized_libcgns.sh FOLDER [COMMAND ...]. Runs the command with
# that library in place of the system's:
#
#   tests/fuzz/sanitized_libcgns.sh /tmp/libcgns build/asan/tests/preprocess_tests --gtest_filter='*Cgns*'
#   tests/fuzz/sanitized_libcgns.sh /tmp/libcgns tests/fuzz/run.sh 600 cgns_adf
#
# Needs the network, dpkg-dev and CMake; not run by ctest. Exit 77 if the source cannot be had. Environment: CC (clang).
set -euo pipefail

folder=$(mkdir -p "$1" && cd "$1" && pwd)
shift
library=$folder/lib/libcgns.so.3.4

if [[ ! -e $library ]]; then
  cd "$folder"
  mkdir -p lists/partial cache lib
  # Source packages from where binary ones come.
  sed 's/^Types: deb$/Types: deb-src/' /etc/apt/sources.list.d/debian.sources >sources.sources 2>/dev/null ||
    sed -n 's/^deb /deb-src /p' /etc/apt/sources.list >sources.list
  [[ -s sources.sources ]] && list=$folder/sources.sources || list=$folder/sources.list
  apt=(apt-get -q -o Dir::Etc::sourcelist="$list" -o Dir::Etc::sourceparts=/dev/null -o Dir::State::lists="$folder/lists"
    -o Dir::Cache="$folder/cache" -o APT::Sandbox::User=root)
  "${apt[@]}" update >/dev/null && "${apt[@]}" source libcgns >/dev/null || exit 77
  source=$(find "$folder" -maxdepth 1 -type d -name 'libcgns-*' | head -1)
  # As Debian builds it.
  cmake -S "$source" -B "$folder/build" -DCMAKE_C_COMPILER="${CC:-clang}" -DCMAKE_BUILD_TYPE=None \
    -DCMAKE_C_FLAGS="-g -O1 -w -fno-omit-frame-pointer -fsanitize=address,undefined,fuzzer-no-link -fno-sanitize=alignment" \
    -DCGNS_ENABLE_HDF5=ON -DCGNS_ENABLE_LEGACY=ON -DCGNS_ENABLE_64BIT=OFF -DCGNS_ENABLE_BASE_SCOPE=ON -DCGNS_ENABLE_SCOPING=OFF \
    -DCGNS_BUILD_SHARED=ON -DCGNS_USE_SHARED=ON >build.log 2>&1
  cmake --build "$folder/build" --target cgns_shared >>build.log 2>&1
  cp "$(find "$folder/build" -name 'libcgns.so*' -type f | head -1)" "$library"
fi
[[ $# -eq 0 ]] || LD_LIBRARY_PATH=$folder/lib${LD_LIBRARY_PATH:+:$LD_LIBRARY_PATH} exec "$@"
