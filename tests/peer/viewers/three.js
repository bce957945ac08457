// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// A page of three.js with its own splats and its own loaders, on WebGL 2. They have no options: colours are written
// as they are in the file, and every picture is sorted anew.
import { GLTFGaussianSplatLoaderExtension } from "three/addons/loaders/GLTFGaussianSplatLoaderExtension.js";
import { GaussianSplatPLYLoader } from "three/addons/loaders/GaussianSplatPLYLoader.js";
import { GLTFLoader } from "three/addons/loaders/GLTFLoader.js";
import { SPLATLoader } from "three/addons/loaders/SPLATLoader.js";
import { SPZLoader } from "three/addons/loaders/SPZLoader.js";
import { GaussianSplat } from "three/addons/objects/GaussianSplat.js";
import * as THREE from "three/webgpu";

export async function open({ url, name, width, height, angle, background, turn }) {
  const renderer = new THREE.WebGPURenderer({ antialias: false, forceWebGL: true });
  renderer.outputColorSpace = THREE.LinearSRGBColorSpace;
  renderer.setPixelRatio(1);
  renderer.setSize(width, height);
  document.body.append(renderer.domElement);
  await renderer.init();
  const scene = new THREE.Scene();
  renderer.setClearColor(new THREE.Color().setStyle("#" + background, THREE.LinearSRGBColorSpace), 1);
  const camera = new THREE.PerspectiveCamera((360 / Math.PI) * Math.atan((Math.tan(angle / 2) * height) / width), width / height, 0.01, 1000);
  camera.matrixAutoUpdate = false;
  const loaders = { ".ply": GaussianSplatPLYLoader, ".spz": SPZLoader, ".splat": SPLATLoader };
  const ending = name.slice(name.lastIndexOf("."));
  let splats;
  if (ending === ".glb") {
    const { scene: opened } = await new GLTFLoader().register((parser) => new GLTFGaussianSplatLoaderExtension(parser)).loadAsync(url);
    opened.traverse((one) => { if (one.isGaussianSplat) splats = one; });
  } else {
    if (!loaders[ending]) throw new Error("three.js has no loader of splats for " + name);
    splats = new GaussianSplat(await new loaders[ending]().loadAsync(url));
  }
  splats.frustumCulled = false;
  const turned = new THREE.Group();
  if (turn === "x") turned.quaternion.set(1, 0, 0, 0);
  turned.add(splats);
  scene.add(turned);
  return {
    count: splats.splatGeometry.getAttribute("position").count,
    async show(matrix) {
      camera.matrix.set(...matrix);
      camera.updateMatrixWorld(true);
      for (let twice = 0; twice < 2; ++twice) {
        splats._sortInitialized = false;
        renderer.render(scene, camera);
        await new Promise((done) => requestAnimationFrame(() => requestAnimationFrame(done)));
      }
    },
  };
}
