#!/bin/sh
# SPDX-FileCopyrightText: 2026 The CompMark authors
# SPDX-License-Identifier: Apache-2.0
#
# Opens the page of a training run in a browser without a screen: every picture is there, no script complains, nothing is asked of the network.
#   report.sh <the tool>
set -eu
tool=$1
root=$(cd "$(dirname "$0")/../.." && pwd)
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
document_of() { # <page>: its document, and what was logged
  "$browser" --headless --no-sandbox --disable-gpu --virtual-time-budget=20000 --enable-logging=stderr --dump-dom \
    "file://$1" >"$scratch/dom.html" 2>"$scratch/browser.log"
}
# Some systems have a command of that name that is none, or one that may not read here.
echo '<html><body><p id="works"></p></body></html>' >"$scratch/works.html"
if ! document_of "$scratch/works.html" || ! grep -q 'id="works"' "$scratch/dom.html"; then
  echo "skipped: $browser does not open a page without a screen"
  exit 77
fi

# A marked run for compression: its page has every part that a page can have.
"$tool" scene --out "$scratch/scene" --width 64 --height 64 --train 12 --test 3 >/dev/null
"$tool" keygen --bits 48 --out "$scratch/owner.key" >/dev/null
"$tool" train --data "$scratch/scene" --out "$scratch/run" --iterations 120 --voxel-size 0.02 --codec hac --key "$scratch/owner.key" \
  --decoder "$root/weights/lattice_48.safetensors" >"$scratch/train.log" 2>&1 || { cat "$scratch/train.log"; exit 1; }

# What the page says of itself when everything has loaded.
probe='<script>window.addEventListener("load", () => { const all = [...document.images];
const missing = all.filter(i => !(i.complete \&\& i.naturalWidth > 0)).length;
document.body.setAttribute("data-pictures", all.length + " pictures, " + missing + " missing"); });</script>'
open_page() {
  sed "s|</body>|$(printf '%s' "$probe" | tr '\n' ' ')</body>|" "$1" >"$scratch/page.html"
  document_of "$scratch/page.html"
}
complaints() { grep -E 'CONSOLE|Uncaught|ERR_' "$scratch/browser.log" || true; }
pictures() { grep -o 'data-pictures="[^"]*"' "$scratch/dom.html" | head -n 1; }

open_page "$scratch/run/report.html"
found=$(pictures)
echo "$found"
case $found in
  'data-pictures="0 '*) echo "the page has no picture" && exit 1 ;;
  *', 0 missing"') ;;
  *) echo "pictures are missing" && cat "$scratch/browser.log" && exit 1 ;;
esac
[ -z "$(complaints)" ] || { complaints; exit 1; }
# Pictures, styles and scripts are in the page itself.
if grep -oE "src=[\"'](https?:)?//[^\"']*|<link [^>]*href=[^>]*|url\([\"']?https?:[^)]*|fetch\([^)]*" "$scratch/run/report.html"; then
  echo "the page asks for something of the network"
  exit 1
fi

# Controls: a picture that is not there, and a script that fails, are seen.
sed 's|</body>|<img src="nothing.png"></body>|' "$scratch/run/report.html" >"$scratch/broken.html"
open_page "$scratch/broken.html"
case $(pictures) in *', 1 missing"') ;; *) echo "the control's missing picture was not seen" && exit 1 ;; esac
sed 's|</body>|<script>undefined_function();</script></body>|' "$scratch/run/report.html" >"$scratch/broken.html"
open_page "$scratch/broken.html"
complaints | grep -q undefined_function || { echo "the control's failing script was not seen"; exit 1; }
