#!/usr/bin/env bash
# SPDX-FileCopyrightText: 2026 The CompMark authors
# SPDX-License-Identifier: Apache-2.0
#
# The tool where things go wrong: killed at random moments, a full disk, a limit of file sizes, two of it at once. What must hold: no input is touched;
# a file under its own name is whole; who goes on, as the tool says, ends with the bits of a run that nothing happened to, and leaves no partial file.
#   bash tests/faults/run.sh [--tool program] [--work folder] [--kills n] [--full n] [--limits n] [--pairs n] [--finished n] [--seed n] [--only commands]
# --tool      compmark (default: that of the release preset)
# --work      folder for scenes, runs and what failed; is made (default: a new one of the system's, removed if all passed)
# --kills …   numbers of trials (default: 100 of kills, 50 of the others, 6 of finished runs)
# --only      trials of these commands alone, a list with commas: train, train_hac, embed, embed_hac, mark, fit, fit_codec, compress, decompress, export, render, verify
# Prints a line a trial, and last "N passed, N failed, N skipped"; exit status 1 if any failed. Full disks need the right to mount.
set -u
export LC_ALL=C
tool='' work='' kills=100 full=50 limits=50 pairs=50 finished=6 seed=1 only=''
while [ $# -gt 0 ]; do
  [ $# -gt 1 ] || { echo "run.sh: $1 has no value" >&2; exit 2; }
  case $1 in
    --tool) tool=$2 ;;
    --work) work=$2 ;;
    --kills) kills=$2 ;;
    --full) full=$2 ;;
    --limits) limits=$2 ;;
    --pairs) pairs=$2 ;;
    --finished) finished=$2 ;;
    --seed) seed=$2 ;;
    --only) only=$2 ;;
    *) echo "run.sh: $1 is no option" >&2; exit 2 ;;
  esac
  shift 2
done
tool=${tool:-$(cd "$(dirname "$0")/../.." && pwd)/build/release/bin/compmark}
case $tool in /*) ;; *) tool=$PWD/$tool ;; esac
[ -x "$tool" ] || { echo "run.sh: $tool is no program" >&2; exit 2; }
temporary=''
[ -n "$work" ] || { work=$(mktemp -d) || exit 2; temporary=$work; }
mkdir -p "$work" && cd "$work" || exit 2
work=$PWD
RANDOM=$seed
passed=0 failed=0 skipped=0 mounted=''
finish() {
  [ -z "$mounted" ] || umount "$mounted" 2>/dev/null || umount -l "$mounted" 2>/dev/null # a tool may still write there
  mounted=''
}
trap finish EXIT
trap "exit 2" HUP INT TERM

# --- what is run ------------------------------------------------------------------------------------------------------------------------------------

# The words of a command: its name, a or b (two that differ in what they write), the folder it writes to, a number of threads.
words() {
  local in=$work/inputs scene=$work/inputs/scene
  local run=(--data "$scene" --out "$3" --threads "$4")
  case $1 in
    train) cmd=(train "${run[@]}" --iterations 150 --voxel-size 0.5 --checkpoint-every 10 --seed) ;;
    train_hac) cmd=(train "${run[@]}" --iterations 30 --voxel-size 0.5 --checkpoint-every 10 --codec hac --seed) ;;
    mark) cmd=(train "${run[@]}" --iterations 30 --voxel-size 0.5 --checkpoint-every 10 --key "$in/short.key" --decoder fit --mark-iterations 20 --seed) ;;
    embed) cmd=(embed "${run[@]}" --model "$in/run/model.safetensors" --key "$in/owner.key" --decoder "$in/dec.safetensors" --iterations 80 --checkpoint-every 10 --seed) ;;
    embed_hac) cmd=(embed "${run[@]}" --model "$in/hac/model.safetensors" --key "$in/owner.key" --decoder "$in/dec.safetensors" --iterations 10 --checkpoint-every 3 --seed) ;;
    fit_codec) cmd=(fit-codec "${run[@]}" --model "$in/run/model.safetensors" --iterations 25 --checkpoint-every 5 --seed) ;;
    fit) cmd=(fit --data "$scene" --model "$in/run/model.safetensors" --out "$3/dec.safetensors" --threads "$4" --bits 16 --features 24 --views 64 --gradient-views 2 --coordinates 4 --seed) ;;
    compress) cmd=(compress --model "$in/hac/model.safetensors" --out "$3/m.cmk" --threads "$4" --networks) ;;
    decompress) cmd=(decompress --model "$in/hac/model.cmk" --out "$3/m.safetensors" --threads "$4") ;;
    export) cmd=(export --model "$in/run/model.safetensors" --out "$3/m.ply" --threads "$4" --refine 5 --compare 1 --sh-degree) ;;
    render) cmd=(render --model "$in/run/model.safetensors" --out "$3" --threads "$4" --split all --downscale) ;;
    verify) cmd=(verify --model "$in/marked/model.safetensors" --key "$in/owner.key" --decoder "$in/dec.safetensors" --threads "$4" --json "$3/verdict.json" --tests) ;;
  esac
  case $1-$2 in
    compress-a) cmd+=(half) ;;
    compress-b) cmd+=(single) ;;
    decompress-a) ;;
    decompress-b) cmd[2]=$in/marked_hac/model.cmk ;;
    *-a) cmd+=(1) ;;
    *-b) cmd+=(2) ;;
  esac
}
is_run() { case $1 in train | train_hac | mark | embed | embed_hac | fit_codec) ;; *) return 1 ;; esac; }
# Files whose bits are those of every run of a command, one a line, within the folder $2.
pinned() {
  case $1 in
    mark) echo decoder.safetensors; echo model.safetensors; echo unmarked/model.safetensors ;;
    train | embed) echo model.safetensors ;;
    train_hac | fit_codec) echo model.safetensors; echo model.cmk ;;
    embed_hac) echo model.safetensors; echo model.cmk; echo unmarked.cmk ;;
    fit) echo dec.safetensors ;;
    compress) echo m.cmk ;;
    decompress) echo m.safetensors ;;
    export) echo m.ply ;;
    render) (cd "$work/reference/render_a" && ls) ;;
    verify) echo verdict.json ;;
  esac
}
# What is written beside them; who has it all, has ended well.
beside() {
  case $1 in
    fit) echo dec.json ;;
    mark) echo results.json; echo report.html; echo mark.json; echo verification.json; echo unmarked/results.json ;;
    embed*) echo results.json; echo report.html; echo mark.json; echo verification.json ;;
    train* | fit_codec) echo results.json; echo report.html ;;
  esac
}
good_code() { case $1-$2 in *-0 | verify-3 | verify-1) ;; *) return 1 ;; esac; }

hash_of() { [ -f "$1" ] && sha256sum <"$1" | cut -c 1-64; }
inputs_hash() { find inputs -type f ! -name '*.record' -print0 | sort -z | xargs -0 sha256sum | sha256sum; }
# A whole number below $1.
draw() { drawn=$(((RANDOM * 32768 + RANDOM) % ($1 > 0 ? $1 : 1))); }
pick() { draw $#; picked=${*:drawn+1:1}; }
now_ms() { local t=$EPOCHREALTIME; echo $((${t%.*} * 1000 + 10#${t#*.} / 1000)); }

# --- what must hold ---------------------------------------------------------------------------------------------------------------------------------

wrong() { [ -n "$problem" ] || problem=$*; }
check_inputs() { [ "$(inputs_hash)" = "$inputs" ] || wrong "an input was touched"; }
# Every file in a folder is whole, and of the references $3…: what was cut is seen by its checksum, or its end. $2: whether partial files and locks may be there.
check_whole() {
  local folder=$1 left=$2 file name known
  shift 2
  while IFS= read -r -d '' file; do
    name=${file#"$folder"/}
    case $name in
      *.partial-* | *.compmark-lock | *.lock)
        [ "$left" = left ] || wrong "$name is left" ;;
      *checkpoint.safetensors)
        "$tool" info "$file" 2>&1 | grep -q "is a training's checkpoint" || wrong "$name is not whole" ;;
      *log.jsonl) ;;
      *.html)
        tail -c 16 "$file" | grep -q '</html>' || wrong "$name is cut" ;;
      *.old)
        known='' # a decoder that was moved aside
        for other in "$@"; do [ "$(hash_of "$file")" = "$(hash_of "$other/${name%.*.old}")" ] && known=1; done
        [ -n "$known" ] || wrong "$name is no decoder that was there" ;;
      verdict.json | *.safetensors | *.cmk | *.ply | *.png)
        known=''
        for other in "$@"; do [ "$(hash_of "$file")" = "$(hash_of "$other/$name")" ] && known=1; done
        [ -n "$known" ] || wrong "$name is not that of a whole run" ;;
      *.json)
        { [ "$(head -c 1 "$file")" = "{" ] && [ "$(tail -c 2 "$file")" = "}" ]; } || wrong "$name is cut" ;;
      *) wrong "$name is none of its files" ;;
    esac
  done < <(find "$folder" -type f -print0)
}
# All of the reference $3 of command $2 is in folder $1.
check_done() {
  local name
  for name in $(pinned "$2"); do
    [ "$(hash_of "$1/$name")" = "$(hash_of "$3/$name")" ] || wrong "$name is not that of the reference"
  done
  for name in $(beside "$2"); do [ -f "$1/$name" ] || wrong "$name is not there"; done
  [ ! -f "$1/checkpoint.safetensors" ] || wrong "a checkpoint is left"
  for name in "$1"/log.jsonl "$1"/*/log.jsonl; do
    [ -f "$name" ] && grep -q -v '^{"iteration":.*}$' "$name" && wrong "$name has a line that is none"
  done
  if is_run "$2" && [ "$(sed -n 's/.*"model_sha256": "\(.*\)".*/\1/p' "$1/results.json" 2>/dev/null)" != "$(hash_of "$1/model.safetensors")" ]; then
    wrong "results.json is of another model"
  fi
}
# One line says what is wrong, and with which file.
check_error() {
  [ "$(grep -c '^compmark: error: ' "$1")" = 1 ] || { wrong "$(grep -c '^compmark: error: ' "$1") lines of an error"; return; }
  grep '^compmark: error: ' "$1" | grep -q -e "$2" || wrong "the error is another one: $(grep '^compmark: error: ' "$1")"
}
report() { # kind, number, command, what
  if [ -z "$problem" ]; then
    passed=$((passed + 1))
    echo "ok     $1 $2 $3: $4"
  else
    failed=$((failed + 1))
    echo "FAILED $1 $2 $3: $4: $problem"
    rm -rf "failed/$1_$2_$3" && mkdir -p failed && cp -a "$out" "failed/$1_$2_$3" && cp said* "failed/$1_$2_$3/" 2>/dev/null
  fi
}

# Goes on as the tool says, until all is there: $1 command, $2 a or b, $3 folder, further words. A fault may have come after its end.
go_on() {
  local code extra=()
  words "$1" "$2" "$3" $((1 + RANDOM % 2))
  is_run "$1" && extra=(--resume)
  [ "$1" = fit ] && [ -f "$3/dec.safetensors" ] && extra=(--force)
  "$tool" "${cmd[@]}" "${extra[@]}" "${@:4}" >said_again 2>&1
  code=$?
  good_code "$1" "$code" || wrong "going on ended with $code: $(grep -m 1 'error: ' said_again)"
}

# --- the references ---------------------------------------------------------------------------------------------------------------------------------

must() { "$tool" "$@" >said 2>&1 || { echo "run.sh: a setup failed: $*: $(tail -n 1 said)" >&2; echo "0 passed, 1 failed, 0 skipped"; exit 1; }; }
rm -rf inputs reference out disk failed said*
mkdir -p inputs reference
must scene --out inputs/scene --width 48 --height 48 --train 6 --test 2
must keygen --bits 16 --out inputs/owner.key
must keygen --bits 8 --out inputs/short.key
must train --data inputs/scene --out inputs/run --iterations 60 --voxel-size 0.5
must train --data inputs/scene --out inputs/hac --iterations 20 --voxel-size 0.5 --codec hac
must fit --model inputs/run/model.safetensors --data inputs/scene --bits 16 --features 24 --views 64 --gradient-views 2 --coordinates 4 --out inputs/dec.safetensors
for pair in run:marked hac:marked_hac; do
  must embed --model "inputs/${pair%:*}/model.safetensors" --data inputs/scene --key inputs/owner.key --decoder inputs/dec.safetensors --out "inputs/${pair#*:}" --iterations 10
done
all=(train train_hac embed embed_hac mark fit fit_codec compress decompress export render verify)
[ -z "$only" ] || IFS=, read -r -a all <<<"$only"
for command in "${all[@]}"; do
  case " train train_hac embed embed_hac mark fit fit_codec compress decompress export render verify " in *" $command "*) ;; *) echo "run.sh: $command is no command of --only" >&2; exit 2 ;; esac
done
declare -A time size biggest
for command in "${all[@]}"; do
  for variant in a b; do
    folder=$work/reference/${command}_$variant
    mkdir -p "$folder"
    words "$command" "$variant" "$folder" 1
    begin=$(now_ms)
    "$tool" "${cmd[@]}" >said 2>&1
    code=$?
    good_code "$command" $code || { echo "run.sh: the reference of $command failed: $(tail -n 1 said)" >&2; echo "0 passed, 1 failed, 0 skipped"; exit 1; }
    time[$command]=$(($(now_ms) - begin))
    size[$command]=$(du -s -k "$folder" | cut -f 1)
    biggest[$command]=$(($(find "$folder" -type f -printf '%s\n' | sort -n | tail -n 1) / 1024 + 1))
  done
  echo "# $command: ${time[$command]} ms, ${size[$command]} KiB"
done
inputs=$(inputs_hash)
# Those of a set that are to be tried.
among() {
  local c
  chosen=()
  for c in "$@"; do
    case ",${only:-$c}," in *",$c,"*) chosen+=("$c") ;; esac
  done
}

# --- killed -----------------------------------------------------------------------------------------------------------------------------------------

# Kills $pid after so many ms, or then as soon as it writes a file.
kill_at() {
  sleep "$(printf '%d.%03d' $(($1 / 1000)) $(($1 % 1000)))"
  if [ "$2" = writing ]; then
    while kill -0 "$pid" 2>/dev/null; do
      set -- "$out"/*.partial-* "$out"/*/*.partial-*
      case "$1$2" in *'*'*'*'*) ;; *) break ;; esac
    done
  fi
  kill -9 "$pid" 2>/dev/null
  wait "$pid" 2>/dev/null
}
among train train train_hac embed embed embed_hac fit fit fit_codec fit_codec compress compress mark
[ ${#chosen[@]} -gt 0 ] || kills=0
for ((trial = 1; trial <= kills; ++trial)); do
  problem='' out=$work/out
  pick "${chosen[@]}"
  command=$picked
  rm -rf out && mkdir out
  how=$((RANDOM % 3)) again=$((RANDOM % 4)) threads=$((1 + RANDOM % 2))
  [ $how = 0 ] && how=writing || how=''
  draw $((${time[$command]} * 21 / 20))
  moment=$drawn
  words "$command" a "$out" $threads
  "$tool" "${cmd[@]}" >said 2>&1 &
  pid=$!
  kill_at "$moment" "$how" 2>/dev/null
  check_inputs
  check_whole "$out" left "reference/${command}_a"
  if [ $again = 0 ] && is_run "$command"; then # the run that goes on dies too
    draw "${time[$command]}"
    "$tool" "${cmd[@]}" --resume >said 2>&1 &
    pid=$!
    kill_at "$drawn" '' 2>/dev/null
    check_whole "$out" left "reference/${command}_a"
  fi
  go_on "$command" a "$out"
  check_inputs
  check_whole "$out" none "reference/${command}_a"
  check_done "$out" "$command" "reference/${command}_a"
  report kill $trial "$command" "$threads threads, after $moment ms$([ -z "$how" ] || echo ", while it writes")$([ $again != 0 ] || echo ", twice")"
done

# --- no room ----------------------------------------------------------------------------------------------------------------------------------------

# What holds when a command could not write: $1 command, $2 code, $3 folder, $4 what was there before (or nothing).
check_unwritten() {
  if good_code "$1" "$2" && [ "$2" != 2 ]; then
    check_done "$3" "$1" "reference/${1}_a"
  else
    [ "$2" = 2 ] || wrong "it ended with $2"
    check_error said "$3/\|standard output"
  fi
  check_inputs
  check_whole "$3" none "reference/${1}_a" ${4:+"$4"}
  if [ -n "$4" ] && [ "$2" = 2 ]; then
    case $1 in
      compress | decompress | export | verify) # one file, and it was not replaced
        for name in $(pinned "$1"); do [ "$(hash_of "$3/$name")" = "$(hash_of "$4/$name")" ] || wrong "$name of before is lost"; done ;;
      *)
        for name in $(pinned "$1"); do [ -f "$3/$name" ] || ls "$3/$name".*.old >/dev/null 2>&1 || wrong "$name of before is gone"; done ;;
    esac
  fi
}
# Half of the trials begin where another run has ended.
begin_in() {
  before='' force=()
  rm -rf "${2:?}"/* "$2"/.[!.]*
  [ $((RANDOM % 2)) = 0 ] || return 0
  before=reference/${1}_b
  cp -a "$before/." "$2/"
  if is_run "$1" || [ "$1" = fit ]; then force=(--force); fi
}
after_room() {
  go_on "$1" a "$2" "${again_force[@]}"
  check_inputs
  check_whole "$2" none "reference/${1}_a" ${before:+"$before"}
  check_done "$2" "$1" "reference/${1}_a"
}
every=(train train_hac embed embed_hac mark fit fit_codec compress decompress export render verify)
among "${every[@]}"
mkdir -p disk
if [ "$full" -gt 0 ] && ! mount -t tmpfs -o size=1m compmark-faults disk 2>/dev/null; then
  echo "skipped full disks: no right to mount one"
  skipped=$((skipped + full))
  full=0
else
  [ "$full" -gt 0 ] && umount disk
fi
for ((trial = 1; trial <= full; ++trial)); do
  problem='' out=$work/disk
  pick "${chosen[@]}"
  command=$picked
  mount -t tmpfs -o size=64m compmark-faults disk && mounted=$work/disk
  begin_in "$command" "$out"
  # Twice what is there in the end: a checkpoint and a file that takes another's place are written beside it.
  [ $((RANDOM % 3)) = 0 ] && draw 64 || draw $((${size[$command]} * 2))
  room=$((drawn / 4 * 4 + 4))
  mount -o remount,size=$(($(du -s -k disk | cut -f 1) + room))k disk
  words "$command" a "$out" $((1 + RANDOM % 2))
  "$tool" "${cmd[@]}" "${force[@]}" >said 2>&1
  code=$?
  check_unwritten "$command" $code "$out" "$before"
  mount -o remount,size=64m disk
  again_force=()
  is_run "$command" && again_force=("${force[@]}")
  after_room "$command" "$out"
  report full $trial "$command" "$room KiB free${before:+, over another run}, exit $code"
  umount disk && mounted=''
done
for ((trial = 1; trial <= limits; ++trial)); do
  problem='' out=$work/out
  pick "${chosen[@]}"
  command=$picked
  mkdir -p out
  begin_in "$command" "$out"
  [ $((RANDOM % 3)) = 0 ] && draw 64 || draw $((${biggest[$command]} * 6 / 5))
  limit=$drawn
  words "$command" a "$out" $((1 + RANDOM % 2))
  (ulimit -c 0 && ulimit -f "$limit" && exec "$tool" "${cmd[@]}" "${force[@]}" 2>&1) | cat >said # a pipe has no limit
  code=${PIPESTATUS[0]}
  check_unwritten "$command" "$code" "$out" "$before"
  again_force=()
  is_run "$command" && again_force=("${force[@]}")
  after_room "$command" "$out"
  report limit $trial "$command" "$limit KiB a file${before:+, over another run}, exit $code"
done

# --- two at once ------------------------------------------------------------------------------------------------------------------------------------

for ((trial = 1; trial <= pairs; ++trial)); do
  problem='' out=$work/out
  pick "${chosen[@]}"
  command=$picked
  rm -rf out && mkdir out
  draw $((${time[$command]} * 11 / 10))
  delay=$drawn
  [ $((RANDOM % 3)) != 0 ] || delay=$((delay / 20))
  words "$command" a "$out" 1
  "$tool" "${cmd[@]}" >said_a 2>&1 &
  pid_a=$!
  sleep "$(printf '%d.%03d' $((delay / 1000)) $((delay % 1000)))"
  words "$command" b "$out" 1
  "$tool" "${cmd[@]}" >said_b 2>&1 &
  pid_b=$!
  wait $pid_a
  code_a=$?
  wait $pid_b
  code_b=$?
  ended=()
  for run in a:$code_a b:$code_b; do
    if good_code "$command" "${run#*:}"; then
      ended+=("${run%:*}")
    else
      [ "${run#*:}" = 2 ] || wrong "${run%:*} ended with ${run#*:}"
      check_error "said_${run%:*}" 'another run\|finished run\|exists, and without\|decoder of an earlier run'
    fi
  done
  check_inputs
  check_whole "$out" none reference/"${command}"_a reference/"${command}"_b
  # The folder is that of one of those that ended well.
  first=$problem found=''
  for variant in "${ended[@]}"; do
    problem=''
    check_done "$out" "$command" "reference/${command}_$variant"
    [ -n "$problem" ] || found=$variant
  done
  problem=$first
  [ -n "$found" ] || wrong "what is there is that of no run that ended well"
  report pair $trial "$command" "the second after $delay ms, exits $code_a and $code_b"
done

# --- finished ---------------------------------------------------------------------------------------------------------------------------------------

among train train_hac embed embed_hac fit_codec mark
for ((trial = 1; trial <= finished && ${#chosen[@]} > 0; ++trial)); do
  problem='' out=$work/out
  command=${chosen[(trial - 1) % ${#chosen[@]}]}
  rm -rf out && mkdir out && cp -a "reference/${command}_a/." out/
  everything() { (cd out && find . -type f -printf '%p %T@ ' -exec sha256sum {} \; | sort); }
  was=$(everything)
  words "$command" a "$out" 2
  "$tool" "${cmd[@]}" --resume >said 2>&1 || wrong "the same once more ended with $?"
  grep -q 'finished' said || wrong "nobody said that the run is finished"
  [ "$(everything)" = "$was" ] || wrong "the same once more changed something"
  words "$command" b "$out" 2
  "$tool" "${cmd[@]}" --resume >said 2>&1
  code=$?
  [ $code = 2 ] || wrong "with another seed it ended with $code"
  check_error said '[-]-seed'
  [ "$(everything)" = "$was" ] || wrong "with another seed it changed something"
  report finished $trial "$command" "the same, and another seed"
done

echo "$passed passed, $failed failed, $skipped skipped"
[ "$failed" -gt 0 ] || { cd / && [ -z "$temporary" ] || rm -rf "$temporary"; }
[ "$failed" = 0 ]
