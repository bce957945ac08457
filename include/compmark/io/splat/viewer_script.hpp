// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// The page of viewer_page.hpp without its splats: style, WebGL 2 shaders and the script that draws and is dragged. It is
// text of three parts, so that no literal is longer than a compiler has to take. The formulas are those of the library's
// rasterizer (docs/spec/method.md, 2): the ellipse of a Gaussian by the Jacobian of the projection, 0.3 pixels^2 added,
// alpha = min(.99, o exp(-d^2 / 2)), none below 1/255; colour by spherical harmonics of degree 0 to 3. What differs: the
// order is by 65,536 steps of depth, and the picture is a half-precision one where the browser draws into those.
#pragma once

#include <string_view>

namespace compmark::detail {

inline constexpr std::string_view viewer_style = R"html(<style>
html,body{margin:0;height:100%;background:#000;overflow:hidden;font:13px/1.5 system-ui,sans-serif;color:#ddd}
canvas{display:block;touch-action:none;cursor:grab}
#said{position:fixed;left:10px;bottom:8px;text-shadow:0 0 3px #000;pointer-events:none}
body.plain #said{display:none}
</style>
<canvas id="view"></canvas><div id="said"></div>
)html";

inline constexpr std::string_view viewer_shaders = R"html(<script id="vertex" type="x-shader">#version 300 es
precision highp float; precision highp int; precision highp sampler2D;
uniform sampler2D places, shapes, colors;
uniform mat3 turn; uniform vec3 eye; uniform vec2 focal, size, middle; uniform float near; uniform int coefficients;
in vec2 corner; in uint splat;
out vec2 offset; out vec4 tint;
vec4 at(sampler2D table, int i) {
  int width = textureSize(table, 0).x;
  return texelFetch(table, ivec2(i % width, i / width), 0);
}
void main() {
  int i = int(splat);
  gl_Position = vec4(2, 2, 2, 1);
  offset = vec2(0); tint = vec4(0);
  vec4 place = at(places, i);
  vec3 away = place.xyz - eye, p = turn * away;
  if (p.z < near || place.w < 1.0 / 255.0) return;
  vec4 a = at(shapes, 2 * i), b = at(shapes, 2 * i + 1);
  mat3 world = mat3(a.x, a.y, a.z, a.y, a.w, b.x, a.z, b.x, b.y);
  vec2 low = -(middle + 0.15 * size) / focal, high = (1.15 * size - middle) / focal;
  vec2 t = clamp(p.xy / p.z, low, high) * p.z;
  mat3 jacobian = mat3(focal.x / p.z, 0, 0, 0, focal.y / p.z, 0,
                       -focal.x * t.x / (p.z * p.z), -focal.y * t.y / (p.z * p.z), 0);
  mat3 through = jacobian * turn, image = through * world * transpose(through);
  float xx = image[0][0] + 0.3, xy = image[0][1], yy = image[1][1] + 0.3;
  float half_sum = 0.5 * (xx + yy), reach = length(vec2(0.5 * (xx - yy), xy));
  float major = half_sum + reach, minor = max(half_sum - reach, 0.0);
  if (!(major < 1e9)) return;
  vec2 axis = abs(xy) > 1e-6 * major ? normalize(vec2(xy, major - xx)) : xx >= yy ? vec2(1, 0) : vec2(0, 1);
  offset = corner * sqrt(2.0 * log(255.0 * place.w));
  vec2 pixel = middle + focal * p.xy / p.z + offset.x * sqrt(major) * axis + offset.y * sqrt(minor) * vec2(-axis.y, axis.x);
  gl_Position = vec4(2.0 * pixel.x / size.x - 1.0, 1.0 - 2.0 * pixel.y / size.y, 0, 1);
  vec3 d = normalize(away);
  float x = d.x, y = d.y, z = d.z;
  float Y[16] = float[16](0.28209479177387814, -0.4886025119029199 * y, 0.4886025119029199 * z, -0.4886025119029199 * x,
    1.0925484305920792 * x * y, -1.0925484305920792 * y * z, 0.31539156525252005 * (2.0 * z * z - x * x - y * y),
    -1.0925484305920792 * x * z, 0.5462742152960396 * (x * x - y * y), -0.5900435899266435 * y * (3.0 * x * x - y * y),
    2.890611442640554 * x * y * z, -0.4570457994644658 * y * (4.0 * z * z - x * x - y * y),
    0.3731763325901154 * z * (2.0 * z * z - 3.0 * x * x - 3.0 * y * y), -0.4570457994644658 * x * (4.0 * z * z - x * x - y * y),
    1.445305721320277 * z * (x * x - y * y), -0.5900435899266435 * x * (x * x - 3.0 * y * y));
  vec3 color = vec3(0.5);
  for (int k = 0; k < coefficients; ++k) color += Y[k] * at(colors, coefficients * i + k).rgb;
  tint = vec4(max(color, 0.0), place.w);
}
</script>
<script id="fragment" type="x-shader">#version 300 es
precision highp float;
in vec2 offset; in vec4 tint; out vec4 color;
void main() {
  float alpha = min(0.99, tint.a * exp(-0.5 * dot(offset, offset)));
  if (alpha < 1.0 / 255.0) discard;
  color = vec4(tint.rgb * alpha, alpha);
}
</script>
<script id="copy" type="x-shader">#version 300 es
precision highp float; precision highp sampler2D;
uniform sampler2D picture; uniform vec3 background; out vec4 color;
void main() {
  vec4 seen = texelFetch(picture, ivec2(gl_FragCoord.xy), 0);
  color = vec4(clamp(seen.rgb + (1.0 - seen.a) * background, 0.0, 1.0), 1);
}
</script>
<script id="whole" type="x-shader">#version 300 es
in vec2 corner;
void main() { gl_Position = vec4(corner, 0, 1); }
</script>
)html";

inline constexpr std::string_view viewer_script = R"html(<script>
"use strict";
const scene = JSON.parse(document.getElementById("scene").textContent), count = scene.count, K = scene.coefficients;
const raw = Uint8Array.from(atob(document.getElementById("splats").textContent.trim()), c => c.charCodeAt(0));
document.getElementById("splats").remove();
const floats = new Float32Array(raw.buffer, 0, 11 * count), bytes = new Uint8Array(raw.buffer, 44 * count);
const canvas = document.getElementById("view"), gl = canvas.getContext("webgl2", {antialias: false, alpha: false});
const said = document.getElementById("said");
if (!gl) said.textContent = "This browser has no WebGL 2, which draws the splats.";

function program(vertex, fragment) {
  const made = gl.createProgram();
  for (const [kind, id] of [[gl.VERTEX_SHADER, vertex], [gl.FRAGMENT_SHADER, fragment]]) {
    const shader = gl.createShader(kind);
    gl.shaderSource(shader, document.getElementById(id).textContent);
    gl.compileShader(shader);
    if (!gl.getShaderParameter(shader, gl.COMPILE_STATUS)) throw new Error(id + ": " + gl.getShaderInfoLog(shader));
    gl.attachShader(made, shader);
  }
  gl.bindAttribLocation(made, 0, "corner");
  gl.bindAttribLocation(made, 1, "splat");
  gl.linkProgram(made);
  if (!gl.getProgramParameter(made, gl.LINK_STATUS)) throw new Error(gl.getProgramInfoLog(made));
  return made;
}
// Rows of 4 numbers as a texture, as wide as every WebGL 2 has it.
function table(unit, inside, rows, values) {
  const width = 2048, height = Math.max(1, Math.ceil(rows / width)), all = new Float32Array(4 * width * height);
  all.set(values);
  gl.activeTexture(gl.TEXTURE0 + unit);
  gl.bindTexture(gl.TEXTURE_2D, gl.createTexture());
  gl.texParameteri(gl.TEXTURE_2D, gl.TEXTURE_MIN_FILTER, gl.NEAREST);
  gl.texParameteri(gl.TEXTURE_2D, gl.TEXTURE_MAG_FILTER, gl.NEAREST);
  gl.texImage2D(gl.TEXTURE_2D, 0, inside, width, height, 0, gl.RGBA, gl.FLOAT, all);
}
const places = new Float32Array(4 * count), shapes = new Float32Array(8 * count), colors = new Float32Array(4 * K * count);
for (let i = 0; i < count; ++i) {
  const f = floats.subarray(11 * i, 11 * i + 11), [w, x, y, z] = f.subarray(6, 10);
  places.set([f[0], f[1], f[2], f[10]], 4 * i);
  const r = [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y), 2 * (x * y + w * z), 1 - 2 * (x * x + z * z),
             2 * (y * z - w * x), 2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)];
  const v = (a, b) => [0, 1, 2].reduce((sum, k) => sum + r[3 * a + k] * r[3 * b + k] * f[3 + k] * f[3 + k], 0);
  shapes.set([v(0, 0), v(0, 1), v(0, 2), v(1, 1), v(1, 2), v(2, 2), 0, 0], 8 * i);
  for (let k = 0; k < K; ++k) {
    for (let c = 0; c < 3; ++c) {
      const at = 3 * (K * i + k) + c, low = scene.low[k], high = scene.high[k];
      colors[4 * (K * i + k) + c] = low + (high - low) * (bytes[2 * at] + 256 * bytes[2 * at + 1]) / 65535;
    }
  }
}
const draw = program("vertex", "fragment"), show = program("whole", "copy");
table(0, gl.RGBA32F, count, places);
table(1, gl.RGBA32F, 2 * count, shapes);
table(2, gl.RGBA16F, K * count, colors);
gl.useProgram(draw);
["places", "shapes", "colors"].forEach((name, unit) => gl.uniform1i(gl.getUniformLocation(draw, name), unit));
const fine = gl.getExtension("EXT_color_buffer_float"), picture = gl.createTexture(), target = gl.createFramebuffer();

const square = gl.createBuffer(), order = gl.createBuffer(), sorted = new Uint32Array(count);
gl.bindBuffer(gl.ARRAY_BUFFER, square);
gl.bufferData(gl.ARRAY_BUFFER, new Float32Array([-1, -1, 1, -1, -1, 1, 1, 1]), gl.STATIC_DRAW);
gl.enableVertexAttribArray(0);
gl.vertexAttribPointer(0, 2, gl.FLOAT, false, 0, 0);
gl.bindBuffer(gl.ARRAY_BUFFER, order);
gl.enableVertexAttribArray(1);
gl.vertexAttribIPointer(1, 1, gl.UNSIGNED_INT, 0, 0);

const depths = new Float32Array(count), steps = new Uint32Array(65537);
function sort(turn, eye) {  // farthest first
  let least = Infinity, most = -Infinity;
  for (let i = 0; i < count; ++i) {
    const d = turn[6] * (places[4 * i] - eye[0]) + turn[7] * (places[4 * i + 1] - eye[1]) + turn[8] * (places[4 * i + 2] - eye[2]);
    depths[i] = d;
    if (d > 0) { least = Math.min(least, d); most = Math.max(most, d); }
  }
  const scale = 65535 / Math.max(most - least, 1e-30);
  const step = i => 65535 - Math.min(65535, Math.max(0, Math.floor((depths[i] - least) * scale)));
  steps.fill(0);
  for (let i = 0; i < count; ++i) ++steps[step(i) + 1];
  for (let s = 0; s < 65536; ++s) steps[s + 1] += steps[s];
  for (let i = 0; i < count; ++i) sorted[steps[step(i)]++] = i;
  gl.bindBuffer(gl.ARRAY_BUFFER, order);
  gl.bufferData(gl.ARRAY_BUFFER, sorted, gl.DYNAMIC_DRAW);
}

// A camera of the library: rows of the rotation are right, down and ahead.
let camera = null, background = [0, 0, 0], wanted = false;
function paint() {
  wanted = false;
  const {turn, eye, focal, middle, width, height} = camera;
  if (canvas.width !== width || canvas.height !== height) {
    canvas.width = width;
    canvas.height = height;
  }
  gl.activeTexture(gl.TEXTURE3);
  gl.bindTexture(gl.TEXTURE_2D, picture);
  gl.texImage2D(gl.TEXTURE_2D, 0, fine ? gl.RGBA16F : gl.RGBA8, width, height, 0, gl.RGBA, fine ? gl.FLOAT : gl.UNSIGNED_BYTE, null);
  gl.texParameteri(gl.TEXTURE_2D, gl.TEXTURE_MIN_FILTER, gl.NEAREST);
  gl.texParameteri(gl.TEXTURE_2D, gl.TEXTURE_MAG_FILTER, gl.NEAREST);
  gl.bindFramebuffer(gl.FRAMEBUFFER, target);
  gl.framebufferTexture2D(gl.FRAMEBUFFER, gl.COLOR_ATTACHMENT0, gl.TEXTURE_2D, picture, 0);
  gl.viewport(0, 0, width, height);
  gl.clearColor(0, 0, 0, 0);
  gl.clear(gl.COLOR_BUFFER_BIT);
  sort(turn, eye);
  gl.useProgram(draw);
  const set = (name, kind, ...values) => gl["uniform" + kind](gl.getUniformLocation(draw, name), ...values);
  gl.uniformMatrix3fv(gl.getUniformLocation(draw, "turn"), true, turn);
  set("eye", "3fv", eye); set("focal", "2fv", focal); set("middle", "2fv", middle); set("size", "2f", width, height);
  set("near", "1f", scene.near); set("coefficients", "1i", K);
  gl.enable(gl.BLEND);
  gl.blendFunc(gl.ONE, gl.ONE_MINUS_SRC_ALPHA);
  gl.vertexAttribDivisor(1, 1);
  gl.drawArraysInstanced(gl.TRIANGLE_STRIP, 0, 4, count);
  gl.bindFramebuffer(gl.FRAMEBUFFER, null);
  gl.disable(gl.BLEND);
  gl.useProgram(show);
  gl.uniform1i(gl.getUniformLocation(show, "picture"), 3);
  gl.uniform3fv(gl.getUniformLocation(show, "background"), background);
  gl.drawArrays(gl.TRIANGLE_STRIP, 0, 4);
}
const repaint = () => { if (!wanted) { wanted = true; requestAnimationFrame(paint); } };

// Round the middle of the scene, by the mouse, fingers or arrow keys.
const add = (a, b, s) => a.map((x, i) => x + s * b[i]), dot = (a, b) => a.reduce((sum, x, i) => sum + x * b[i], 0);
const cross = (a, b) => [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]];
const unit = a => a.map(x => x / Math.hypot(...a));
let look = scene.center.slice(), azimuth = 0.6, elevation = 0.4, distance = scene.distance;
function orbit() {
  const up = scene.up, first = Math.abs(up[2]) < 0.9 ? [0, 0, -1] : [1, 0, 0];
  const ahead = unit(add(first, up, -dot(first, up))), aside = cross(ahead, up), c = Math.cos(elevation);
  const away = add(add(up.map(x => x * Math.sin(elevation)), ahead, c * Math.cos(azimuth)), aside, c * Math.sin(azimuth));
  const forward = away.map(x => -x), right = unit(cross(forward, up)), down = cross(forward, right);
  const ratio = window.devicePixelRatio || 1, width = Math.max(1, Math.round(innerWidth * ratio)), height = Math.max(1, Math.round(innerHeight * ratio));
  canvas.style.width = innerWidth + "px";
  canvas.style.height = innerHeight + "px";
  const f = Math.min(width, height) / 2 / Math.tan(25 * Math.PI / 180);
  camera = {turn: [...right, ...down, ...forward], eye: add(look, away, distance), focal: [f, f], middle: [width / 2, height / 2], width, height};
  repaint();
}
function drag(dx, dy, moves) {
  if (moves) {
    const s = distance / camera.focal[0], t = camera.turn;
    look = add(add(look, t.slice(0, 3), -dx * s), t.slice(3, 6), -dy * s);
  } else {
    azimuth -= dx * 0.006;
    elevation = Math.max(-1.5, Math.min(1.5, elevation + dy * 0.006));
  }
  orbit();
}
canvas.addEventListener("pointermove", e => { if (e.buttons) drag(e.movementX, e.movementY, e.buttons !== 1 || e.shiftKey); });
canvas.addEventListener("wheel", e => { e.preventDefault(); distance *= Math.exp(e.deltaY * 0.001); orbit(); }, {passive: false});
canvas.addEventListener("contextmenu", e => e.preventDefault());
addEventListener("resize", () => location.hash.startsWith("#camera") || orbit());
addEventListener("keydown", e => {
  const by = {ArrowLeft: [-20, 0], ArrowRight: [20, 0], ArrowUp: [0, -20], ArrowDown: [0, 20]}[e.key];
  if (by) drag(...by, e.shiftKey);
  if (e.key === "+" || e.key === "-") { distance *= e.key === "+" ? 0.9 : 1.1; orbit(); }
  if (e.key === "b") { background = background.map(x => (x + 0.5) % 1.5); repaint(); }
});
// #camera=3 is the fourth of the cameras in the page, pixel by pixel; #background=ff8800 a colour behind the splats.
function begin() {
  const asked = Object.fromEntries(location.hash.slice(1).split("&").map(part => part.split("=")));
  if (/^[0-9a-f]{6}$/i.test(asked.background || "")) background = [0, 2, 4].map(at => parseInt(asked.background.substr(at, 2), 16) / 255);
  const stored = scene.cameras[Number(asked.camera)];
  if (!stored) { orbit(); return; }
  camera = stored;
  canvas.style.width = stored.width + "px";
  canvas.style.height = stored.height + "px";
  document.body.className = "plain";
  paint();
}
addEventListener("hashchange", begin);
said.textContent = scene.title + ": " + count.toLocaleString("en") + " splats. Drag to turn, right button to move, wheel to come nearer, b for the background.";
begin();
</script>
)html";

}  // namespace compmark::detail
