#!/usr/bin/env bash
# A build without Linux's own calls: compiles what stands in for them, where liburing is not to be found. With CURVISPLAT_WHOLE set, or
# where FOLDER has such a build, builds the program, too: it converts and draws the same bits as PROGRAM, and names none of these calls.
#
#   tests/install/portable_test.sh PROGRAM [FOLDER]
set -euo pipefail

root=$(cd "$(dirname "${BASH_SOURCE[0]}")/../.." && pwd)
program=$1
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
build=${2:-$folder/build}
quietly() { "$@" > "$folder/log" 2>&1 || { cat "$folder/log"; echo "FAILED: $*"; exit 1; }; }

if [[ -z ${2:-} ]]; then
  cat > "$folder/pkg-config" << 'END_OF_SCRIPT'
#!/bin/sh
case "$*" in *liburing*) exit 1 ;; esac
exec pkg-config "$@"
END_OF_SCRIPT
  chmod +x "$folder/pkg-config"
  quickly=(-DCURVISPLAT_PRECOMPILE=OFF -DCURVISPLAT_UNITY=OFF -DCMAKE_CXX_FLAGS_RELEASE=-O0)
  [[ -z ${CURVISPLAT_WHOLE:-} ]] || quickly=()
  quietly cmake --preset headless -S "$root" -B "$build" -DCURVISPLAT_PORTABLE=ON -DPKG_CONFIG_EXECUTABLE="$folder/pkg-config" "${quickly[@]}"
fi
if [[ -z ${CURVISPLAT_WHOLE:-} && -z ${2:-} ]]; then
  tools=tools/CMakeFiles/curvisplat.dir
  quietly cmake --build "$build" --target stream/base/CMakeFiles/curvisplat_stream_base.dir/os_left_out.cpp.o \
    stream/paging/CMakeFiles/curvisplat_stream_paging.dir/uring_reads_left_out.cpp.o \
    $tools/commands/folder_events_left_out.cpp.o $tools/early_start_left_out.cpp.o
  echo "compiles what stands in for Linux's own calls"
  exit 0
fi

[[ -n ${2:-} ]] || quietly cmake --build "$build" --target curvisplat
portable=$build/tools/curvisplat
if nm -D --undefined-only "$portable" | grep -E ' (io_uring_|memfd_create|inotify_|renameat2|posix_fadvise|posix_fallocate|fallocate|mallo(c_trim|pt)|prctl|gettid|getrandom|statfs|madvise|mincore|pthread_(set|get)name_np|pthread_setattr_default_np)' > "$folder/calls"; then
  cat "$folder/calls"
  echo "FAILED: the portable program calls what Linux alone has"
  exit 1
fi
for each in "$program" "$portable"; do
  name=$([[ $each == "$program" ]] && echo own || echo portable)
  mkdir "$folder/$name"
  quietly "$each" generate half-annulus --size 40x24x24 --output "$folder/$name/grid"
  quietly "$each" convert "$folder/$name/grid.xyz" "$folder/$name/grid.fun" --output "$folder/$name/cache.splats"
  quietly "$each" render "$folder/$name/cache.splats" --size 200x150 -o "$folder/$name/picture.png"
  quietly "$each" info "$folder/$name/cache.splats" --verify
done
for file in cache.splats/{bricks,geometry,var.0,faces}.bin picture.png; do
  cmp "$folder/own/$file" "$folder/portable/$file" || { echo "FAILED: $file differs"; exit 1; }
done
echo "converts and draws the same bits without Linux's own calls"
