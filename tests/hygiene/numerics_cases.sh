#!/bin/sh
# SPDX-FileCopyrightText: 2026 The CompMark authors
# SPDX-License-Identifier: Apache-2.0
#
# The page of hard cases holds: every id of its families is there once and in order, the headers and test files that it names exist, and each test
# case that it names stands in its file. A case without a test or without a negative control says "none yet"; how many may is written below, and
# may only fall.   numerics_cases.sh <project root>
set -eu
export LC_ALL=C
cd "${1:-.}"
page=docs/spec/numerics.md
tests_owed=0 controls_owed=0

# The page's claims, one a line: "id", "header <id> <path>", "case <id> <path> <name>", "file <id> <path>", "owed <id> test|control", "bad <id> …".
claims() {
  awk '
    function claim(kind, rest,    path, name) {
      if (rest ~ /^none yet$/) { print "owed\t" id "\t" kind; return }
      if (kind == "control" && rest ~ /^the same test: ./) { print "same\t" id; return }
      if (rest !~ /^`tests\/[^`]+`/) { print "bad\t" id "\t" kind " names no file of tests: " rest; return }
      path = rest; sub(/^`/, "", path); sub(/`.*/, "", path)
      name = rest; sub(/^`[^`]+` ?/, "", name)
      if (path !~ /\.test\.cpp$/) { print "file\t" id "\t" path; return }
      if (name !~ /^"[^"]+"/) { print "bad\t" id "\t" kind " names no test case of " path; return }
      sub(/^"/, "", name); sub(/".*/, "", name)
      print "case\t" id "\t" path "\t" name
    }
    /^### / { id = $2; sub(/\.$/, "", id); print "id\t" id; next }
    /^- In: / { n = split($0, part, "`"); for (i = 2; i <= n; i += 2) print "header\t" id "\t" part[i] }
    /^- Test: / { print "has\t" id "\ttest"; claim("test", substr($0, 9)) }
    /^- Control: / { print "has\t" id "\tcontrol"; claim("control", substr($0, 12)) }
    /^- Does not apply: ./ { print "has\t" id "\treason" }
  ' "$1"
}

# All names of test cases of a file, one a line: adjacent literals are one name.
names() {
  tr '\n' ' ' <"$1" | sed -E 's/"[ ]+"//g' | grep -oE 'TEST_CASE[A-Z_]*\( *"[^"]+"' | sed -E 's/^[^"]*"//; s/"$//'
}

check() {
  claims "$1" >"$work/claims"
  awk 'BEGIN {
    n = split("PR 10 CV 8 TB 10 BF 9 BB 6 SH 4 ML 6 QU 4 AN 10 LS 10 FR 8 QD 4 QZ 4 EN 10 CO 2 OP 6 ME 4 CA 4 SY 4", part, " ")
    for (i = 1; i < n; i += 2) for (k = 1; k <= part[i + 1]; k++) print part[i] k
  }' >"$work/expected"
  awk -F '\t' '$1 == "id" { print $2 }' "$work/claims" >"$work/found"
  bad=0
  diff "$work/expected" "$work/found" >"$work/difference" || { echo "the ids are not the 123, once and in order:"; cat "$work/difference"; bad=1; }
  awk -F '\t' '
    $1 == "id" { ids[++n] = $2 }
    $1 == "has" { has[$2, $3] = 1 }
    $1 == "bad" { print $2 ": " $3; wrong = 1 }
    END {
      for (i = 1; i <= n; i++) {
        if (has[ids[i], "reason"]) continue
        if (!has[ids[i], "test"]) { print ids[i] ": neither a test nor a reason why it does not apply"; wrong = 1 }
        if (!has[ids[i], "control"]) { print ids[i] ": no line of its control"; wrong = 1 }
      }
      exit wrong
    }' "$work/claims" || bad=1
  awk -F '\t' '$1 == "header" { print "include/compmark/" $3 } $1 == "file" || $1 == "case" { print $3 }' "$work/claims" | sort -u | while read -r path; do
    [ -f "$path" ] || echo "there is no file $path"
  done >"$work/missing"
  awk -F '\t' '$1 == "case" { print $3 "\t" $4 }' "$work/claims" | sort -u >"$work/cases"
  cut -f 1 "$work/cases" | sort -u | while read -r path; do
    known="$work/$(echo "$path" | tr '/' '_')"
    [ ! -f "$path" ] || [ -f "$known" ] || names "$path" >"$known"
    [ ! -f "$path" ] || sed "s|^|$path\t|" "$known"
  done | sort -u | comm -23 "$work/cases" - | sed 's/^/there is no test case /' >>"$work/missing"
  cat "$work/missing"
  [ ! -s "$work/missing" ] || bad=1
  tests=$(awk -F '\t' '$1 == "owed" && $3 == "test"' "$work/claims" | wc -l) controls=$(awk -F '\t' '$1 == "owed" && $3 == "control"' "$work/claims" | wc -l)
  echo "$(wc -l <"$work/found") cases, $tests without a test, $controls without a control"
  [ "$tests" -le "$tests_owed" ] || { echo "at most $tests_owed may be without a test"; bad=1; }
  [ "$controls" -le "$controls_owed" ] || { echo "at most $controls_owed may be without a control"; bad=1; }
  return "$bad"
}

work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT INT TERM
check "$page"

# Negative controls: each fault is seen.
fault() {
  sed -E "$1" "$page" >"$work/page.md"
  ! cmp -s "$page" "$work/page.md" || { echo "control: \"$1\" changes nothing"; exit 1; }
  if (tests_owed=1000 controls_owed=1000; check "$work/page.md" >"$work/log"); then
    echo "control: the check does not see \"$1\""
    exit 1
  fi
}
fault 's/^### CV3\. /### CV9. /'
fault '/^### BF2\. /,/^### BF3\. /{ /^- Test: /d }'
fault 's/^(- In: )`math\/haar\.hpp`/\1`math\/hear.hpp`/'
fault 's/(math\/fft: twiddles from a table)/\1s/'
fault 's/`tests\/metric\/psnr\.test\.cpp`/`tests\/metric\/psnrs.test.cpp`/'
sed -E '0,/^- Control: the same test: .*/s//- Control: none yet/' "$page" >"$work/page.md"
if (controls_owed=$((controls)); check "$work/page.md" >"$work/log"); then
  echo "control: one more case without a control is not seen"
  exit 1
fi
echo "and each of six faults is seen"
