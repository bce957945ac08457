# SPDX-FileCopyrightText: 2026 The CompMark authors
# SPDX-License-Identifier: Apache-2.0
#
# Counts test cases in the JUnit file of ctest: doctest's summary of every executable, one case for every other test. A test that ctest
# calls failed counts as at least one failure, whatever it printed (a crash prints no summary). A case that says "skipped: reason" is
# skipped, not passed. Prints the reasons, then "N passed, N failed, N skipped"; exit status 1 if anything failed or nothing passed.
function number_before(text, word) {
  if (!match(text, "[0-9]+ +" word)) return 0
  return substr(text, RSTART, RLENGTH) + 0
}
function attribute(text, key) {
  if (!match(text, key "=\"[^\"]*\"")) return ""
  return substr(text, RSTART + length(key) + 2, RLENGTH - length(key) - 3)
}
function skip(reason) {
  case_skipped++
  if (!((name, reason) in reasons)) order[++reason_count] = name SUBSEP reason
  reasons[name, reason]++
}
/<testcase / {
  name = attribute($0, " name"); status = attribute($0, "status")
  doctest = 0; case_passed = 0; case_failed = 0; case_skipped = 0
}
/\[doctest\] test cases:/ {
  doctest = 1
  case_passed += number_before($0, "passed")
  case_failed += number_before($0, "failed")
}
/skipped: / && !/\[doctest\]/ { line = $0; sub(/^.*skipped: /, "", line); skip(line) }
/<skipped message="SKIP_/ { status = "skipped" }
/<\/testcase>/ {
  failed_here = (status != "run" && status != "skipped")
  if (status == "skipped" && !case_skipped) skip("not available here")
  if (doctest) case_passed -= case_skipped
  else case_passed = (failed_here || case_skipped) ? 0 : 1
  if (!doctest && case_skipped > 1) case_skipped = 1
  if (failed_here && case_failed == 0) case_failed = 1
  passed += case_passed > 0 ? case_passed : 0
  failed += case_failed; skipped += case_skipped
  if (case_failed > 0) bad[++bad_count] = name
}
END {
  for (i = 1; i <= reason_count; i++) {
    split(order[i], part, SUBSEP)
    printf "skipped: %s: %s (%d)\n", part[1], part[2], reasons[part[1], part[2]]
  }
  for (i = 1; i <= bad_count; i++) printf "failed: %s\n", bad[i]
  printf "%d passed, %d failed, %d skipped\n", passed, failed, skipped
  exit (failed > 0 || passed == 0) ? 1 : 0
}
