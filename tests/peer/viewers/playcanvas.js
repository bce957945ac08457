// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// A page of the PlayCanvas engine, the renderer of SuperSplat: splats are sorted by depth, stored without rounding
// where it can, none is left out for being small, and colours are those of this very camera. A glTF file is opened as
// one.
import * as pc from "playcanvas";
import { ZSTDDecoder } from "three/addons/libs/zstddec.module.js";
import { SpzParser } from "playcanvas/scripts/esm/parsers/spz-parser.mjs";

export async function open({ url, name, width, height, angle, background, turn, options }) {
  const canvas = document.createElement("canvas");
  document.body.append(canvas);
  const app = new pc.Application(canvas, { graphicsDeviceOptions: { antialias: false, alpha: false } });
  app.setCanvasFillMode(pc.FILLMODE_NONE, width, height);
  app.setCanvasResolution(pc.RESOLUTION_FIXED, width, height);
  app.graphicsDevice.maxPixelRatio = 1;
  app.autoRender = false;
  const splats = app.scene.gsplat;
  if (!options.plain) {
    Object.assign(splats, { radialSorting: false, minPixelSize: 0, minContribution: 0, alphaClipForward: 1 / 255, antiAlias: false,
                            colorUpdateAngle: 0, splatBudget: 0, dataFormat: pc.GSPLATDATA_LARGE });
    // Its variances are in quarters of a pixel's square, so that its 0.3 are 0.075 of everybody else's; and it bends
    // the bell so that it ends at 0.
    const chunks = pc.ShaderChunks.get(app.graphicsDevice, pc.SHADERLANGUAGE_GLSL);
    const corner = chunks.get("gsplatCornerVS").replaceAll("+ 0.3", "+ 1.2");
    const bell = chunks.get("gsplatPS").replace(/(float normExp[^{]*\{)/, "$1 return exp(x * -4.0);");
    if (options.classic) chunks.set("gsplatCornerVS", corner).set("gsplatPS", bell);
  }
  for (const key of Object.keys(options)) if (key !== "plain" && key !== "classic") splats[key] = JSON.parse(options[key]);
  // It leaves to the page which Zstandard unpacks an SPZ file.
  const zstd = new ZSTDDecoder();
  await zstd.init();
  window.ZstdDecoderModule = async () => ({ decompress: (bytes, size) => zstd.decode(bytes, size) });
  pc.WasmModule.setConfig("ZstdDecoderModule", { glueUrl: "data:text/javascript,", wasmUrl: "data:," });
  app.loader.getHandler("gsplat").addParser(new SpzParser(app));
  app.start();
  const glb = name.endsWith(".glb");
  const asset = new pc.Asset(name, glb ? "container" : "gsplat", { url, filename: name });
  app.assets.add(asset);
  await new Promise((done, failed) => {
    asset.once("load", done);
    asset.once("error", (why) => failed(new Error(String(why))));
    app.assets.load(asset);
  });
  const seen = new pc.Entity();
  seen.addComponent("gsplat", { asset: glb ? asset.resource.gsplats[0] : asset });
  if (turn === "x") seen.setLocalEulerAngles(180, 0, 0);
  app.root.addChild(seen);
  const camera = new pc.Entity();
  camera.addComponent("camera", { clearColor: new pc.Color().fromString("#" + background), nearClip: 0.01, farClip: 1000, toneMapping: pc.TONEMAP_NONE,
                                  fov: (360 / Math.PI) * Math.atan((Math.tan(angle / 2) * height) / width), horizontalFov: false });
  app.root.addChild(camera);
  let ready = false;
  const system = app.systems.gsplat;
  system?.on("frame:ready", (_camera, _layer, whole, loading) => (ready = whole && !loading));
  const gl = app.graphicsDevice.gl;
  return {
    count: (glb ? asset.resource.gsplats[0].resource : asset.resource).numSplats,
    async show(matrix) {
      const columns = new pc.Mat4();
      for (let i = 0; i < 16; ++i) columns.data[i] = matrix[(i % 4) * 4 + (i >> 2)];
      camera.setPosition(columns.getTranslation());
      camera.setRotation(new pc.Quat().setFromMat4(columns));
      for (let frames = 0, still = 0; still < 2 && frames < 60; ++frames, still = ready ? still + 1 : 0) {
        ready = false;
        app.renderNextFrame = true;
        await new Promise((done) => app.once("frameend", done));
        gl.readPixels(0, 0, 1, 1, gl.RGBA, gl.UNSIGNED_BYTE, new Uint8Array(4));
        await new Promise((done) => setTimeout(done, 300)); // its worker sorts
      }
    },
  };
}
