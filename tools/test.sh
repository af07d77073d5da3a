#!/usr/bin/env bash
# Sets up, builds everything and runs every test. Arguments go to ctest: tools/test.sh -R render
set -euo pipefail

root=$(cd "$(dirname "${BASH_SOURCE[0]}")/.." && pwd)
"$root/tools/setup.sh" python3-vtk9  # the smoke test of bench/ draws with VTK as well
"$root/tools/build.sh"
ctest --test-dir "$root/build/release" --output-on-failure --no-tests=error -j2 "$@"
