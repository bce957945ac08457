// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// A page of GaussianSplats3D with everything kept: no splat is left out, nothing is compressed in memory, covariances
// are floats, splats are sorted by floats, and harmonics go to the second degree, which is as far as it goes.
import * as GaussianSplats3D from "@mkkellogg/gaussian-splats-3d";
import * as THREE from "three";

export async function open({ url, name, width, height, angle, background, turn, options }) {
  const renderer = new THREE.WebGLRenderer({ antialias: false });
  renderer.setPixelRatio(1);
  renderer.setSize(width, height);
  renderer.setClearColor(new THREE.Color("#" + background), 1);
  const place = document.createElement("div");
  place.style = `width:${width}px;height:${height}px`;
  document.body.append(place);
  place.append(renderer.domElement);
  const camera = new THREE.PerspectiveCamera((360 / Math.PI) * Math.atan((Math.tan(angle / 2) * height) / width), width / height, 0.01, 1000);
  const everything = options.plain ? {} : {
    antialiased: false, kernel2DSize: 0.3, sphericalHarmonicsDegree: 2, halfPrecisionCovariancesOnGPU: false, integerBasedSort: false,
    splatSortDistanceMapPrecision: 20, inMemoryCompressionLevel: 0,
  };
  for (const key of Object.keys(options)) if (key !== "plain") everything[key] = JSON.parse(options[key]);
  const viewer = new GaussianSplats3D.Viewer({
    selfDrivenMode: false, rootElement: place, renderer, camera, useBuiltInControls: false, ignoreDevicePixelRatio: true,
    gpuAcceleratedSort: false, sharedMemoryForWorkers: false, sceneRevealMode: GaussianSplats3D.SceneRevealMode.Instant, ...everything,
  });
  // From memory: read from a network, a compressed PLY has no splats now and then, by how its bytes arrive.
  const bytes = await (await fetch(url)).arrayBuffer();
  const { PlyLoader, SplatLoader, SpzLoader } = GaussianSplats3D;
  const loader = name.endsWith(".ply") ? PlyLoader : name.endsWith(".spz") ? SpzLoader : SplatLoader;
  const least = options.plain ? 1 : 0, degree = everything.sphericalHarmonicsDegree ?? 0;
  const buffer = await (loader === SplatLoader ? loader.loadFromFileData(bytes, least, 0, true)
                                               : loader.loadFromFileData(bytes, least, 0, true, degree));
  await viewer.addSplatBuffers([buffer], [{ splatAlphaRemovalThreshold: least, rotation: turn === "x" ? [1, 0, 0, 0] : [0, 0, 0, 1] }],
                               true, false, false);
  const frame = () => new Promise((done) => requestAnimationFrame(done));
  const gl = renderer.getContext();
  const sorted = async () => {
    while (viewer.sortRunning || !viewer.splatRenderReady) await new Promise((done) => setTimeout(done, 20));
  };
  return {
    count: viewer.getSplatMesh().getSplatCount(),
    async show(matrix) {
      new THREE.Matrix4().set(...matrix).decompose(camera.position, camera.quaternion, camera.scale);
      camera.updateMatrixWorld(true);
      // All splats are sorted from this camera at once; an update by itself would sort them in parts, one an update.
      await sorted();
      await viewer.runSplatSort(true, true);
      do {
        await sorted();
        viewer.update();
      } while (viewer.sortRunning);
      for (let twice = 0; twice < 2; ++twice) { // on a busy machine the first picture may not be on the page when it is photographed
        viewer.render();
        gl.readPixels(0, 0, 1, 1, gl.RGBA, gl.UNSIGNED_BYTE, new Uint8Array(4));
        await frame();
      }
      await frame();
    },
  };
}
