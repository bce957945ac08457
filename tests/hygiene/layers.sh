#!/bin/sh
# SPDX-FileCopyrightText: 2026 The CompMark authors
# SPDX-License-Identifier: Apache-2.0
#
# The layer law, by the include graph: core <- math <- {scene, io, metric} <- splat <- {watermark | codec} <- recipes <- app. The two wings,
# watermark and codec, never include one another; testing may include all but app. A concept.hpp includes only core, so that any module may include
# it; no header reaches itself. And what may be missing stays missing: a header that needs a library of its own (an optional component) is included
# by no other header, and by tests and examples named after the component alone, which are left out where it is not installed. What compmark::app
# and compmark::app_run compile once is reached from exactly one of their files: two would define it twice, and a linker alone says so.   layers.sh <project root>
set -eu
cd "${1:-.}/include"

edges() { grep -HoE '^ *#include "compmark/[a-z0-9_/]+\.hpp"' -r compmark --include='*.hpp' | sed -E 's/^([^:]+):.*"([^"]+)"/\1 \2/'; }
# A header of app ends with its own functions, which begin with it (app/compiled.hpp): one header in two files.
between() { edges | grep -vE '^compmark/app/((run/)?)([a-z_]+)\.hpp compmark/app/\1detail/\3\.hpp$'; }

law() {
  awk '
  BEGIN {
    allow("core", "core")
    allow("math", "core math")
    allow("io", "core math scene io")
    allow("scene", "core math io scene")
    allow("metric", "core math scene metric")
    below = "core math io scene metric splat "
    allow("splat", below)
    allow("watermark", below "watermark")
    allow("codec", below "codec")
    allow("recipes", below "watermark codec recipes")
    allow("testing", below "watermark codec recipes testing")
    allow("app", below "watermark codec recipes app")
  }
  function allow(module, list,    k, part, m) { m = split(list, part, " "); for (k = 1; k <= m; k++) ok[module, part[k]] = 1; known[module] = 1 }
  function module_of(path,    part) { return split(path, part, "/") > 2 ? part[2] : "" }
  {
    from = module_of($1); to = module_of($2)
    if (from == "") next                          # compmark.hpp, fwd.hpp, version.hpp stand above all modules
    if (!(from in known)) { print $1 ": module \"" from "\" is not in the layer law (tests/hygiene/layers.sh)"; bad = 1; next }
    if (to == "") { if ($2 !~ /(fwd|version)\.hpp$/) { print $1 " includes " $2 ": modules do not include the umbrella"; bad = 1 }; next }
    if ($2 !~ /\/concept\.hpp$/ && !((from, to) in ok)) { print $1 " includes " $2 ": " from " may not include " to; bad = 1 }
    if ($1 ~ /\/concept\.hpp$/ && to != "core") { print $1 " includes " $2 ": a concept includes only core"; bad = 1 }
  }
  END { exit bad }'
}
edges | law

# Negative control: each of these is seen.
for planted in "watermark/embed/a.hpp codec/hac/b.hpp" "codec/hac/a.hpp watermark/proof/b.hpp" "splat/training/a.hpp recipes/b.hpp" "splat/raster/a.hpp codec/rate/b.hpp" \
  "math/a.hpp scene/b.hpp" "recipes/a.hpp app/b.hpp" "app/a.hpp testing/b.hpp" "splat/loss/concept.hpp math/b.hpp" "pipeline/a.hpp core/b.hpp" "core/a.hpp compmark.hpp"; do
  if echo "compmark/${planted% *} compmark/${planted#* }" | law >/dev/null; then
    echo "the law does not see that ${planted% *} includes ${planted#* }"
    exit 1
  fi
done

loops=$(mktemp)
trap 'rm -f "$loops"' EXIT
between | tsort >/dev/null 2>"$loops" || true
if grep -q loop "$loops"; then
  echo "headers that include one another in a loop:"
  cat "$loops"
  exit 1
fi
echo "layer law holds: $(edges | wc -l) includes"

# Includes as the files of compmark::app and compmark::app_run see them, then lines "defines HEADER".
compiled() {
  find compmark -name '*.hpp' -o -path 'compmark/app/*.cpp' | LC_ALL=C sort | xargs awk '
    /^#if !defined\(COMPMARK_APP_COMPILED\)/ { left_out = 1 }
    /^#endif/ { left_out = 0 }
    !left_out && /^#include "compmark\// { split($0, part, "\""); print FILENAME, part[2] }'
  grep -lE '^COMPMARK_APP_INLINE ' -r compmark/app --include='*.hpp' | sed 's/^/defines /'
}
once() {
  awk '
  $1 == "defines" { defines[$2]; next }
  { to[$1] = to[$1] " " $2; if ($1 ~ /\.cpp$/) files[$1] }
  function visit(header, file,    part, m, k) {
    if ((header, file) in seen) return
    seen[header, file]
    if (header in defines) { number[header]++; by[header] = by[header] " " file }
    m = split(to[header], part, " ")
    for (k = 1; k <= m; k++) visit(part[k], file)
  }
  END {
    for (file in files) visit(file, file)
    for (header in defines)
      if (number[header] != 1) { print header " defines functions that are compiled once, but is reached from " number[header] + 0 " files:" by[header]; bad = 1 }
    exit bad
  }'
}
compiled | once
for planted in "compmark/app/detail/export.hpp compmark/app/detail/files.hpp" "compmark/app/detail/export_warnings.hpp compmark/app/detail/any_model.hpp" "defines compmark/app/detail/of_no_file.hpp" \
  "compmark/app/run/app_run_codecs.cpp compmark/app/run/detail/run_folder.hpp" "compmark/app/run/detail/fit_codec.hpp compmark/app/detail/files.hpp"; do
  if { compiled; echo "$planted"; } | once >/dev/null; then
    echo "the check of what is compiled once does not see that $planted"
    exit 1
  fi
done
echo "compiled once: $(compiled | grep -c '^defines ') headers of app"

optional=$(sed -nE '/set\(COMPMARK_OPTIONAL_COMPONENTS/,/\)/ { s/"([a-z]+ [a-z0-9_\/]+\.hpp) [A-Za-z:_]+"/\n\1\n/gp }' ../cmake/CompmarkTargets.cmake | grep -E '^[a-z]+ [a-z0-9_/]+\.hpp$')
[ -n "$optional" ] || { echo "no optional components in cmake/CompmarkTargets.cmake: this check has lost its list"; exit 1; }
bad=0
while read -r component header; do
  found=$(cd .. && grep -rlE "#include [<\"]compmark/$header[>\"]" include tests examples benchmarks --include='*.hpp' --include='*.cpp' |
    grep -vE "/${component}_[a-z_]*\.(test|fail)\.cpp$|^tests/fail/${component}_|^examples/[0-9]+_[a-z_]*_${component}\.cpp$" || true)
  for file in $found; do
    echo "$file includes compmark/$header, which needs $component: only tests named ${component}_*.test.cpp and examples named *_${component}.cpp may"
    bad=1
  done
done <<LIST
$optional
LIST
[ "$bad" -eq 0 ]
echo "optional components stay optional: $(echo "$optional" | wc -l)"
