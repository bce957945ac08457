#!/bin/sh
# SPDX-FileCopyrightText: 2026 The CompMark authors
# SPDX-License-Identifier: Apache-2.0
#
# What every file of the project must and must not have.   headers.sh <project root>
set -eu
cd "${1:-.}"
bad=0
complain() {
  echo "$1"
  bad=1
}

headers=$(find include/compmark -name '*.hpp' | sort)
sources=$(find tests benchmarks examples -name '*.cpp' -o -name '*.hpp' | sort)

for file in $headers $sources; do
  head -n 2 "$file" | tr '\n' ' ' | grep -q 'SPDX-FileCopyrightText: .*SPDX-License-Identifier: Apache-2.0' ||
    complain "$file: the first two lines are not the SPDX lines"
done
for file in $(find . -path ./build -prune -o -path ./.git -prune -o \( -name CMakeLists.txt -o -name '*.cmake' -o -name '*.sh' -o -name '*.awk' \) -print) .ci/run; do
  head -n 4 "$file" | grep -q 'SPDX-License-Identifier: Apache-2.0' || complain "$file: no SPDX line"
done
for file in $headers; do
  grep -q '^#pragma once$' "$file" || complain "$file: no #pragma once"
  sed -n 4p "$file" | grep -q '^// [A-Za-z0-9`"(]' || complain "$file: line 4 does not begin the paragraph that says what this is"
  lines=$(wc -l <"$file")
  if [ "$lines" -gt 300 ]; then
    awk 'NR > 3 && !/^\/\// { exit } { print }' "$file" | grep -qiE 'one file|long|lines|together|in one place|only file' ||
      complain "$file: $lines lines; above 300 the first comment says why"
  fi
done

for file in $headers; do
  case $file in
    */testing/* | */detail/* | */compmark/compmark.hpp | *_executor.hpp | *_adaptor.hpp) continue ;;
  esac
  grep -q "^#include \"${file#include/}\"\$" include/compmark/compmark.hpp || complain "$file is not in compmark.hpp"
done

# The library prints nothing, has no clock, no global state of the standard library, and no using-directive.
forbidden() {
  # shellcheck disable=SC2086 # words on purpose
  found=$(grep -nE "$1" $headers | grep -vE '^[^:]+:[0-9]+: *(//|\*)' || true)
  [ -z "$found" ] || complain "$2:
$found"
}
forbidden '#include <(iostream|ostream|istream|random|execution|ranges|format|source_location)>' 'includes that are too heavy or not accepted by both compilers'
forbidden 'std::(cout|cerr|clog)|[^a-z_]f?printf\(|[^a-z_]puts\(' 'the library prints nothing'
forbidden 'steady_clock|system_clock|high_resolution_clock|[^a-z_]time\(nullptr' 'the library has no clock'
forbidden '[^a-z_]s?rand\(|std::mt19937|random_device' 'random numbers come from core/random.hpp'
forbidden '^ *using namespace' 'no using-directive in a header'

macros=$(grep -nE '^ *# *define +[A-Za-z_]+' $headers | grep -vE '# *define +(COMPMARK_|STB)' || true)
[ -z "$macros" ] || complain "macros carry the prefix COMPMARK_:
$macros"

# The README shows a program that compiles: the example, from its first include on.
readme=$(awk '/^```cpp$/ { on = 1; next } /^```$/ { if (on) exit } on { print }' README.md)
example=$(sed -n '5,$p' examples/01_render_gaussians.cpp)
[ "$readme" = "$example" ] || complain "the program in README.md is not examples/01_render_gaussians.cpp"

tracked=$(git ls-files -co --exclude-standard 2>/dev/null || true)
if [ -n "$tracked" ]; then
  # Paths of a developer's machine, in any text file that git tracks or would track.
  home='/(home|Users|root|work|mnt)'
  # shellcheck disable=SC2086 # words on purpose
  paths=$(grep -nIE "(^|[\"' =(:])$home/[A-Za-z0-9_.]" $tracked 2>/dev/null | grep -vE '^tests/hygiene/headers\.sh:' || true)
  [ -z "$paths" ] || complain "paths of one machine:
$paths"
fi

[ "$bad" -eq 0 ] && echo "all files keep the house rules: $(echo "$headers" | wc -l) headers"
exit $bad
