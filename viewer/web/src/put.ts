// SPDX-License-Identifier: Apache-2.0
// Attributes of geometries, whose memory on the graphics card is used again.

import * as THREE from "three";
import type { Numbers } from "./protocol";

/** Gives a geometry an attribute: in the place of the old one where that has the same length and type. */
export function put(geometry: THREE.BufferGeometry, name: string, array: Numbers, size: number, normalized: boolean): THREE.BufferAttribute {
  const old = geometry.getAttribute(name) as THREE.BufferAttribute | undefined;
  if (old && old.array.length === array.length && old.array.constructor === array.constructor) {
    old.array = array;
    old.needsUpdate = true;
    return old;
  }
  const fresh = new THREE.BufferAttribute(array, size, normalized);
  geometry.setAttribute(name, fresh);
  return fresh;
}
