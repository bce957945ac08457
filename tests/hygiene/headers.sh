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

# One program reads all files: a process for each of thousand files would take half a minute.
# shellcheck disable=SC2086 # words on purpose
problems=$(headers="$headers" awk '
  function finish() {
    if (file == "") return
    if (!licensed) print file ": the first two lines are not the SPDX lines"
    if (!(file in header)) return
    if (!once) print file ": no #pragma once"
    if (!told) print file ": line 4 does not begin the paragraph that says what this is"
    if (lines > 300 && !reason) print file ": " lines " lines; above 300 the first comment says why"
  }
  BEGIN {
    count = split(ENVIRON["headers"], list, "\n")
    for (i = 1; i <= count; ++i) header[list[i]] = 1
  }
  FNR == 1 { finish(); file = FILENAME; seen[file] = 1; first = $0; licensed = once = told = reason = 0; comment = 1 }
  { lines = FNR }
  FNR == 2 { licensed = (first " " $0) ~ /SPDX-FileCopyrightText: .*SPDX-License-Identifier: Apache-2.0/ }
  FNR == 4 { told = $0 ~ /^\/\/ [A-Za-z0-9`"(]/ }
  FNR > 3 && !/^\/\// { comment = 0 }
  comment && FNR > 3 && tolower($0) ~ /one file|long|lines|together|in one place|only file/ { reason = 1 }
  $0 == "#pragma once" { once = 1 }
  END {
    finish()
    for (i = 1; i < ARGC; ++i) if (!(ARGV[i] in seen)) print ARGV[i] ": is empty"
  }' $headers $sources)
[ -z "$problems" ] || complain "$problems"

# shellcheck disable=SC2046 # words on purpose
problems=$(awk '
  FNR <= 4 && /SPDX-License-Identifier: Apache-2.0/ { licensed[FILENAME] = 1 }
  END { for (i = 1; i < ARGC; ++i) if (!(ARGV[i] in licensed)) print ARGV[i] ": no SPDX line" }' \
  $(find . -path ./build -prune -o -path ./.git -prune -o \( -name CMakeLists.txt -o -name '*.cmake' -o -name '*.sh' -o -name '*.awk' \) -print) .ci/run)
[ -z "$problems" ] || complain "$problems"

# The umbrella and those of the wings name every header between them.
umbrellas='include/compmark/compmark.hpp include/compmark/scene.hpp include/compmark/splat.hpp include/compmark/watermark.hpp include/compmark/codec.hpp'
# shellcheck disable=SC2086 # words on purpose
problems=$({
  cat $umbrellas
  echo "$headers" | grep -vE '/testing/|/app/|/detail/|/metric/colour_fit\.hpp$|/compmark/compmark\.hpp$|_executor\.hpp$|_adaptor\.hpp$'
} | awk '
  /^#include "/ { included[substr($0, 11, length($0) - 11)] = 1 }
  /^include\// && !(substr($0, 9) in included) { print $0 " is in no umbrella (compmark.hpp, or scene, splat, watermark, codec.hpp)" }')
[ -z "$problems" ] || complain "$problems"

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
