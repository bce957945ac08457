#!/bin/sh
# SPDX-FileCopyrightText: 2026 The CompMark authors
# SPDX-License-Identifier: Apache-2.0
#
# From a video to a capture that compmark trains on: chooses the sharpest frames (ffmpeg), computes their cameras (COLMAP, without a GPU), turns the scene upright, and says what is worth knowing of it. docs/capture.md explains each step.
#   sh examples/capture.sh --video video --out folder [--frames number] [--size pixels] [--features number] [--overlap number] [--every-pair]
# An interrupted run goes on where it was when the same line is given again. A folder that holds anything else is left alone.
# Exit status: 0; 1 if fewer than half of the frames have a camera; 2 for a word that is no option, a missing program and a folder that is in use; else that of the command that failed.
set -eu
video='' out='' frames=150 size=1600 features=2048 overlap=10 pairs=sequential
usage='--video video --out folder [--frames number] [--size pixels] [--features number] [--overlap number] [--every-pair]'
fail() { echo "capture: $1" >&2; exit 2; }
while [ $# -gt 0 ]; do
  case $1 in
    --every-pair) pairs=exhaustive; shift; continue ;;
    --video | --out | --frames | --size | --features | --overlap) [ $# -gt 1 ] || fail "$1 has no value" ;;
    *) fail "$1 is no option: $usage" ;;
  esac
  case $1 in
    --frames | --size | --features | --overlap) case $2 in '' | 0* | *[!0-9]*) fail "$1 $2 is no number above 0" ;; esac ;;
  esac
  case $1 in
    --video) video=$2 ;;
    --out) out=$2 ;;
    --frames) frames=$2 ;;
    --size) size=$2 ;;
    --features) features=$2 ;;
    --overlap) overlap=$2 ;;
  esac
  shift 2
done
if [ -z "$video" ] || [ -z "$out" ]; then fail "$usage"; fi
[ -f "$video" ] || fail "--video $video is no file"
if [ "$frames" -lt 3 ] || [ "$frames" -gt 2000 ]; then fail "--frames $frames is not from 3 to 2000"; fi
missing=''
for program in ffmpeg colmap; do
  command -v "$program" >/dev/null 2>&1 || missing="$missing $program"
done
[ -z "$missing" ] || fail "not installed:$missing; on Debian and Ubuntu: sudo apt-get install$missing"
case $video in -*) video=./$video ;; esac
case $out in -*) out=./$out ;; esac

# What the folder was made with. Only a folder that was made with the same is gone on with.
work=$out/colmap
made="$(cksum <"$video") --frames $frames --size $size --features $features --overlap $overlap $pairs"
if [ -e "$out" ] && [ -n "$(ls -A "$out" 2>/dev/null)" ]; then
  [ -f "$work/made" ] || fail "$out is not empty and not of this script; choose another --out"
  [ "$(cat "$work/made")" = "$made" ] || fail "$out was made of another video or with other options; choose another --out"
fi
mkdir -p "$work"
echo "$made" >"$work/made"
begin=$(date +%s)
say() { printf '%4d s  %s\n' $(($(date +%s) - begin)) "$1"; }
# A step runs unless it was finished before; what it prints is kept, and its end is shown when it fails. (Within one, set -e does not end the script.)
step() { # name, what it does, command ...
  name=$1 what=$2
  shift 2
  if [ -f "$work/$name.done" ]; then
    say "$what: done before"
    return
  fi
  say "$what ..."
  "$@" >"$work/$name.log" 2>&1 </dev/null || {
    status=$?
    tail -n 20 "$work/$name.log" >&2
    echo "capture: this step failed; all that it printed is in $work/$name.log" >&2
    exit "$status"
  }
  : >"$work/$name.done"
}

# The frames are parted into as many equal spans as photographs are asked for, and of each the sharpest is taken, judged at 640 pixels.
# A frame without an edge has no sharpness, and is taken only where its whole span has none.
choose_frames() {
  ffmpeg -nostdin -v error -i "$video" -map 0:v:0 -vf "scale=w=min(iw\\,640):h=min(ih\\,640):force_original_aspect_ratio=decrease,blurdetect,metadata=print:file=-" -f null - >"$work/blur.txt" || return
  LC_ALL=C awk -v wanted="$frames" '
    /^lavfi[.]blur=/ { sub(/.*=/, ""); blur[count++] = /nan|inf/ ? 1e9 : $0 + 0 }
    END {
      if (count < 3) { print "too few frames in the video" > "/dev/stderr"; exit 1 }
      spans = wanted < count ? wanted : count
      for (i = 0; i < count; ++i) {
        span = int(i * spans / count)
        if (!(span in best) || blur[i] < blur[best[span]]) best[span] = i
      }
      printf "select=(" # in groups: a sum of more than a hundred terms is too deep for ffmpeg
      for (span = 0; span < spans; ++span) printf "%seq(n\\,%d)", span % 40 ? "+" : span ? ")+(" : "", best[span]
      printf "),scale=w=min(iw\\,%d):h=min(ih\\,%d):force_original_aspect_ratio=decrease\n", size, size
    }' size="$size" "$work/blur.txt" >"$work/choice.txt"
}
extract_frames() {
  rm -rf "$out/images.part" && mkdir "$out/images.part" || return
  ffmpeg -nostdin -v error -i "$video" -map 0:v:0 -filter_script:v "$work/choice.txt" -fps_mode passthrough -q:v 2 "$out/images.part/%04d.jpg" || return
  rm -rf "$out/images" # of a step that was stopped before it was done
  mv "$out/images.part" "$out/images"
}
export QT_QPA_PLATFORM=offscreen # COLMAP asks for a display, and needs none
# What says that no GPU is there has another name from COLMAP 3.13 on.
extraction=SiftExtraction matching=SiftMatching
if colmap feature_extractor -h 2>&1 | grep -q FeatureExtraction.use_gpu; then extraction=FeatureExtraction matching=FeatureMatching; fi
features_of_frames() {
  colmap feature_extractor --database_path "$work/database.db" --image_path "$out/images" --ImageReader.single_camera 1 --ImageReader.camera_model SIMPLE_RADIAL \
    "--$extraction.use_gpu" 0 --SiftExtraction.max_num_features "$features"
}
match_frames() {
  case $pairs in
    exhaustive) colmap exhaustive_matcher --database_path "$work/database.db" "--$matching.use_gpu" 0 ;;
    *) colmap sequential_matcher --database_path "$work/database.db" "--$matching.use_gpu" 0 --SequentialMatching.overlap "$overlap" ;;
  esac
}
map_frames() {
  rm -rf "$work/models" && mkdir "$work/models" || return
  colmap mapper --database_path "$work/database.db" --image_path "$out/images" --output_path "$work/models" || return
  ls "$work/models/0" >/dev/null # no model is no success, whatever the exit status was
}
# Models of a scene that fell apart are turned one by one; the largest is the one that compmark takes.
turn_upright() {
  rm -rf "$out/sparse.part" || return
  for model in "$work/models"/*/; do
    upright=$out/sparse.part/$(basename "$model")
    mkdir -p "$upright" || return
    colmap model_orientation_aligner --image_path "$out/images" --input_path "$model" --output_path "$upright" --method IMAGE-ORIENTATION || return
  done
  rm -rf "$out/sparse"
  mv "$out/sparse.part" "$out/sparse"
}

step choose "sharpness of every frame" choose_frames
step frames "the sharpest $frames, at most $size pixels long, into $out/images" extract_frames
step features "points of each frame" features_of_frames
step matches "the same points in other frames ($pairs)" match_frames
step cameras "cameras" map_frames
step upright "which way is up" turn_upright

taken=$(find "$out/images" -name '*.jpg' | wc -l | tr -d ' ')
most=0
for model in "$out/sparse"/*/; do
  colmap model_analyzer --path "$model" >"$work/model.txt" 2>&1 || { cat "$work/model.txt" >&2; exit 1; }
  value() { sed -n "s/^\(.*\] \)\{0,1\}$1: //p" "$work/model.txt" | head -n 1; } # newer versions put time and place before it
  images=$(value 'Registered images')
  say "model $(basename "$model"): $images of $taken frames, $(value Points) points, reprojection error $(value 'Mean reprojection error')"
  [ "${images:-0}" -le "$most" ] || most=$images
done
echo "next: compmark probe --data $out"
if [ $((2 * most)) -lt "$taken" ]; then
  echo "capture: fewer than half of the frames have a camera in one model; docs/capture.md says what to do" >&2
  exit 1
fi
