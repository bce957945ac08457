// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// A page of Spark, with the options that make it draw as 3DGS was defined ("classic"): 0.3 pixels are added to a
// variance and opacity is not lowered for it, splats are sorted by depth, cut where they fall below 1/255, and stored
// without rounding. Of what Spark does not know other libraries make what it knows, where `through` says so.
import createSpzModule from "@adobe/spz";
import { SparkRenderer, SplatMesh } from "@sparkjsdev/spark";
import * as THREE from "three";
import { GLTFLoader } from "three/addons/loaders/GLTFLoader.js";

// The bytes of an SPZ file of version 4 as one of version 3, by the library of Adobe.
async function olderSpz(bytes) {
  const spz = await createSpzModule();
  const frame = spz.CoordinateSystem.RUB; // that of the files: nothing is turned
  return spz.saveSpzToBuffer(spz.loadSpzFromBuffer(bytes, { to: frame }), { version: 3, from: frame, sh1Bits: 8, shRestBits: 8 });
}

// The splats that the glTF loader of three.js finds in a GLB file, as the bytes of a PLY file.
async function plyOfGlb(url) {
  let points;
  (await new GLTFLoader().loadAsync(url)).scene.traverse((one) => { if (one.isPoints) points = one.geometry; });
  const of = (semantic) => points.getAttribute("khr_gaussian_splatting:" + semantic);
  const columns = [], add = (name, attribute, item, as = (value) => value) => columns.push([name, (i) => as(attribute.getComponent(i, item))]);
  for (const item of [0, 1, 2]) add("xyz"[item], points.getAttribute("position"), item);
  for (const item of [0, 1, 2]) add("f_dc_" + item, of("sh_degree_0_coef_0"), item);
  const rest = [1, 2, 3].flatMap((degree) => [...Array(2 * degree + 1).keys()].map((k) => of(`sh_degree_${degree}_coef_${k}`))).filter(Boolean);
  for (const item of [0, 1, 2]) rest.forEach((attribute, k) => add("f_rest_" + (item * rest.length + k), attribute, item));
  add("opacity", of("opacity"), 0, (value) => Math.log(value / (1 - Math.min(value, 1 - 1e-7))));
  for (const item of [0, 1, 2]) add("scale_" + item, of("scale"), item, Math.log);
  for (const item of [0, 1, 2, 3]) add("rot_" + item, of("rotation"), (item + 3) % 4); // glTF has w last
  const count = points.getAttribute("position").count, values = new Float32Array(count * columns.length);
  columns.forEach(([, value], column) => { for (let i = 0; i < count; ++i) values[i * columns.length + column] = value(i); });
  const header = `ply\nformat binary_little_endian 1.0\nelement vertex ${count}\n${columns.map(([name]) => `property float ${name}\n`).join("")}end_header\n`;
  return new Uint8Array(await new Blob([header, values]).arrayBuffer());
}

export async function open({ url, name, width, height, angle, background, turn, options }) {
  const renderer = new THREE.WebGLRenderer({ antialias: false });
  renderer.setPixelRatio(1);
  renderer.setSize(width, height);
  renderer.setClearColor(new THREE.Color("#" + background), 1);
  document.body.append(renderer.domElement);
  const scene = new THREE.Scene();
  const camera = new THREE.PerspectiveCamera((360 / Math.PI) * Math.atan((Math.tan(angle / 2) * height) / width), width / height, 0.01, 1000);
  camera.matrixAutoUpdate = false;
  const classic = options.plain ? {} : { preBlurAmount: 0.3, blurAmount: 0, maxStdDev: 3.33, minAlpha: 1 / 255, sortRadial: false, accumExtSplats: true };
  for (const key of Object.keys(options)) if (!["plain", "ext", "through"].includes(key)) classic[key] = JSON.parse(options[key]);
  const spark = new SparkRenderer({ renderer, enableLod: false, ...classic });
  scene.add(spark);
  let fileBytes = options.through === "three" ? await plyOfGlb(url) : new Uint8Array(await (await fetch(url)).arrayBuffer());
  if (options.through === "adobe") fileBytes = await olderSpz(fileBytes);
  const mesh = new SplatMesh({ fileBytes, fileName: options.through === "three" ? "splats.ply" : name, extSplats: !options.plain && options.ext !== "false" });
  if (turn === "x") mesh.quaternion.set(1, 0, 0, 0);
  scene.add(mesh);
  await mesh.initialized;
  const gl = renderer.getContext();
  const frame = () => new Promise((done) => requestAnimationFrame(done));
  return {
    count: (mesh.splats ?? mesh.packedSplats).getNumSplats(),
    async show(matrix) {
      camera.matrix.set(...matrix);
      camera.updateMatrixWorld(true);
      // A picture in software takes seconds, and those that nobody waits for queue up.
      for (let still = 0; still < 2; still = spark.sortDirty ? 0 : still + 1) {
        renderer.render(scene, camera);
        gl.readPixels(0, 0, 1, 1, gl.RGBA, gl.UNSIGNED_BYTE, new Uint8Array(4));
        await frame();
        while (spark.sorting) await new Promise((done) => setTimeout(done, 20));
      }
      await frame();
    },
  };
}
