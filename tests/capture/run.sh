#!/bin/sh
# SPDX-FileCopyrightText: 2026 The CompMark authors
# SPDX-License-Identifier: Apache-2.0
#
# examples/capture.sh from a video to a capture: sh run.sh <source folder>. The script's own part is tested: what it reads of the answers of ffmpeg
# and COLMAP, of both generations of COLMAP's, what it asks of either, and going on after an interruption. Those programs are replaced by shell scripts that answer alike.
set -eu
source=$1
scratch=$(mktemp -d)
trap 'rm -rf "$scratch"' EXIT
mkdir "$scratch/bin"
cat >"$scratch/bin/ffmpeg" <<'END'
#!/bin/sh
for last; do :; done
case $last in
  -) i=0; while [ $i -lt 40 ]; do echo "lavfi.blur=$((i * 7 % 5)).5"; i=$((i + 1)); done ;;
  *) i=1; while [ $i -le 12 ]; do : >"$(dirname "$last")/$(printf '%04d' $i).jpg"; i=$((i + 1)); done ;;
esac
END
cat >"$scratch/bin/colmap" <<'END'
#!/bin/sh
command=$1
value() { # option, words...
  option=$1
  shift
  while [ $# -gt 1 ]; do [ "$1" != "$option" ] || echo "$2"; shift; done
}
# As COLMAP does, an option that it has not is refused. From 3.13 on two have other names.
extraction=SiftExtraction matching=SiftMatching
[ -z "${COLMAP_313:-}" ] || extraction=FeatureExtraction matching=FeatureMatching
case $command in
  feature_extractor) known="database_path image_path ImageReader.single_camera ImageReader.camera_model $extraction.use_gpu SiftExtraction.max_num_features" ;;
  exhaustive_matcher) known="database_path $matching.use_gpu" ;;
  sequential_matcher) known="database_path $matching.use_gpu SequentialMatching.overlap" ;;
  *) known= ;;
esac
if [ -n "$known" ]; then
  if [ "${2:-}" = -h ]; then
    echo "Options can either be specified via command-line or by defining them in a .ini file passed to --project_path."
    for option in $known; do echo "  --$option arg"; done
    exit 0
  fi
  cpu=
  for word; do
    case $word in --*)
      case " $known " in *" ${word#--} "*) ;; *) echo "Failed to parse options - unrecognised option '$word'." >&2; exit 1 ;; esac
      case $word in *.use_gpu) cpu=$(value "$word" "$@") ;; esac ;;
    esac
  done
  [ "$cpu" = 0 ] || { echo "qt.qpa.xcb: could not connect to display" >&2; exit 134; } # left at its default, it wants a GPU
fi
case $command in
  mapper) mkdir -p "$(value --output_path "$@")/0" ;;
  model_orientation_aligner) : >"$(value --output_path "$@")/cameras.bin" ;;
  model_analyzer)
    [ -z "${ANALYZER_FAILS:-}" ] || { echo "cannot read the model"; exit 3; }
    for line in "Cameras: 1" "Images: ${REGISTERED:-12}" "Registered images: ${REGISTERED:-12}" "Points: 345" "Mean reprojection error: 0.61px"; do echo "${PREFIX:-}$line"; done ;;
esac
END
chmod +x "$scratch/bin/ffmpeg" "$scratch/bin/colmap"
PATH=$scratch/bin:$PATH
export PATH
echo video >"$scratch/video.mp4"

# capture <expected exit status> <folder> [option]...
capture() {
  wanted=$1 folder=$2 status=0
  shift 2
  sh "$source/examples/capture.sh" --video "$scratch/video.mp4" --out "$scratch/$folder" --frames 12 "$@" >"$scratch/said.txt" 2>&1 || status=$?
  [ $status -eq "$wanted" ] || { echo "$folder: exit status $status, expected $wanted"; cat "$scratch/said.txt"; exit 1; }
}
says() { grep -q -F "$1" "$scratch/said.txt" || { echo "does not say: $1"; cat "$scratch/said.txt"; exit 1; }; }
frames() { [ "$(find "$scratch/$1/images" -type f | wc -l)" -eq 12 ] && [ ! -e "$scratch/$1/images/images.part" ] || { echo "$1: not twelve frames"; exit 1; }; }

capture 0 plain
says "model 0: 12 of 12 frames, 345 points, reprojection error 0.61px"
says "next: compmark probe --data"
frames plain
capture 0 plain # finished: nothing is done again
says "cameras: done before"
capture 2 plain --size 800
says "with other options"

capture 0 pairs --every-pair
frames pairs

# Newer versions of COLMAP put time and place before every line, and have other names for two options.
PREFIX='I20261129 08:00:00.000000 12345 model.cc:61] '
COLMAP_313=1
export PREFIX COLMAP_313
capture 0 logged
says "model 0: 12 of 12 frames, 345 points"
capture 0 logged_pairs --every-pair
unset PREFIX
# Control: what a version does not know is refused, so that the script has asked.
colmap sequential_matcher --SiftMatching.use_gpu 0 2>/dev/null && { echo "the new stand-in takes the old option"; exit 1; }
unset COLMAP_313
colmap sequential_matcher --FeatureMatching.use_gpu 0 2>/dev/null && { echo "the old stand-in takes the new option"; exit 1; }

REGISTERED=5
export REGISTERED
capture 1 few
says "fewer than half"
unset REGISTERED

ANALYZER_FAILS=1
export ANALYZER_FAILS
capture 1 unread
says "cannot read the model"
unset ANALYZER_FAILS

# Stopped when the frames were there and the step was not noted: the next run makes them again, and not into the old ones.
capture 0 stopped
rm "$scratch/stopped/colmap/frames.done" "$scratch/stopped/colmap/upright.done"
capture 0 stopped
says "12 of 12 frames"
frames stopped
[ ! -e "$scratch/stopped/sparse/sparse.part" ] || { echo "a model inside the old one"; exit 1; }
