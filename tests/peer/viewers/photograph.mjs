// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// Opens a splat file in somebody else's viewer, in a Chromium without a screen, and photographs the page at cameras
// of ours:
//  node photograph.mjs <browser> <node_modules> <viewer> <file> <cameras.json> <width> <height> <folder> [key=value]...
// <viewer> is spark, babylon, gaussian_splats_3d, playcanvas or three: a module beside this file, which uses what the
// npm package exports and nothing else. <cameras.json> is of Blender's kind (camera_angle_x, transform_matrix). Pictures are
// called as the frames' files are. background=RRGGBB; turn=x: the file is turned by half a circle round x, for
// formats with y up; views=N: the first so many; any other key goes to the viewer as an option. Exit status 2: the
// viewer said no, and why is on the last line.
import { spawn } from "node:child_process";
import { createReadStream, mkdirSync, mkdtempSync, readFileSync, rmSync, statSync, writeFileSync } from "node:fs";
import { createServer } from "node:http";
import { tmpdir } from "node:os";
import { basename, dirname, extname, join, normalize } from "node:path";
import { fileURLToPath } from "node:url";

const [browser, modules, viewer, file, cameras, width, height, folder, ...settings] = process.argv.slice(2);
const here = dirname(fileURLToPath(import.meta.url));
const given = Object.fromEntries(settings.map((setting) => setting.split("=")));
const { background = "000000", turn = "", views = "1000000", ...options } = given;
const scene = JSON.parse(readFileSync(cameras, "utf8"));
const frames = scene.frames.slice(0, Number(views));
const name = basename(file);

// What the page may ask for: itself, the viewers' packages, our modules and the file.
const imports = {
  three: "/modules/three/build/three.module.js",
  "three/webgpu": "/modules/three/build/three.webgpu.js",
  "three/tsl": "/modules/three/build/three.tsl.js",
  "three/addons/": "/modules/three/examples/jsm/",
  "@sparkjsdev/spark": "/modules/@sparkjsdev/spark/dist/spark.module.js",
  "@mkkellogg/gaussian-splats-3d": "/modules/@mkkellogg/gaussian-splats-3d/build/gaussian-splats-3d.module.js",
  playcanvas: "/modules/playcanvas/build/playcanvas.mjs",
  "playcanvas/": "/modules/playcanvas/",
  "@adobe/spz": "/modules/@adobe/spz/dist/spz.js",
  "@babylonjs/": "/modules/@babylonjs/",
};
const task = { url: "/splats/" + name, name, width: Number(width), height: Number(height), angle: scene.camera_angle_x, background, turn, options };
const page = `<!doctype html><meta charset="utf-8"><style>html,body{margin:0;overflow:hidden;background:#${background}}canvas{display:block}</style><body>
<script type="importmap">${JSON.stringify({ imports })}</script>
<script type="module">
import { open } from "/ours/${viewer}.js";
window.ready = open(${JSON.stringify(task)});
window.ready.catch(() => {});
</script></body>`;
const kinds = { ".js": "text/javascript", ".mjs": "text/javascript", ".wasm": "application/wasm", ".json": "application/json" };
const server = createServer((request, response) => {
  const path = normalize(decodeURIComponent(new URL(request.url, "http://page").pathname));
  // Alone with itself, as memory that is shared with a worker demands.
  const head = { "Cross-Origin-Opener-Policy": "same-origin", "Cross-Origin-Embedder-Policy": "require-corp" };
  if (path === "/") return response.writeHead(200, { ...head, "Content-Type": "text/html" }).end(page);
  const from = path === task.url ? file
    : path.startsWith("/modules/") ? join(modules, path.slice("/modules/".length))
      : path.startsWith("/ours/") ? join(here, path.slice("/ours/".length)) : "";
  try {
    const length = statSync(from).size;
    response.writeHead(200, { ...head, "Content-Type": kinds[extname(from)] ?? "application/octet-stream", "Content-Length": length });
    createReadStream(from).pipe(response);
  } catch {
    response.writeHead(404, head).end();
  }
});
await new Promise((done) => server.listen(0, "127.0.0.1", done));

// The browser is spoken to through a pipe: messages of the DevTools protocol, each ended by a zero.
const profile = mkdtempSync(join(tmpdir(), "viewer-"));
const chromium = spawn(browser, ["--headless", "--no-sandbox", "--use-angle=swiftshader", "--enable-unsafe-swiftshader", "--hide-scrollbars",
  "--force-color-profile=srgb", "--force-device-scale-factor=1", `--window-size=${width},${height}`, `--user-data-dir=${profile}`,
  "--remote-debugging-pipe", "about:blank"], { stdio: ["ignore", "ignore", "ignore", "pipe", "pipe"] });
const waiting = new Map(), said = [];
let last = 0, rest = "", session;
chromium.stdio[4].setEncoding("utf8").on("data", (text) => {
  const messages = (rest + text).split("\0");
  rest = messages.pop();
  for (const message of messages.map((one) => JSON.parse(one))) {
    if (waiting.has(message.id)) {
      const [kept, refused] = waiting.get(message.id);
      waiting.delete(message.id);
      message.error ? refused(new Error(message.error.message)) : kept(message.result);
    } else if (message.method === "Runtime.exceptionThrown") {
      const { text: what, exception } = message.params.exceptionDetails;
      said.push(exception?.description ?? what);
    } else if (message.method === "Runtime.consoleAPICalled" && message.params.type === "error") {
      said.push(message.params.args.map((one) => one.value ?? one.description).join(" "));
    }
  }
});
const ask = (method, params = {}) => new Promise((kept, refused) => {
  waiting.set(++last, [kept, refused]);
  chromium.stdio[3].write(JSON.stringify({ id: last, method, params, sessionId: session }) + "\0");
});
const end = (status, line) => {
  if (line) console.log(line);
  chromium.once("exit", () => {
    rmSync(profile, { recursive: true, force: true, maxRetries: 5, retryDelay: 100 });
    process.exit(status);
  });
  ask("Browser.close").catch(() => {});
  setTimeout(() => chromium.kill(), 5000).unref();
};
chromium.once("error", (error) => { console.log(`${browser}: ${error.message}`); process.exit(1); });
setTimeout(() => end(1, "the page took longer than ten minutes"), 600000).unref();

const evaluate = async (expression) => {
  const { exceptionDetails, result } = await ask("Runtime.evaluate", { expression, awaitPromise: true, returnByValue: true });
  if (exceptionDetails) throw new Error(exceptionDetails.exception?.description ?? exceptionDetails.exception?.value ?? exceptionDetails.text);
  return result.value;
};
const photograph = async () => Buffer.from((await ask("Page.captureScreenshot", { format: "png", captureBeyondViewport: false,
  clip: { x: 0, y: 0, width: Number(width), height: Number(height), scale: 1 } })).data, "base64");
try {
  const { targetId } = await ask("Target.createTarget", { url: "about:blank" });
  session = (await ask("Target.attachToTarget", { targetId, flatten: true })).sessionId;
  await ask("Runtime.enable");
  await ask("Page.enable");
  await ask("Emulation.setDeviceMetricsOverride", { width: Number(width), height: Number(height), deviceScaleFactor: 1, mobile: false });
  await ask("Page.navigate", { url: `http://127.0.0.1:${server.address().port}/` });
  for (let i = 0; i < 600 && !(await evaluate("!!window.ready")); ++i) {
    if (said.length) throw new Error(said[0]);
    await new Promise((done) => setTimeout(done, 100));
  }
  const count = await evaluate("ready.then((opened) => opened.count)");
  mkdirSync(folder, { recursive: true });
  for (const frame of frames) {
    await evaluate(`ready.then((opened) => opened.show(${JSON.stringify(frame.transform_matrix.flat())}))`);
    // The page is still when two photographs are alike.
    let seen = await photograph(), before;
    do {
      before = seen;
      await evaluate("new Promise((done) => setTimeout(() => requestAnimationFrame(() => requestAnimationFrame(done)), 150))");
      seen = await photograph();
    } while (!seen.equals(before));
    writeFileSync(join(folder, basename(frame.file_path, ".png") + ".png"), seen);
  }
  end(said.length ? 2 : 0, said.length ? said[0].split("\n")[0] : `${count} splats, ${frames.length} pictures`);
} catch (error) {
  end(2, [...said, error.message].join(" | ").replaceAll("\n", " "));
}
