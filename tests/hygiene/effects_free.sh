#!/bin/sh
# SPDX-FileCopyrightText: 2026 The CompMark authors
# SPDX-License-Identifier: Apache-2.0
#
# What a recipe leaves out costs nothing. For each effect and each stage of the watermark and of the codecs: the object
# file of the plain recipe has no symbol of it, that of the recipe with it
# has some (the negative control). The plain recipe ends with the same bits as passes written by hand without any thought of effects, and
# executes as many instructions within 0.1 % (callgrind). Where valgrind is not installed the count is skipped, or with CI in the environment
# a failure: .ci/run installs it.
#   effects_free.sh <compiler> [flags]
set -eu
compiler=$1
shift
source=$(dirname "$0")/effect_step.cpp
# Of one name beside the build, not a temporary one: a compiler cache knows the compilations then, twenty of them and the header that they read.
folder=$PWD/effects_free
rm -rf "$folder"
mkdir "$folder"
cached=$(command -v ccache || true)
export CCACHE_SLOPPINESS=pch_defines,time_macros # without which it takes no precompiled header
trap 'rm -rf "$folder"' EXIT
bad=0

build() { # name, command with macros...
  name=$1
  shift
  $cached "$@" -c "$source" -o "$folder/$name.o"
  "$compiler" "$folder/$name.o" -o "$folder/$name" -pthread
}
# Symbols without optimisation, where nothing is inlined out of sight; bits and instructions with it. No -march: valgrind does not know
# every instruction of today's processors.
symbols() {
  nm -C "$folder/$1.o" >"$folder/symbols"
  grep -cE "$2" "$folder/symbols" || true
}
# What is drawn or counted outside of an iteration (a random background, the cells of the anchors) is in the trainer alone: "trainer" in
# the third column compiles it too, on both sides.
# What the source includes is read once for all of them, not twenty times. There is no step.hpp beside step.hpp.gch: were the latter refused, nothing
# would compile.
grep '^#include' "$source" >"$folder/includes.hpp"
$cached "$compiler" -std=c++20 -O0 "$@" -x c++-header "$folder/includes.hpp" -o "$folder/step.hpp.gch"
object() { # name, recipe, "" or trainer, flags...
  object_name=$1
  object_recipe=$2
  object_part=${3:+-DEFFECT_TRAINER}
  shift 3
  # shellcheck disable=SC2086 # one word or none
  $cached "$compiler" -std=c++20 -O0 "$@" -include "$folder/step.hpp" $object_part -DEFFECT_RECIPE="$object_recipe" -c "$source" -o "$folder/$object_name.o"
}
object bare Scaffold "" "$@"
object bare_trainer Scaffold trainer "$@"
while read -r recipe pattern part; do
  object effect "$recipe" "$part" "$@"
  with=$(symbols effect "$pattern")
  without=$(symbols "bare${part:+_$part}" "$pattern")
  echo "$pattern: $with symbols in $recipe, $without in the plain recipe${part:+ ($part)}"
  [ "$with" -gt 0 ] && [ "$without" -eq 0 ] || { echo "  WRONG"; bad=1; }
done <<LIST
ScaffoldMasked MaskedPixels
ScaffoldExposure AffineExposure
ScaffoldAlpha L1AlphaLoss
ScaffoldAntiAliased MipFilter
ScaffoldLens RadialTangentialLens
ScaffoldFisheye FisheyeLens
ScaffoldAppearance AppearanceEmbedding
WithMark BoundedResidual
WithMark LatticeDecoder
WithMark HsvLoss
WithFrequencies FrequencyLoss
WithNoise QuantizationNoise
WithEdits EditChain
WithoutAnchors LostAnchorsStage
HacScaffold HacModel
ContextGsScaffold ContextGsModel
WithMark NovelViewReading trainer
ScaffoldAlpha RandomBackground trainer
ScaffoldFarField ContractedSpace trainer
LIST
build plain "$compiler" -std=c++20 -O2 "$@" -DEFFECT_RECIPE=Scaffold
build hand "$compiler" -std=c++20 -O2 "$@" -DEFFECT_BY_HAND

plain=$("$folder/plain" 3)
hand=$("$folder/hand" 3)
echo "hash of render and gradient: $plain by the pipeline, $hand by hand"
[ "$plain" = "$hand" ] || { echo "  DIFFERENT"; bad=1; }

if command -v valgrind >/dev/null; then
  instructions() { # of six iterations less those of three: setting up does not count
    for n in 3 6; do
      valgrind --tool=callgrind --callgrind-out-file=/dev/null "$folder/$1" $n 2>&1 >/dev/null | awk '/Collected/ { print $NF }'
    done | awk 'NR == 1 { first = $1 } NR == 2 { printf "%d", $1 - first }'
  }
  plain=$(instructions plain)
  hand=$(instructions hand)
  echo "instructions of three iterations: $plain by the pipeline, $hand by hand"
  awk -v a="$plain" -v b="$hand" 'BEGIN { exit !(a > 0 && (a - b) <= 0.001 * b && (b - a) <= 0.001 * b) }' || { echo "  NOT WITHIN 0.1 %"; bad=1; }
elif [ -n "${CI:-}" ]; then
  echo "  MISSING: valgrind, without which instructions are not counted (sh cmake/install_dependencies.sh ci installs it)"
  bad=1
else
  echo "skipped: valgrind is not installed, instructions were not counted"
fi
exit $bad
