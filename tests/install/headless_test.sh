#!/usr/bin/env bash
# A program without window, annotations and bench: configures where GLFW, Dear ImGui and Cairo are not to be found,
# and checks the sources of what stands in for the parts that are left out.
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
quickly=(-DCURVISPLAT_PRECOMPILE=OFF -DCURVISPLAT_UNITY=OFF -DCMAKE_CXX_FLAGS_RELEASE=-fsyntax-only)

quietly cmake --preset headless -S "$root" -B "$folder/build" "${without[@]}" "${quickly[@]}"
# All at once: nearly all of the time goes to headers.
cat > "$folder/check.py" << 'END'
import json
import shlex
import subprocess
import sys

build, *sources = sys.argv[1:]
with open(f"{build}/compile_commands.json", encoding="utf-8") as file:
    commands = {entry["file"]: shlex.split(entry["command"]) for entry in json.load(file)}
together = f"{build}/together.cpp"
with open(together, "w", encoding="utf-8") as file:
    file.writelines(f'#include "{source}"\n' for source in sources)
for source in sources:
    assert source in commands, f"{source} is not compiled"
words = commands[sources[0]]
words[words.index("-o") + 1], words[words.index("-c") + 1] = "/dev/null", together
sys.exit(subprocess.run(words, cwd=build).returncode)
END
quietly python3 "$folder/check.py" "$folder/build" "$root"/tools/commands/{view,serve,bench}_left_out.cpp \
  "$root/tools/window/window_left_out.cpp" "$root/render/annotate/annotations_left_out.cpp"

# With CURVISPLAT_WHOLE set, also what stands in for plots.
[[ ! -v CURVISPLAT_WHOLE ]] || quietly cmake -S "$root" -B "$folder/build" -DCURVISPLAT_THROUGHPUT=ON
[[ ! -v CURVISPLAT_WHOLE ]] || quietly python3 "$folder/check.py" "$folder/build" "$root/render/annotate/plot_left_out.cpp"

# That they are hidden here is seen where they are asked for.
if cmake -S "$root" -B "$folder/build" -DCURVISPLAT_ANNOTATIONS=ON > "$folder/log" 2>&1; then
  echo "FAILED: annotations configure without Cairo"
  exit 1
fi
echo "configures without GLFW, Dear ImGui and Cairo"
