#!/bin/sh
# SPDX-FileCopyrightText: 2026 The CompMark authors
# SPDX-License-Identifier: Apache-2.0
#
# The reference and the pages of docs/ as one site, by Doxygen 1.9.4 or newer: sh docs/site/build.sh [folder, default build/site]
# Open html/index.html in it. A warning of Doxygen is an error, and is printed.
set -eu
cd "$(dirname "$0")/../.."
out=${1:-build/site}
if ! command -v doxygen >/dev/null 2>&1; then
  echo "skipped: doxygen is not installed (Debian: apt-get install doxygen)"
  exit 77
fi
mkdir -p "$out"
rm -rf "$out/html"
{ cat docs/site/Doxyfile; echo "OUTPUT_DIRECTORY = \"$out\""; echo "PROJECT_NUMBER = $(sed -n 's/.*char\* version = "\(.*\)".*/\1/p' include/compmark/version.hpp)"; } | doxygen -
echo "$(find "$out/html" -name '*.html' | wc -l) pages in $out/html"
