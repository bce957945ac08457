#!/bin/sh
# SPDX-FileCopyrightText: 2026 The CompMark authors
# SPDX-License-Identifier: Apache-2.0
#
# scenes.sh TOOL SOURCE: the Snakefile on two tiny scenes and a capture that is none: a bad table, a call that is killed
# with its jobs in the middle, the call after it, and one that has nothing left to do.
set -eu
tool=$1 source=$2
for program in snakemake python3 setsid; do
  command -v "$program" >/dev/null 2>&1 || { echo "skipped: no $program" && exit 0; }
done
scratch=$(mktemp -d)
group=''
trap '[ -z "$group" ] || kill -9 "-$group" 2>/dev/null || true; rm -rf "$scratch"' EXIT
cd "$scratch"
export PYTHONDONTWRITEBYTECODE=1 XDG_CACHE_HOME="$scratch/cache"
fail() {
  echo "cluster: $*"
  tail -n 60 calls.log
  exit 1
}
same() { [ "$2" = "$3" ] || fail "$1: '$2', not '$3'"; }
# Words of snakemake; all that a call prints is in calls.log.
call() {
  status=0
  snakemake --snakefile "$source/examples/cluster/Snakefile" --cores 2 --keep-going "$@" \
    --config table="$table" out=batch compmark="$tool" checkpoint_every=20 >>calls.log 2>&1 || status=$?
}
# A column of the table of results, by name.
column() {
  awk -F '\t' -v name="$1" 'NR == 1 { for (i = 1; i <= NF; ++i) if ($i == name) column = i; next } { print $column }' \
    batch/scenes.tsv | tr '\n' ' '
}
line() { printf '%s\t%s\t%s\t%s\t%s\n' "$@"; }

mkdir captures captures/none
for seed in 1 2; do
  "$tool" scene --out captures/$seed --width 48 --height 48 --train 10 --test 2 --seed $seed >/dev/null
done
options="--mark-iterations 20 --voxel-size 0"
table=captures.tsv
{
  line name capture seed iterations options
  line first captures/1 11 100 "$options"
  line second captures/2 12 100 "$options"
  line none captures/none '' '' ''
} >$table

# A table with a fault runs nothing, and is told in a line.
table=bad.tsv
sed 's/11/-11/' captures.tsv >$table
call
same "exit status with a bad table" $status 1
grep -q '^bad.tsv, line 2: seed: "-11" is no whole number' calls.log || fail "the fault of a bad table is not told"
[ ! -e batch ] || fail "something ran with a bad table"
table=captures.tsv

# Killed, with all its jobs, when a training has a checkpoint.
setsid snakemake --snakefile "$source/examples/cluster/Snakefile" --cores 2 --keep-going \
  --config table=$table out=batch compmark="$tool" checkpoint_every=20 >>calls.log 2>&1 &
group=$!
tries=0
until [ -f batch/scenes/first/run/unmarked/checkpoint.safetensors ]; do
  tries=$((tries + 1))
  [ $tries -lt 3000 ] || fail "there is no checkpoint after five minutes"
  kill -0 $group 2>/dev/null || fail "the call ended before it was killed"
  sleep 0.1
done
kill -9 "-$group"
wait $group 2>/dev/null || true
group=''
cp -p batch/keys/first.key first.key

# The next call has to take the lock of the killed one away, and goes on. The scene that fails does not stop the others.
call --unlock
call --rerun-incomplete
same "exit status with a scene that fails" $status 1
same "states" "$(column name)$(column state)" "first second none finished finished failed "
same "step that failed" "$(column step)" "  probe "
case $(column reason) in *captures/none*) ;; *) fail "the reason is not told: $(column reason)" ;; esac
grep -q 'resuming after iteration' batch/scenes/first/scene.log || fail "the killed training began anew"
cmp first.key batch/keys/first.key || fail "the key was made again"
! cmp -s first.key batch/keys/second.key || fail "two scenes have one key"
same "modes of the keys" "$(stat -c %a batch/keys/*.key | tr '\n' ' ')" "600 600 "
for scene in first second; do
  for file in owner.claim run/model.cmk run/report.html evaluation.html proof.json; do
    [ -s batch/scenes/$scene/$file ] || fail "$scene has no $file"
  done
  grep -q '"claim"' batch/scenes/$scene/proof.json || fail "the proof of $scene has no claim"
  grep -q "href=\"scenes/$scene/proof.json\"" batch/index.html || fail "the page does not lead to the proof of $scene"
done
grep -q 'failed in probe' batch/index.html || fail "the page does not have the scene that failed"

# Without that scene there is nothing left to do, and the page follows the table.
sed '/^none/d' captures.tsv >shorter.tsv
table=shorter.tsv
find batch/scenes/first batch/scenes/second -type f -exec cksum {} + | sort >before
call
same "exit status when all is done" $status 0
find batch/scenes/first batch/scenes/second -type f -exec cksum {} + | sort >after
cmp before after || fail "a finished scene was run again"
same "states" "$(column name)$(column state)" "first second finished finished "
echo "two scenes: $(column bytes)bytes, $(column bits_right)bits right, $(column processor_seconds)processor seconds"
