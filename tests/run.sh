#!/bin/sh
# SPDX-FileCopyrightText: 2026 The CompMark authors
# SPDX-License-Identifier: Apache-2.0
#
# Sets up, builds and runs the tests with the release preset: sh tests/run.sh [preset [jobs]]
# The last line counts test cases over all executables (a test that is no doctest program counts as one case).
# The environment may add cmake arguments: COMPMARK_CMAKE_ARGS="-DCOMPMARK_WARNINGS_AS_ERRORS=ON".
set -eu
cd "$(dirname "$0")/.."
preset=${1:-release}
jobs=${2:-$(getconf _NPROCESSORS_ONLN 2>/dev/null || echo 2)}
build="build/$preset"

sh cmake/install_dependencies.sh
# shellcheck disable=SC2086 # words on purpose
# Said aloud: quickstart.sh leaves the tests out of the same folder.
if ! cmake --preset "$preset" -DCOMPMARK_BUILD_TESTS=ON -DCOMPMARK_BUILD_EXAMPLES=ON ${COMPMARK_CMAKE_ARGS:-}; then
  echo "0 passed, 1 failed, 0 skipped"
  exit 1
fi
status=0
# What does not compile fails below as a test that could not run; the others are run all the same.
cmake --build "$build" --target compmark_tests -j "$jobs" -- -k 0 || status=1
# The limit ends what hangs, and no test of a slow machine.
ctest --test-dir "$build" -LE '^(compilers|example|benchmark|consumer)$' --no-tests=error --timeout 1800 -j "$jobs" \
  --test-output-size-passed 4000000 --test-output-size-failed 4000000 --output-on-failure --output-junit tests.xml || status=1
awk -f tests/support/count.awk "$build/tests.xml" || status=1
exit $status
