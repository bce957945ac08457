#!/bin/sh
# SPDX-FileCopyrightText: 2026 The CompMark authors
# SPDX-License-Identifier: Apache-2.0
#
# Opens an exported page of splats in a browser without a screen and photographs it: the pictures are those that the library renders from the same
# cameras, also with a colour behind the splats; no script complains. A page whose splats are spoilt must fail.
#   viewer.sh <the tool> <picture_distance>
set -eu
tool=$1 distance=$2
. "$(dirname "$0")/browser.sh"
photograph() { # <page> <its part after #> <picture>
  "$browser" --headless --no-sandbox --use-angle=swiftshader --enable-unsafe-swiftshader --hide-scrollbars --window-size=800,800 \
    --virtual-time-budget=30000 --enable-logging=stderr --screenshot="$3" "file://$1#$2" >"$scratch/browser.log" 2>&1
}
cat >"$scratch/works.html" <<'END'
<body style="margin:0;background:#000"><canvas id="c" width="800" height="800"></canvas><script>
const gl = document.getElementById("c").getContext("webgl2");
gl.clearColor(0, 1, 0, 1); gl.clear(gl.COLOR_BUFFER_BIT);</script>
END
if ! photograph "$scratch/works.html" "" "$scratch/works.png" || grep -q 'CONSOLE' "$scratch/browser.log"; then
  echo "skipped: $browser does not draw with WebGL 2 without a screen"
  exit 77
fi

quiet "$tool" scene --out "$scratch/scene" --width 64 --height 64 --train 12 --test 3
quiet "$tool" train --data "$scratch/scene" --out "$scratch/run" --iterations 300 --voxel-size 0.1
quiet "$tool" export --model "$scratch/run/model.safetensors" --out "$scratch/splats.ply" --refine 0 --compare 0
quiet "$tool" export --model "$scratch/splats.ply" --out "$scratch/page.html" --compare 0
quiet "$tool" render --model "$scratch/splats.ply" --out "$scratch/renders"

# as_rendered <page> <camera>: whether the browser's picture is the library's; says the distance in dB.
as_rendered() {
  photograph "$1" "camera=$2" "$scratch/seen.png" || return 1
  if grep 'CONSOLE' "$scratch/browser.log"; then return 1; fi
  decibels=$("$distance" "$scratch/seen.png" "$scratch/renders/around_$(printf %02d "$2").png")
  echo "camera $2: $decibels dB"
  awk -v d="$decibels" 'BEGIN { exit d >= 45 ? 0 : 1 }' # 55 to 62 measured
}
for camera in 0 3 9; do
  as_rendered "$scratch/page.html" $camera || exit 1
done
# Behind the splats: the corner has the colour that was asked for.
photograph "$scratch/page.html" "camera=3&background=336699" "$scratch/blue.png"
"$distance" "$scratch/blue.png" 51 102 153 >"$scratch/corner.txt" || { cat "$scratch/corner.txt"; exit 1; }
# By hand: something is drawn, and nothing complains.
photograph "$scratch/page.html" "" "$scratch/hand.png"
if grep 'CONSOLE' "$scratch/browser.log"; then exit 1; fi
cmp -s "$scratch/hand.png" "$scratch/works.png" && exit 1

# Controls: spoilt splats, and a script that fails, are seen.
sed 's/"high":\[[^]]*\]/"high":[0.1,0.1,0.1,0.1,0.1,0.1,0.1,0.1,0.1,0.1,0.1,0.1,0.1,0.1,0.1,0.1]/' "$scratch/page.html" >"$scratch/spoilt.html"
cmp -s "$scratch/page.html" "$scratch/spoilt.html" && exit 1
if as_rendered "$scratch/spoilt.html" 3; then echo "spoilt colours were not seen"; exit 1; fi
sed 's/uniform sampler2D places/uniform sampler2D other/' "$scratch/page.html" >"$scratch/spoilt.html"
if as_rendered "$scratch/spoilt.html" 3 >"$scratch/said.txt"; then echo "a shader that does not compile was not seen"; exit 1; fi
grep -q 'CONSOLE' "$scratch/said.txt" || { echo "the shader was not the reason"; exit 1; }
