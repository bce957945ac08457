#!/bin/sh
# SPDX-FileCopyrightText: 2026 The CompMark authors
# SPDX-License-Identifier: Apache-2.0
#
# From nothing to a marked, compressed scene and its proof: installs what is missing, builds the tool, writes the built-in scene, trains it briefly
# for a small file, hides the message of a new key in what the file says; decodes that file in another process, renders it, and verifies the images. With --data it does the same on a capture of yours, and takes longer for the mark.
#   sh examples/quickstart.sh [--data capture] [--downscale by] [--out folder] [--iterations number] [--mark-iterations number] [--voxel-size length]
# Exit status: 0 if the message is proven; if all went well and it is not found 1, or 3 if that is undecided, as compmark verify says; an error's
# is whatever the command that failed gave, 2 for a word that is no option.
set -eu
here=$(pwd)
data='' out='' iterations='' downscale=1 mark_iterations='' mark_rate='' voxel_size=''
usage='[--data capture] [--downscale by] [--out folder] [--iterations number] [--mark-iterations number] [--voxel-size length]'
while [ $# -gt 0 ]; do
  case $1 in
    --data | --out | --iterations | --downscale | --mark-iterations | --voxel-size) [ $# -gt 1 ] || { echo "quickstart: $1 has no value" >&2; exit 2; } ;;
    *) echo "quickstart: $1 is no option: $usage" >&2; exit 2 ;;
  esac
  case $1 in
    --data) data=$2 ;;
    --out) out=$2 ;;
    --iterations) iterations=$2 ;;
    --downscale) downscale=$2 ;;
    --mark-iterations) mark_iterations=$2 ;;
    --voxel-size) voxel_size=$2 ;;
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
begin=$(date +%s)

mkdir -p "$out"
if [ -z "$data" ]; then
  data=$out/scene
  voxel_size=${voxel_size:-0} # its points lie on its surfaces, as densely as they should
  iterations=${iterations:-3000}
  mark_iterations=${mark_iterations:-1000} # few and fast: docs/notebook/measured.md has what that costs
  mark_rate=0.02
  "$compmark" scene --out "$data" --width 400 --height 400 --train 60 --test 8
else
  iterations=${iterations:-4000}
  "$compmark" probe --data "$data"
fi
split=test # what is measured; a capture without test views is measured in its training views
case $("$compmark" probe --data "$data" --json) in *'"views_test": 0,'*) split=train ;; esac
[ -f "$out/owner.key" ] || "$compmark" keygen --bits 48 --out "$out/owner.key"
"$compmark" claim --key "$out/owner.key" --out "$out/owner.claim"
"$compmark" train --data "$data" --downscale "$downscale" --out "$out/run" --iterations "$iterations" ${voxel_size:+--voxel-size "$voxel_size"} \
  --codec hac --lambda 0.001 --key "$out/owner.key" ${mark_iterations:+--mark-iterations "$mark_iterations"} ${mark_rate:+--message-rate "$mark_rate"} --resume
small=$out/run/model.cmk
unmarked=$out/run/unmarked.cmk
echo
echo "The small file and what the model was before it, each beside the same without a mark, which says nothing to the key:"
"$compmark" evaluate --model "$small" "$out/run/model.safetensors" --unmarked "$unmarked" "$out/run/unmarked/model.safetensors" \
  --data "$data" --downscale "$downscale" --split "$split" \
  --key "$out/owner.key" --json "$out/figures.json" --html "$out/before_and_after.html"
echo
echo "Is it ours? Other processes decode the small file and render what it says; whoever verifies knows the images alone:"
renders=$out/run/renders # not beside the photographs, whatever folder --out is
rm -rf "$renders"
"$compmark" decompress --model "$small" --out "$out/run/decoded.safetensors"
"$compmark" render --model "$out/run/decoded.safetensors" --split "$split" --out "$renders"
verdict=0
"$compmark" verify --images "$renders" --key "$out/owner.key" --claim "$out/owner.claim" --json "$out/proof.json" || verdict=$?
case $verdict in 0 | 1 | 3) ;; *) exit "$verdict" ;; esac # an error, and it has been said

# A number or a word at the top of a JSON file as the tool writes it.
value() { sed -n 's/^  "'"$2"'": "\{0,1\}\([^",{]*\)"\{0,1\},\{0,1\}$/\1/p' "$1" | head -n 1; }
bytes() { wc -c <"$1" | tr -d ' '; }
row() { printf '  %-44s %s\n' "$1" "$2"; }
rounded() { # what is no number stays as it is
  case $1 in *[0-9]*) LC_ALL=C awk -v format="$2" -v number="$1" 'BEGIN { printf format, number }' ;; *) printf '%s' "${1:-unknown}" ;; esac
}
psnr=$(value "$out/figures.json" psnr)
cost=$(value "$out/figures.json" psnr_cost_vs_unmarked)
echo
echo "Result"
row "the file against the photographs, PSNR" "$(rounded "$psnr" %.2f) dB, mean of $(find "$renders" -name '*.png' | wc -l | tr -d ' ') $split views"
row "lost to the unmarked file" "$(rounded "$cost" %.2f) dB"
row "size of the file, and of the unmarked one" "$(bytes "$small") and $(bytes "$unmarked") bytes"
row "bits that are right, all images together" "$(value "$out/proof.json" matches) of $(value "$out/proof.json" bits)"
row "p-value" "$(rounded "$(value "$out/proof.json" p_value)" %.1e)"
row "verdict" "$(value "$out/proof.json" verdict | tr _ ' ')"
row "time, without the build" "$(date +%s | LC_ALL=C awk -v begin="$begin" '{ printf "%.1f", ($1 - begin) / 60 }') minutes"
echo
echo "the report: $out/run/report.html"
echo "the codec:  $out/before_and_after.html"
echo "the proof:  $out/proof.json, with the claim $out/owner.claim, which an owner publishes before anybody else has the scene"
echo "the file:   $small"
echo "its images: $renders"
if [ -n "${DISPLAY:-}${WAYLAND_DISPLAY:-}" ] && command -v xdg-open >/dev/null 2>&1; then
  xdg-open "$out/run/report.html" >/dev/null 2>&1 || true
fi
if [ "$verdict" -ne 0 ]; then
  echo "quickstart: the message is not proven by these images; the report says how far it is" >&2
  exit "$verdict"
fi
