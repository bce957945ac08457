// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// A page of Babylon.js, with the options that make it draw as 3DGS was defined: its variances are of doubled scales,
// so that its `kernelSize` of 1.2 is everybody else's 0.3; splats are sorted by their depths, not by classes of them,
// at every camera; SOG is decoded where it is drawn, without rounding.
import { FreeCamera } from "@babylonjs/core/Cameras/freeCamera.js";
import { Engine } from "@babylonjs/core/Engines/engine.js";
import { ImportMeshAsync } from "@babylonjs/core/Loading/sceneLoader.js";
import { GaussianSplattingMaterial } from "@babylonjs/core/Materials/GaussianSplatting/gaussianSplattingMaterial.js";
import { Color4 } from "@babylonjs/core/Maths/math.color.js";
import { Matrix, Quaternion, Vector3 } from "@babylonjs/core/Maths/math.vector.js";
import { GaussianSplattingMeshBase } from "@babylonjs/core/Meshes/GaussianSplatting/gaussianSplattingMeshBase.js";
import { Scene } from "@babylonjs/core/scene.js";
import "@babylonjs/loaders/SPLAT/splatFileLoader.js";
import "@babylonjs/loaders/glTF/2.0/Extensions/KHR_gaussian_splatting.js";
import "@babylonjs/loaders/glTF/2.0/glTFLoader.js";
import "@babylonjs/loaders/glTF/glTFFileLoader.js";
import * as fflate from "three/addons/libs/fflate.module.js";

export async function open({ url, name, width, height, angle, background, turn, options }) {
  const canvas = Object.assign(document.createElement("canvas"), { width, height });
  document.body.append(canvas);
  const engine = new Engine(canvas, false, { preserveDrawingBuffer: true, alpha: false });
  const scene = new Scene(engine);
  scene.useRightHandedSystem = true;
  scene.clearColor = Color4.FromHexString("#" + background + "ff");
  const camera = new FreeCamera("camera", Vector3.Zero(), scene);
  Object.assign(camera, { minZ: 0.01, maxZ: 1000, fov: 2 * Math.atan((Math.tan(angle / 2) * height) / width), rotationQuaternion: new Quaternion() });
  if (!options.plain) {
    GaussianSplattingMaterial.KernelSize = JSON.parse(options.kernelSize ?? "1.2");
    GaussianSplattingMeshBase.UseCountingSort = false;
  }
  // Two things it leaves to the page, which would come from a server far away: what unpacks a ZIP, and the SPZ library.
  const splat = { fflate, spzLibraryUrl: new URL("/modules/@adobe/spz/dist/spz.js", location).href, useSogTextures: !options.plain };
  for (const key of Object.keys(options)) if (key !== "plain" && key !== "kernelSize") splat[key] = JSON.parse(options[key]);
  const { meshes } = await ImportMeshAsync(url, scene, { pluginOptions: { splat } });
  const mesh = meshes.find((one) => one instanceof GaussianSplattingMeshBase);
  if (!mesh) throw new Error(name + " has no splats for Babylon.js");
  // The loaders mirror y for Babylon's left-handed world; this one is right-handed, the file's own frame.
  mesh.parent = null;
  mesh.scaling.set(1, 1, 1);
  mesh.rotationQuaternion = turn === "x" ? new Quaternion(1, 0, 0, 0) : new Quaternion();
  if (!options.plain) mesh.viewUpdateThreshold = 0;
  await scene.whenReadyAsync();
  // Of its sort only a getter for its own use tells.
  if (typeof mesh._isDepthSortSettled !== "boolean") throw new Error("this version of Babylon.js does not tell when splats are sorted");
  const gl = canvas.getContext("webgl2");
  return {
    count: mesh.getTotalVertices(),
    async show(matrix) {
      const columns = Matrix.FromArray(matrix).transpose();
      columns.decompose(undefined, camera.rotationQuaternion, camera.position);
      // A picture asks its worker for the order of the next.
      for (let sorted = 0; sorted < 2; ++sorted) {
        scene.render();
        gl.readPixels(0, 0, 1, 1, gl.RGBA, gl.UNSIGNED_BYTE, new Uint8Array(4));
        while (!mesh._isDepthSortSettled) await new Promise((done) => setTimeout(done, 20));
      }
      scene.render();
      gl.readPixels(0, 0, 1, 1, gl.RGBA, gl.UNSIGNED_BYTE, new Uint8Array(4));
      await new Promise((done) => requestAnimationFrame(() => requestAnimationFrame(done)));
    },
  };
}
