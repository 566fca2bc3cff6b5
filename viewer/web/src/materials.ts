// SPDX-License-Identifier: Apache-2.0
// The shaders with their uniforms.

import * as THREE from "three";
import { mapTexels } from "./colours";
import { faceFragment, pointFragment, pointVertex, screenFragment, screenVertex } from "./shaders";

export function pointMaterial(): THREE.RawShaderMaterial {
  const map = new THREE.DataTexture(mapTexels("sequential"), 256, 1);
  map.minFilter = map.magFilter = THREE.LinearFilter;
  map.needsUpdate = true;
  return new THREE.RawShaderMaterial({
    glslVersion: THREE.GLSL3,
    vertexShader: pointVertex,
    fragmentShader: pointFragment,
    defines: {},
    uniforms: {
      uAfter: { value: 1 }, uMotion: { value: 0 }, uStep: { value: 1 }, uPointSize: { value: 1 },
      uPixelsPerUnit: { value: 1 }, uMinSize: { value: 1 }, uMaxSize: { value: 24 }, uShade: { value: 1 }, uColour: { value: 0 },
      uRange: { value: new THREE.Vector2(0, 1) }, uHeightAxis: { value: new THREE.Vector3(0, 0, 1) },
      uMap: { value: map }, uBoxMin: { value: new THREE.Vector3() }, uBoxMax: { value: new THREE.Vector3() },
      uHide: { value: false }, uHasNormals: { value: false }, uDim: { value: false },
      uHole: { value: new THREE.Vector4(0, 0, 0, -1) }, uSmooth: { value: true }, uTone: { value: 1 },
    },
  });
}

/** Of faces, with the picture that lies on them if there is one, or with LINES of their edges. It has the uniforms of the points. */
export function faceMaterial({ uniforms }: THREE.RawShaderMaterial, defines: Record<string, string>, picture?: THREE.Texture):
    THREE.RawShaderMaterial {
  return new THREE.RawShaderMaterial({
    glslVersion: THREE.GLSL3,
    vertexShader: pointVertex,
    fragmentShader: faceFragment,
    defines: { FACES: "", ...(picture ? { PICTURE: "" } : {}), ...defines },
    uniforms: picture ? { ...uniforms, uPicture: { value: picture } } : uniforms, // the same objects
    side: THREE.DoubleSide,
    polygonOffset: !("LINES" in defines), // edges lie in front
    polygonOffsetFactor: 1,
    polygonOffsetUnits: 1,
  });
}

export function screenMaterial(): THREE.RawShaderMaterial {
  return new THREE.RawShaderMaterial({
    glslVersion: THREE.GLSL3,
    vertexShader: screenVertex,
    fragmentShader: screenFragment,
    depthTest: false,
    depthWrite: false,
    uniforms: {
      uColourImage: { value: null }, uDepthImage: { value: null }, uSize: { value: new THREE.Vector2() },
      uNearFar: { value: new THREE.Vector2() }, uStrength: { value: 0.5 }, uRadius: { value: 1 },
      uDivider: { value: 0 }, uFineness: { value: 1 },
    },
  });
}
