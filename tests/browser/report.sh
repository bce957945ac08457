#!/bin/sh
# SPDX-FileCopyrightText: 2026 The CompMark authors
# SPDX-License-Identifier: Apache-2.0
#
# Opens the pages that quickstart.sh leaves, of a small scene, in a browser without a screen: all pictures are there, curves have points, the bytes
# add up to the file, the verdict can be read, no script complains, nothing is asked of the network. Pages that are spoilt must fail the same check.
#   report.sh <the tool>
set -eu
tool=$1
. "$(dirname "$0")/browser.sh"
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

# What quickstart.sh does, with a short message.
run=$scratch/run
quiet "$tool" scene --out "$scratch/scene" --width 64 --height 64 --train 12 --test 3
quiet "$tool" keygen --bits 16 --out "$scratch/owner.key"
quiet "$tool" train --data "$scratch/scene" --out "$run" --iterations 200 --voxel-size 0.2 --codec hac --key "$scratch/owner.key" --mark-iterations 100
quiet "$tool" evaluate --model "$run/model.cmk" "$run/model.safetensors" --unmarked "$run/unmarked.cmk" --data "$scratch/scene" \
  --key "$scratch/owner.key" --html "$scratch/evaluate.html"

# What a page says of itself when everything has loaded, a fact a line.
cat >"$scratch/probe.html" <<'END'
<script>addEventListener("load", () => {
  const facts = [], all = (kind, within = document) => [...within.querySelectorAll(kind)];
  const missing = all("img").filter(i => !(i.complete && i.naturalWidth > 1 && i.naturalHeight > 1));
  facts.push(all("img").length + " pictures, " + missing.length + " missing");
  for (const plot of all("svg.plot")) {
    const above = all("h2").filter(h => h.compareDocumentPosition(plot) & Node.DOCUMENT_POSITION_FOLLOWING).pop();
    const points = all("polyline", plot).reduce((sum, line) => sum + line.points.numberOfItems, 0);
    facts.push("plot " + (above ? above.textContent : "") + ": " + plot.querySelector(".title").textContent + ": " + points + " points, " +
               all("circle", plot).length + " dots");
  }
  for (const line of all("tr")) if (line.offsetHeight > 0) facts.push("row " + all("td,th", line).map(cell => cell.textContent).join(" | "));
  for (const verdict of all("p.verdict")) if (verdict.offsetHeight > 0) facts.push("verdict " + verdict.textContent);
  for (const link of all("a")) facts.push("link " + link.getAttribute("href"));
  const said = document.createElement("pre");
  said.id = "facts";
  said.textContent = "\n" + facts.join("\n") + "\n";
  document.body.append(said);
});</script>
END

# good <page> <pictures> <what must be a line of its facts>...: whether the page is as it should be; says what is wrong.
good() {
  page=$1 pictures=$2
  shift 2
  cat "$page" "$scratch/probe.html" >"$scratch/page.html"
  document_of "$scratch/page.html" || { echo "$page: the browser failed"; return 1; }
  sed -n '/<pre id="facts">/,/<\/pre>/p' "$scratch/dom.html" >"$scratch/facts.txt"
  bad=0
  if grep -E 'CONSOLE|Uncaught|ERR_' "$scratch/browser.log"; then bad=1; fi
  for fact in "$pictures pictures, 0 missing" "$@"; do
    grep -q -x -E "$fact" "$scratch/facts.txt" || { echo "$page: not said: $fact"; bad=1; }
  done
  # Pictures, styles and scripts are in the page itself.
  if grep -oE "src=[\"']([^d\"']|d[^a])[^\"']*|<link [^>]*href=[^>]*|url\([\"']?https?:[^)]*|fetch\([^)]*" "$page"; then
    echo "$page: asks for something beside itself"
    bad=1
  fi
  return $bad
}

some='[1-9][0-9]+ points, 0 dots'
sentence='row p-value \| [0-9].*: so likely a key drawn at random, without knowing the images and the decoder, would match at least as well'
verdict='verdict (DETECTED|NOT DETECTED|INCONCLUSIVE): .+'
bytes=$(wc -c <"$run/model.cmk" | tr -d ' ')
unmarked_bytes=$(wc -c <"$run/unmarked.cmk" | tr -d ' ')
# The page of the run: three views of ground truth, file, unmarked file, and two differences.
good_run() {
  good "$1" 15 "$sentence" "$verdict" "row each view \| mean bit accuracy .*" \
    "plot Training of the unmarked model: Loss: $some" "plot Training of the unmarked model: PSNR: $some" \
    "plot Hiding the message: Loss: $some" "plot Hiding the message: Bits that are right: $some" \
    "plot Message: Bits of all views, compressed: 2 points, 16 dots" "plot Message: Bits of all views, before the codec: 2 points, 16 dots" \
    "row the whole file \| $bytes \|  \| $unmarked_bytes" "link unmarked/report.html"
}
good_run "$run/report.html" || { cat "$scratch/facts.txt"; exit 1; }
# Bytes by section, which add up.
sections=$(sed -n '/^row section | model.cmk/,/^row the whole file/p' "$scratch/facts.txt" | sed '1d;$d')
echo "$sections" | awk -F ' [|] ' -v whole="$bytes" -v other="$unmarked_bytes" '{ sum += $2; others += $4 }
  END { exit NR >= 6 && sum == whole && others == other ? 0 : 1 }' || { echo "sections do not add up: $sections"; exit 1; }
# The page that it links, of the training alone.
good "$run/unmarked/report.html" 9 "plot Training: Loss: $some" "plot Training: PSNR: $some" || exit 1
# The page of evaluate: three views of three models.
good_evaluation() {
  good "$1" 27 "$sentence" "$verdict" "plot Message: Bits, model.cmk: 2 points, 16 dots" "plot Message: Bits, unmarked.cmk( [(]unmarked[)])?: 2 points, 16 dots" \
    "row features, extents, offsets \\| .*[0-9].*" "row model.cmk \| hac \| $bytes \| .*"
}
good_evaluation "$scratch/evaluate.html" || { cat "$scratch/facts.txt"; exit 1; }

# Controls: each way of spoiling a page is seen.
spoilt() { # <check> <page> <sed's command>
  sed "$3" "$2" >"$scratch/spoilt.html"
  if cmp -s "$2" "$scratch/spoilt.html"; then echo "nothing was spoilt: $3"; exit 1; fi
  if "$1" "$scratch/spoilt.html" >"$scratch/said.txt"; then echo "not seen: $3"; exit 1; fi
}
for page in "good_run $run/report.html" "good_evaluation $scratch/evaluate.html"; do
  # shellcheck disable=SC2086 # two words
  set -- $page
  spoilt "$1" "$2" 's|src="data:image/png;base64,.....|src="data:image/png;base64,AAAAA|' # a picture that is none
  spoilt "$1" "$2" 's|</body>|<script>undefined_function();</script></body>|'
  grep -q undefined_function "$scratch/said.txt" || { echo "the failing script was not the reason"; exit 1; }
  spoilt "$1" "$2" 's|so likely a key drawn at random||g' # of every model
done
spoilt good_run "$run/report.html" '/class="views"/d'
spoilt good_run "$run/report.html" 's| points="[^"]*"||g'
spoilt good_run "$run/report.html" "s|<td class=\"n\">$bytes</td>|<td class=\"n\">1</td>|"
spoilt good_run "$run/report.html" 's|unmarked/report.html|other.html|g'
spoilt good_evaluation "$scratch/evaluate.html" 's|<circle[^>]*>||g'
echo "$(wc -l <"$scratch/facts.txt" | tr -d ' ') facts of the last page"
