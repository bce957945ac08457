# SPDX-FileCopyrightText: 2026 The CompMark authors
# SPDX-License-Identifier: Apache-2.0
#
# Read by the tests of this folder: sets `browser`, or ends the test as skipped (77), and `scratch`, a folder that is removed at the end.
browser=""
for name in chromium-headless-shell chromium chromium-browser google-chrome; do
  if command -v "$name" >/dev/null 2>&1; then
    browser=$name
    break
  fi
done
if [ -z "$browser" ]; then
  echo "skipped: no Chromium is installed (Debian: chromium-headless-shell)"
  exit 77
fi
scratch=$(mktemp -d)
trap 'rm -rf "$scratch"' EXIT
# Runs a command of the tool, whose output is shown where it fails.
quiet() { "$@" >"$scratch/command.log" 2>&1 || { cat "$scratch/command.log"; exit 1; }; }
