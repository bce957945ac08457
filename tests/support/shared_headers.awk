# SPDX-FileCopyrightText: 2026 The CompMark authors
# SPDX-License-Identifier: Apache-2.0
#
# Which precompiled header is read before which header, when each is compiled alone: "<header> <precompiled header>" a line, both as they are included.
#   cd include && awk -f ../tests/support/shared_headers.awk [-v count=24] [-v report=1] $(find compmark -name '*.hpp')
#
# A header is given only what it includes itself, before its first declaration and under no condition, or what those include in this way. So nothing is
# declared to it that it would not have alone, and one that forgets an #include still fails. (An #include lower down, or within #if, counts for nothing.)
# Those that save most are chosen, one after the other; the cost of a header is a guess by its lines and by the libraries that it includes.
BEGIN {
  if (!count) count = 24
  milliseconds["Eigen/Dense"] = 1200; milliseconds["Eigen/Core"] = 1000; milliseconds["nlohmann/json.hpp"] = 1400
  milliseconds["filesystem"] = milliseconds["chrono"] = 350; milliseconds["functional"] = milliseconds["string"] = milliseconds["memory"] = 150
}
FNR == 1 { file = FILENAME; files[++number] = file; top = 1; depth = 0 }
{ ++lines[file] }
!top { next }
/^ *#if/ { ++depth; next }
/^ *#endif/ { --depth; next }
/^#include/ {
  if (depth) next
  name = substr($2, 2, length($2) - 2)
  if (name in milliseconds) libraries[file] = libraries[file] " " name
  else if (name ~ /^compmark\//) includes[file] = includes[file] " " name
  next
}
/^ *(\/\/|#|$)/ { next }
{ top = 0 } # the first declaration

END {
  # Of each header what it reads, the libraries counted as headers: until a round adds nothing.
  for (i = 1; i <= number; ++i) closure[files[i]] = " " files[i] libraries[files[i]] " "
  do {
    added = 0
    for (i = 1; i <= number; ++i) {
      n = split(includes[files[i]], list, " ")
      for (k = 1; k <= n; ++k) {
        m = split(closure[list[k]], parts, " ")
        for (j = 1; j <= m; ++j) if (index(closure[files[i]], " " parts[j] " ") == 0) { closure[files[i]] = closure[files[i]] parts[j] " "; ++added }
      }
    }
  } while (added)
  for (i = 1; i <= number; ++i) {
    n = split(closure[files[i]], parts, " ")
    for (j = 1; j <= n; ++j) {
      cost[files[i]] += parts[j] in milliseconds ? milliseconds[parts[j]] : lines[parts[j]] / 5
      if (parts[j] in lines) users[parts[j]] = users[parts[j]] " " files[i]
    }
  }
  for (chosen = 1; chosen <= count; ++chosen) {
    best = 0
    for (i = 1; i <= number; ++i) {
      n = split(users[files[i]], list, " ")
      saved = -1.5 * cost[files[i]] # it is compiled once more, and written
      for (j = 1; j <= n; ++j) if (cost[files[i]] > spared[list[j]]) saved += cost[files[i]] - spared[list[j]]
      if (saved > best) { best = saved; winner = files[i] }
    }
    if (best == 0) break
    n = split(users[winner], list, " ")
    for (j = 1; j <= n; ++j) if (cost[winner] > spared[list[j]]) { spared[list[j]] = cost[winner]; given[list[j]] = winner }
  }
  for (i = 1; i <= number; ++i) {
    if (files[i] in given) print files[i], given[files[i]]
    if (report) { all += cost[files[i]]; left += cost[files[i]] - spared[files[i]] }
  }
  if (report) print "estimated: " all / 1000 " s, left " left / 1000 " s" > "/dev/stderr"
}
