#!/usr/bin/env bash
# SPDX-FileCopyrightText: 2026 The CompMark authors
# SPDX-License-Identifier: Apache-2.0
#
# Builds the fuzz targets with clang++, ASan and UBSan, and runs each, one after the other, within 512 MB:
#   tests/fuzz/run.sh                            all of them, a minute each
#   SECONDS_EACH=600 tests/fuzz/run.sh image     some of them, ten minutes each
# BUILD is the build folder (build/fuzz), CORPUS the folder that inputs are kept in, for the next time (BUILD/corpus), JOBS the compilers at once (1).
# What a target dies of lies in BUILD/artifacts. A line a target, then "N passed, N failed, 0 skipped"; exit code 1 if any failed.
set -u
cd "$(dirname "$0")/../.."
build=${BUILD:-build/fuzz} each=${SECONDS_EACH:-60}
corpus=${CORPUS:-$build/corpus} artifacts=$build/artifacts log=$build/log
targets=("$@")
if [ $# -eq 0 ]; then
  mapfile -t targets < <(sed -n '/^foreach(name/,/)/p' tests/fuzz/CMakeLists.txt | tr -d '\n' | sed 's/foreach(name *//; s/).*//' | tr -s ' ' '\n')
fi

mkdir -p "$(dirname "$build")" # a fresh clone has none
cmake -B "$build" -DCMAKE_CXX_COMPILER=clang++ -DCMAKE_BUILD_TYPE=None -DCOMPMARK_BUILD_FUZZERS=ON -DCOMPMARK_BUILD_BENCHMARKS=OFF \
  -DCOMPMARK_BUILD_EXAMPLES=OFF >"$build.configure.log" 2>&1 || { cat "$build.configure.log"; exit 1; }
rm -f "$build.configure.log"
mkdir -p "$artifacts" "$log"
cmake --build "$build" -j "${JOBS:-1}" --target fuzz_make_seeds "${targets[@]/#/fuzz_}" || exit 1

scratch=$(mktemp -d "${TMPDIR:-/tmp}/compmark_fuzz.XXXXXX")
[ -w /dev/shm ] && rmdir "$scratch" && scratch=$(mktemp -d /dev/shm/compmark_fuzz.XXXXXX) # targets whose readers take a path write a thousand files a second
trap 'rm -rf "$scratch"' EXIT
"$build/bin/fuzz_make_seeds" "$corpus" || exit 1

passed=0 failed=0
for name in "${targets[@]}"; do
  mkdir -p "$corpus/$name"
  seeds=("$corpus/$name")
  [ "$name" = container ] && seeds+=(tests/golden/codec)
  # Readers that warn do so on stderr, which is the fuzzer's own: its lines stay.
  TMPDIR=$scratch "$build/bin/fuzz_$name" -max_total_time="$each" -rss_limit_mb=512 -timeout=60 -max_len=8192 -close_fd_mask=1 -print_final_stats=1 \
    -dict=tests/fuzz/words.dict -artifact_prefix="$artifacts/$name-" "${seeds[@]}" >"$log/$name" 2>&1
  code=$?
  of() { sed -n "s/^stat::$1: *//p" "$log/$name" | tail -1; }
  said="$(of number_of_executed_units) executions, $(find "$corpus/$name" -type f | wc -l) inputs kept, $(of peak_rss_mb) MB"
  if [ $code -eq 0 ]; then
    passed=$((passed + 1))
    echo "passed $name: $said"
  else
    failed=$((failed + 1))
    echo "FAILED $name (code $code): $said; $log/$name"
  fi
  rm -rf "${scratch:?}"/*
done
echo "$passed passed, $failed failed, 0 skipped"
[ "$failed" -eq 0 ]
