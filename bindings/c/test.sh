#!/bin/sh
# SPDX-FileCopyrightText: 2026 The CompMark authors
# SPDX-License-Identifier: Apache-2.0
#
# test.sh COMPILER LIBRARY SOURCE: compiles test.c as strict C99 against the library, and runs it; then looks at what the library shows.
set -eu
compiler=$1 library=$2 source=$3
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
lib=$(dirname "$library")
"$compiler" -std=c99 -Wall -Wextra -Wpedantic -Wconversion -Werror -I"$source/bindings/c" "$source/bindings/c/test.c" -o "$folder/test" \
  -L"$lib" -lcompmark -lm -Wl,-rpath,"$lib"
# The header alone, by a C++ compiler's rules too.
printf '#include "compmark.h"\n#include "compmark.h"\nint main() { return compmark_abi() == 0; }\n' >"$folder/cpp.cpp"
c++ -Wall -Wextra -Wpedantic -Werror -I"$source/bindings/c" -fsyntax-only "$folder/cpp.cpp"
cd "$folder" # a path that is not there stays so
marked=$source/tests/golden/marked
decoder=$source/weights/lattice_32.safetensors
"$(dirname "$lib")/bin/compmark" claim --key "$marked/owner.key" --decoder "$decoder" --out owner.claim >claim.txt
./test "$marked/hac.cmk" "$marked/owner.key" "$decoder" owner.claim model.safetensors
# Nothing else is shown, so that it lives beside any other library of C++.
others=$(nm -D --defined-only "$library" | awk '{ print $3 }' | grep -v '^compmark_' || true)
[ -z "$others" ] || { echo "the library shows more than its functions: $others"; exit 1; }
declared=$(sed -n 's/^COMPMARK_API.*\(compmark_[a-z_]*\)(.*/\1/p' "$source/bindings/c/compmark.h" | sort)
shown=$(nm -D --defined-only "$library" | awk '{ print $3 }' | grep '^compmark_' | sort)
[ "$declared" = "$shown" ] || { echo "declared: $declared"; echo "shown: $shown"; exit 1; }
