#!/usr/bin/env bash
# A program without window, annotations and bench: configures where GLFW, Dear ImGui and Cairo are not to be found,
# and compiles what stands in for the parts that are left out.
#
#   tests/install/headless_test.sh
set -euo pipefail

root=$(cd "$(dirname "${BASH_SOURCE[0]}")/../.." && pwd)
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
quietly() { "$@" > "$folder/log" 2>&1 || { cat "$folder/log"; echo "FAILED: $*"; exit 1; }; }

cat > "$folder/pkg-config" << 'END'
#!/bin/sh
case "$*" in *imgui* | *cairo*) exit 1 ;; esac
exec pkg-config "$@"
END
chmod +x "$folder/pkg-config"
without=(-DCMAKE_DISABLE_FIND_PACKAGE_glfw3=ON -DPKG_CONFIG_EXECUTABLE="$folder/pkg-config")
quickly=(-DCURVISPLAT_PRECOMPILE=OFF -DCURVISPLAT_UNITY=OFF -DCMAKE_CXX_FLAGS_RELEASE=-O0)

quietly cmake --preset headless -S "$root" -B "$folder/build" "${without[@]}" "${quickly[@]}"
tools=tools/CMakeFiles/curvisplat.dir
quietly cmake --build "$folder/build" --target \
  $tools/window/window_left_out.cpp.o $tools/commands/{view,serve,bench}_left_out.cpp.o \
  render/annotate/CMakeFiles/curvisplat_render_annotate.dir/annotations_left_out.cpp.o

quietly cmake -S "$root" -B "$folder/build" -DCURVISPLAT_THROUGHPUT=ON
quietly cmake --build "$folder/build" --target render/annotate/CMakeFiles/curvisplat_render_annotate.dir/plot_left_out.cpp.o

# That they are hidden here is seen where they are asked for.
if cmake -S "$root" -B "$folder/build" -DCURVISPLAT_ANNOTATIONS=ON > "$folder/log" 2>&1; then
  echo "FAILED: annotations configure without Cairo"
  exit 1
fi
echo "configures without GLFW, Dear ImGui and Cairo"
