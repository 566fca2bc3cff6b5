// SPDX-License-Identifier: Apache-2.0
// The points on the graphics card: those of the cloud, and a part of them that a preview shows elsewhere.
// Memory a point, here and again on the graphics card: 12 bytes position, 2 to 6 (12 where displacements are far) motion,
// 4 motion normal, 8 shading normals, 4 each for colours, a scalar and the limits where they are shown. A point of the part
// has as much once more.

import * as THREE from "three";
import type { Attribute } from "./motion";
import type { Polygons } from "./faces";
import type { Numbers } from "./protocol";
import { put } from "./put";
import { Surface } from "./surface";

const kShared = { position: 3, normal_before: 2, normal_after: 2, rgb: 4, scalar: 1, inside: 1 }; // by cloud and part

/** The ball that a part fills, relative to the cloud's origin. */
export interface Ball {
  center: [number, number, number];
  radius: number;
}

export class CloudPoints {
  readonly all: THREE.Points;
  readonly part: THREE.Points;
  readonly surface: Surface; // over the points of the cloud
  ball: Ball | null = null; // of the part; null if there is none
  private places: Uint32Array = new Uint32Array();

  constructor(material: THREE.RawShaderMaterial) {
    this.surface = new Surface(material);
    this.all = new THREE.Points(new THREE.BufferGeometry(), material);
    this.part = new THREE.Points(new THREE.BufferGeometry(), material);
    this.all.frustumCulled = this.part.frustumCulled = false;
  }

  /** Forgets everything but the new positions. */
  reset(positions: Float32Array, faces: Polygons): void {
    this.surface.reset(positions, faces);
    this.all.geometry.dispose();
    this.all.geometry = new THREE.BufferGeometry();
    this.set({ name: "position", array: positions, size: 3 });
    this.clearPart();
  }

  set({ name, array, size }: Attribute, normalized = false): void {
    this.surface.share(name, put(this.all.geometry, name, array, size, normalized));
    if (this.ball && name in kShared) this.gather(name);
  }

  /** Takes places out of the cloud and shows them with displacements of their own, file units. */
  setPart(places: Uint32Array, displacements: Float32Array, ball: Ball): void {
    if (places.length !== this.places.length) {
      this.part.geometry.dispose(); // what is on the card has another length
      this.part.geometry = new THREE.BufferGeometry();
    }
    this.places = places;
    this.ball = ball;
    put(this.part.geometry, "far_move", displacements, 3, false);
    for (const name of Object.keys(kShared)) this.gather(name);
  }

  clearPart(): void {
    this.ball = null;
    this.places = new Uint32Array();
    this.part.geometry.dispose();
    this.part.geometry = new THREE.BufferGeometry();
  }

  private gather(name: string): void {
    const whole = this.all.geometry.getAttribute(name) as THREE.BufferAttribute | undefined;
    if (!whole) return;
    const { array, itemSize, normalized } = whole;
    const picked = new (array.constructor as { new (length: number): Numbers })(this.places.length * itemSize);
    this.places.forEach((place, i) => {
      for (let c = 0; c < itemSize; ++c) picked[i * itemSize + c] = array[place * itemSize + c];
    });
    put(this.part.geometry, name, picked, itemSize, normalized);
  }
}
