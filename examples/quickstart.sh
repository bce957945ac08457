#!/bin/sh
# SPDX-FileCopyrightText: 2026 The CompMark authors
# SPDX-License-Identifier: Apache-2.0
#
# From nothing to a marked, compressed scene and its proof: installs what is missing, builds the tool, writes the built-in scene, trains it briefly
# for a small file, fits a message decoder to it, hides the message of a new key in what the file says, and renders, measures and verifies that
# file. With --data it does the same on a capture of yours, and takes longer for the mark.
#   sh examples/quickstart.sh [--data capture] [--downscale by] [--out folder] [--iterations number]
set -eu
here=$(pwd)
data='' out='' iterations=4000 downscale=1
while [ $# -gt 0 ]; do
  case $1 in
    --data | --out | --iterations | --downscale) [ $# -gt 1 ] || { echo "quickstart: $1 has no value" >&2; exit 2; } ;;
    *) echo "quickstart: $1 is no option: [--data capture] [--downscale by] [--out folder] [--iterations number]" >&2; exit 2 ;;
  esac
  case $1 in
    --data) data=$2 ;;
    --out) out=$2 ;;
    --iterations) iterations=$2 ;;
    --downscale) downscale=$2 ;;
  esac
  shift 2
done
# Folders are said from where the caller stands.
absolute() { case $1 in /*) printf '%s' "$1" ;; *) printf '%s/%s' "$here" "$1" ;; esac; }
if [ -n "$data" ]; then
  [ -d "$data" ] || { echo "quickstart: --data $data is no folder" >&2; exit 2; }
  data=$(absolute "$data")
fi
[ -z "$out" ] || out=$(absolute "$out")
cd "$(dirname "$0")/.."
out=${out:-runs/quickstart}
jobs=$(getconf _NPROCESSORS_ONLN 2>/dev/null || echo 2)

sh cmake/install_dependencies.sh
cmake --preset release -DCOMPMARK_BUILD_TESTS=OFF -DCOMPMARK_BUILD_BENCHMARKS=OFF >/dev/null
cmake --build build/release --target compmark_tool -j "$jobs"
compmark=build/release/bin/compmark

mkdir -p "$out"
voxel_size='' mark=''
if [ -z "$data" ]; then
  data=$out/scene
  voxel_size='--voxel-size 0' # its points lie on its surfaces, as densely as they should
  mark='--mark-iterations 1500' # enough for every bit of every view
  "$compmark" scene --out "$data" --width 400 --height 400 --train 60 --test 8
else
  "$compmark" probe --data "$data"
fi
split=test # what is measured; a capture without test views is measured in its training views
case $("$compmark" probe --data "$data" --json) in *'"views_test": 0,'*) split=train ;; esac
[ -f "$out/owner.key" ] || "$compmark" keygen --bits 48 --out "$out/owner.key"
# shellcheck disable=SC2086 # two words or none
"$compmark" train --data "$data" --downscale "$downscale" --out "$out/run" --iterations "$iterations" $voxel_size --codec hac --lambda 0.001 \
  --key "$out/owner.key" $mark --resume
decoder=$out/run/decoder.safetensors
small=$out/run/model.cmk
"$compmark" info "$small"
"$compmark" render --model "$small" --split "$split" --out "$out/images"
echo
echo "Before and after the codec, and the unmarked file, which says nothing to the key:"
"$compmark" evaluate --model "$out/run/model.safetensors" "$small" "$out/run/unmarked.cmk" --data "$data" --downscale "$downscale" --split "$split" --key "$out/owner.key" \
  --decoder "$decoder" --json "$out/figures.json" --html "$out/before_and_after.html"
echo
echo "Is it ours? From the small file, which another process decodes:"
"$compmark" verify --model "$small" --split "$split" --key "$out/owner.key" --decoder "$decoder" --json "$out/proof.json" || true

echo
echo "pictures:   $out/images"
echo "the report: $out/run/report.html"
echo "the codec:  $out/before_and_after.html"
echo "the proof:  $out/proof.json"
if [ -n "${DISPLAY:-}${WAYLAND_DISPLAY:-}" ] && command -v xdg-open >/dev/null 2>&1; then
  xdg-open "$out/run/report.html" >/dev/null 2>&1 || true
fi
