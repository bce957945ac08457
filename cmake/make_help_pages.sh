#!/bin/sh
# SPDX-FileCopyrightText: 2026 The CompMark authors
# SPDX-License-Identifier: Apache-2.0
#
# Writes the man page and the completions of the tool from what it prints for --help:  make_help_pages.sh <tool> <folder>
# The folder then holds compmark.1, compmark.bash, _compmark (zsh) and compmark.fish. SOURCE_DATE_EPOCH gives the date of the man page.
set -eu
tool=$1
folder=$2
here=$(cd "$(dirname "$0")" && pwd)
mkdir -p "$folder"
help=$(mktemp)
trap 'rm -f "$help"' EXIT

"$tool" --help >"$help.tool"
mv "$help.tool" "$help"
commands=$(awk '/^Subcommands:/ { on = 1; next } on && /^  [a-z]/ { print $1 }' "$help")
[ -n "$commands" ] || { echo "make_help_pages.sh: no command in the help of $tool" >&2; exit 1; }
for command in $commands; do
  printf '\f%s\n' "$command" >>"$help"
  "$tool" "$command" --help >>"$help"
done

version=$("$tool" --version | awk '{ print $2 }')
seconds=${SOURCE_DATE_EPOCH:-$(date +%s)}
date=$(date -u -d "@$seconds" +%Y-%m-%d 2>/dev/null || date -u -r "$seconds" +%Y-%m-%d) # GNU, then BSD
page() { awk -v format="$1" -v name=compmark -v version="$version" -v date="$date" -f "$here/help_pages.awk" "$help" >"$folder/$2"; }
page man compmark.1
page bash compmark.bash
page zsh _compmark
page fish compmark.fish
