#!/bin/sh
# SPDX-FileCopyrightText: 2026 The CompMark authors
# SPDX-License-Identifier: Apache-2.0
#
# The golden files of the codec decode to their digests, and encode to themselves, whatever compiles the decoder: both compilers where both are
# there, without optimisation and with, for any machine and for this one, with and without contraction; each at 1, 2 and 8 threads.
#   codec_everywhere.sh <project root> <include flags…>
set -eu
root=$1
shift
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT INT TERM
cd "$root"
cached=$(command -v ccache || true) # ninety seconds of a core each time otherwise

for compiler in g++ clang++ clang++-14; do
  command -v "$compiler" >/dev/null 2>&1 || { echo "not here: $compiler"; continue; }
  case " ${seen:-} " in *" $("$compiler" --version | head -n 1) "*) continue ;; esac
  seen="${seen:-} $("$compiler" --version | head -n 1) "
  $cached "$compiler" -std=c++20 -O0 "$@" -c tests/main.cpp -o "$work/main.o"
  for flags in "-O0" "-O3" "-O3 -march=native -ffp-contract=off" "-O3 -march=native -ffp-contract=fast"; do
    # shellcheck disable=SC2086 # the flags are words
    $cached "$compiler" -std=c++20 $flags "$@" -Itests -c tests/codec/container/golden.test.cpp -o "$work/golden.o"
    "$compiler" "$work/golden.o" "$work/main.o" -o "$work/golden" -pthread
    "$work/golden" >"$work/log" 2>&1 || { echo "$compiler $flags:"; cat "$work/log"; exit 1; }
    echo "$compiler $flags: the same bits"
  done
done
[ -n "${seen:-}" ] || { echo "no compiler was found"; exit 1; }
