#!/bin/sh
# SPDX-FileCopyrightText: 2026 The CompMark authors
# SPDX-License-Identifier: Apache-2.0
#
# From nothing to a trained scene: installs what is missing, builds the tool, writes the built-in scene, trains it briefly, renders and
# measures it.   sh examples/quickstart.sh [output folder [iterations]]
# Marking, compressing, decoding and verifying join this script when those commands exist; today it ends with the measured model.
set -eu
cd "$(dirname "$0")/.."
out=${1:-runs/quickstart}
iterations=${2:-2000}
jobs=$(getconf _NPROCESSORS_ONLN 2>/dev/null || echo 2)

sh cmake/install_dependencies.sh
cmake --preset release -DCOMPMARK_BUILD_TESTS=OFF -DCOMPMARK_BUILD_BENCHMARKS=OFF >/dev/null
cmake --build build/release --target compmark_tool -j "$jobs"
compmark=build/release/bin/compmark

"$compmark" scene --out "$out/scene" --width 400 --height 400 --train 60 --test 8
"$compmark" train --data "$out/scene" --out "$out/run" --iterations "$iterations" --voxel-size 0
"$compmark" render --model "$out/run/model.safetensors" --out "$out/images"
"$compmark" evaluate --model "$out/run/model.safetensors" --data "$out/scene"
"$compmark" info "$out/run/model.safetensors"

echo
echo "pictures:   $out/images"
echo "the report: $out/run/report.html"
if [ -n "${DISPLAY:-}${WAYLAND_DISPLAY:-}" ] && command -v xdg-open >/dev/null 2>&1; then
  xdg-open "$out/run/report.html" >/dev/null 2>&1 || true
fi
