#!/bin/sh
# SPDX-FileCopyrightText: 2026 The CompMark authors
# SPDX-License-Identifier: Apache-2.0
#
# The layer law, by the include graph: core <- math <- scene <- stage rooms <- {codec, pipeline} <- recipes <- app; io at the rim; stage rooms
# never include one another; a concept.hpp includes only core; no header reaches itself. And what may be missing stays missing: a header that
# needs a library of its own (an optional component) is included by no other header, and by tests named after the component alone, which
# are left out where it is not installed.   layers.sh <project root>
set -eu
cd "${1:-.}/include"

edges() { grep -HoE '^ *#include "compmark/[a-z0-9_/]+\.hpp"' -r compmark --include='*.hpp' | sed -E 's/^([^:]+):.*"([^"]+)"/\1 \2/'; }
# A header of app ends with its own functions, which begin with it (app/compiled.hpp): one header in two files.
between() { edges | grep -vE '^compmark/app/([a-z_]+)\.hpp compmark/app/detail/\1\.hpp$'; }

edges | awk '
  BEGIN {
    stages = "anchor effect raster mark quant entropy loss optim attack metric"
    allow("core", "core")
    allow("math", "core math")
    allow("io", "core math scene io")
    allow("scene", "core math io scene")
    n = split(stages, stage, " ")
    for (i = 1; i <= n; i++) allow(stage[i], "core math scene " stage[i])
    allow("codec", "core math scene io codec " stages)
    allow("pipeline", "core math scene io codec pipeline " stages)
    allow("recipes", "core math scene io codec pipeline recipes " stages)
    allow("app", "core math scene io codec pipeline recipes app " stages)
    allow("testing", "core math scene io codec pipeline recipes testing " stages)
  }
  function allow(room, list,    k, part, m) { m = split(list, part, " "); for (k = 1; k <= m; k++) ok[room, part[k]] = 1; known[room] = 1 }
  function room_of(path,    part) { return split(path, part, "/") > 2 ? part[2] : "" }
  {
    from = room_of($1); to = room_of($2)
    if (from == "") next                          # compmark.hpp, fwd.hpp, version.hpp stand above all rooms
    if (!(from in known)) { print $1 ": room \"" from "\" is not in the layer law (tests/hygiene/layers.sh)"; bad = 1; next }
    if (to == "") { if ($2 !~ /(fwd|version)\.hpp$/) { print $1 " includes " $2 ": rooms do not include the umbrella"; bad = 1 }; next }
    if (from == "io" && $2 ~ /\/concept\.hpp$/) next   # formats speak the plain tables that concepts declare
    if (!((from, to) in ok)) { print $1 " includes " $2 ": " from " may not include " to; bad = 1 }
    if ($1 ~ /\/concept\.hpp$/ && to != "core" && to != from) { print $1 " includes " $2 ": a concept includes only core"; bad = 1 }
  }
  END { exit bad }'

between | tsort >/dev/null 2>loops.$$ || true
if grep -q loop loops.$$; then
  echo "headers that include one another in a loop:"
  cat loops.$$
  rm -f loops.$$
  exit 1
fi
rm -f loops.$$
echo "layer law holds: $(edges | wc -l) includes"

optional=$(sed -nE '/set\(COMPMARK_OPTIONAL_COMPONENTS/,/\)/ { s/"([a-z]+ [a-z0-9_\/]+\.hpp) [A-Za-z:_]+"/\n\1\n/gp }' ../cmake/CompmarkTargets.cmake | grep -E '^[a-z]+ [a-z0-9_/]+\.hpp$')
[ -n "$optional" ] || { echo "no optional components in cmake/CompmarkTargets.cmake: this check has lost its list"; exit 1; }
bad=0
while read -r component header; do
  found=$(cd .. && grep -rlE "#include [<\"]compmark/$header[>\"]" include tests examples benchmarks --include='*.hpp' --include='*.cpp' |
    grep -vE "/${component}_[a-z_]*\.(test|fail)\.cpp$|^tests/fail/${component}_" || true)
  for file in $found; do
    echo "$file includes compmark/$header, which needs $component: only tests named ${component}_*.test.cpp may"
    bad=1
  done
done <<LIST
$optional
LIST
[ "$bad" -eq 0 ]
echo "optional components stay optional: $(echo "$optional" | wc -l)"
