// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// A page of Spark, with the options that make it draw as 3DGS was defined ("classic"): 0.3 pixels are added to a
// variance and opacity is not lowered for it, splats are sorted by depth, cut where they fall below 1/255, and stored
// without rounding.
import { SparkRenderer, SplatMesh } from "@sparkjsdev/spark";
import * as THREE from "three";

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
  for (const key of Object.keys(options)) if (key !== "plain" && key !== "ext") classic[key] = JSON.parse(options[key]);
  const spark = new SparkRenderer({ renderer, enableLod: false, ...classic });
  scene.add(spark);
  const fileBytes = new Uint8Array(await (await fetch(url)).arrayBuffer());
  const mesh = new SplatMesh({ fileBytes, fileName: name, extSplats: !options.plain && options.ext !== "false" });
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
