#!/bin/sh
# SPDX-FileCopyrightText: 2026 The CompMark authors
# SPDX-License-Identifier: Apache-2.0
#
# site.sh SOURCE: docs/site/build.sh ends without a warning; the site has the classes, concepts and pages it should; no link in it leads nowhere. Then a
# small tree of its own with one fault of each kind, which has to be refused (negative control).
set -eu
source=$1
command -v doxygen >/dev/null 2>&1 || { echo "skipped: doxygen is not installed"; exit 77; }
scratch=$(mktemp -d)
trap 'rm -rf "$scratch"' EXIT
fail() {
  echo "site: $*"
  exit 1
}

# Links of all pages to files that are not there, a line each.
dead_links() {
  (
    cd "$1"
    grep -oE '(href|src)="[^"#?]+' -- *.html | grep -vE '="[a-z]+:' | sed -E 's/^([^:]*):(href|src)="/\1 /' | sort -u | awk '{ print $2 "\t" $1 }' | sort -u >"$scratch/links"
    cut -f 1 "$scratch/links" | sort -u | while read -r file; do
      [ -e "$file" ] || grep -F -m 1 "$file	" "$scratch/links" | awk '{ print $2 " leads to " $1 ", which is not there" }'
    done
  )
}

sh "$source/docs/site/build.sh" "$scratch/site" || fail "the site has warnings"
html=$scratch/site/html
for page in index structcompmark_1_1CoarseToFine conceptcompmark_1_1Rasterizer docs_watermark_md docs_spec_numerics_md compmark_8h; do
  [ -s "$html/$page.html" ] || fail "there is no $page.html"
done
# The comment at the top of a header is the text of its file, and the comment of a member is its text.
grep -q 'Coarse images first\.' "$html/coarse__to__fine_8hpp.html" || fail "a header's first comment is missing"
grep -q 'Pixels of the shortest side of a coarse image' "$html/structcompmark_1_1CoarseToFine.html" || fail "a member's comment is missing"
dead=$(dead_links "$html")
[ -z "$dead" ] || fail "$dead"

# Negative control.
tree=$scratch/tree
planted() { # planted WHAT: the tree as it stands is refused
  if sh "$tree/docs/site/build.sh" "$tree/site" >"$scratch/log" 2>&1; then fail "not seen: $1"; fi
}
name=one.md page=$tree/docs/$name
mkdir -p "$tree/docs/notebook" "$tree/include/compmark" "$tree/bindings/c"
cp -r "$source/docs/site" "$tree/docs/site"
cp "$source/include/compmark/version.hpp" "$tree/include/compmark"
echo '/* one */' >"$tree/bindings/c/compmark.h"
for top in CHANGELOG CONTRIBUTING SECURITY; do printf '# %s\n' "$top" >"$tree/$top.md"; done
printf '# Main\n\n[one](%s), [its end](%s#the-end)\n' "docs/$name" "docs/$name" >"$tree/README.md"
printf '# One\n\n## The end\n\n`\\no_such <b` and \\no_such and a@b.\n' >"$page"
sh "$tree/docs/site/build.sh" "$tree/site" >"$scratch/log" 2>&1 || { cat "$scratch/log"; fail "the sound tree is refused"; }
printf '# One\n\n## The end of it\n' >"$page"
planted "a link to a heading that is not there"
printf '# One\n\n## The end\n\n[two](two.md)\n' >"$page"
planted "a link to a page that is not there"
printf '# One\n\n## The end\n\n![picture](none.png)\n' >"$page"
sh "$tree/docs/site/build.sh" "$tree/site" >"$scratch/log" 2>&1 || { cat "$scratch/log"; fail "a picture is Doxygen's to look for"; }
dead_links "$tree/site/html" | grep -q 'leads to none.png' || fail "not seen: a picture that is not there"
echo "the site is whole; three planted faults were seen"
