#!/bin/sh
# SPDX-FileCopyrightText: 2026 The CompMark authors
# SPDX-License-Identifier: Apache-2.0
#
# From nothing to a marked, compressed scene and its proof: installs what is missing, builds the tool, writes the built-in scene, trains it briefly
# with the message of a new key in it, compresses it to one small file, and renders, measures and verifies that file.
#   sh examples/quickstart.sh [output folder [iterations]]
set -eu
cd "$(dirname "$0")/.."
out=${1:-runs/quickstart}
iterations=${2:-4000}
jobs=$(getconf _NPROCESSORS_ONLN 2>/dev/null || echo 2)

sh cmake/install_dependencies.sh
cmake --preset release -DCOMPMARK_BUILD_TESTS=OFF -DCOMPMARK_BUILD_BENCHMARKS=OFF >/dev/null
cmake --build build/release --target compmark_tool -j "$jobs"
compmark=build/release/bin/compmark

"$compmark" scene --out "$out/scene" --width 400 --height 400 --train 60 --test 8
decoder=weights/lattice_48.safetensors
[ -f "$out/owner.key" ] || "$compmark" keygen --bits 48 --out "$out/owner.key"
"$compmark" train --data "$out/scene" --out "$out/run" --iterations "$iterations" --voxel-size 0 --codec hac --lambda 0.001 \
  --key "$out/owner.key" --decoder "$decoder" --message-weight 0.005
small=$out/run/model.cmk
"$compmark" info "$small"
"$compmark" render --model "$small" --out "$out/images"
"$compmark" evaluate --model "$small" --data "$out/scene"
echo
echo "Is it ours? From the small file, which another process decodes:"
"$compmark" verify --model "$small" --key "$out/owner.key" --decoder "$decoder" --json "$out/proof.json" || true

echo
echo "pictures:   $out/images"
echo "the report: $out/run/report.html"
echo "the proof:  $out/proof.json"
if [ -n "${DISPLAY:-}${WAYLAND_DISPLAY:-}" ] && command -v xdg-open >/dev/null 2>&1; then
  xdg-open "$out/run/report.html" >/dev/null 2>&1 || true
fi
