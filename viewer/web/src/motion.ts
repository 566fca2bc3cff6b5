// SPDX-License-Identifier: Apache-2.0
// Where the points of the last result went: displacements as they came, and as numbers.

import { decodeNormal, type Numbers, type Result } from "./protocol";

/** How displacements are given; the numbers that the shader knows. */
export const kMotion = { none: 0, alongNormals: 1, steps: 2, far: 3 } as const;
type Kind = (typeof kMotion)[keyof typeof kMotion];

/** A vertex attribute: its name in the shader, its numbers, and how many of them a point has. */
export interface Attribute {
  name: string;
  array: Numbers;
  size: number;
}

export class Motion {
  kind: Kind = kMotion.none;
  step = 1; // file units
  private values: Int16Array | Float32Array = new Int16Array();
  private normals: Int16Array | null = null;

  constructor(private readonly count = 0) {}

  /** Takes the displacements of a whole run; the attributes that are new. */
  take(head: Result, arrays: Record<string, Numbers>): Attribute[] {
    const fresh: Attribute[] = [];
    if (arrays.motion_normals) {
      this.normals = arrays.motion_normals as Int16Array;
      fresh.push({ name: "motion", array: this.normals, size: 2 });
    }
    this.step = head.step;
    this.values = arrays.displacements as Int16Array;
    this.kind = head.along_normals ? kMotion.alongNormals : kMotion.steps;
    if (arrays.places.length) this.setFar(arrays.places as Uint32Array, arrays.exceptions as Float32Array);
    const name = { [kMotion.none]: "", [kMotion.alongNormals]: "along", [kMotion.steps]: "move", [kMotion.far]: "far_move" }[this.kind];
    fresh.push({ name, array: this.values, size: this.kind === kMotion.alongNormals ? 1 : 3 });
    return fresh;
  }

  /** The displacement of a place, file units. */
  of(place: number): [number, number, number] {
    if (this.kind === kMotion.none) return [0, 0, 0];
    if (this.kind === kMotion.alongNormals) {
      const n = this.normals && decodeNormal(this.normals[2 * place], this.normals[2 * place + 1]);
      const length = this.values[place] * this.step;
      return n ? [n[0] * length, n[1] * length, n[2] * length] : [0, 0, 0];
    }
    const scale = this.kind === kMotion.steps ? this.step : 1;
    return [this.values[3 * place] * scale, this.values[3 * place + 1] * scale, this.values[3 * place + 2] * scale];
  }

  /** Of all places, file units, three each. */
  all(): Float32Array {
    const all = new Float32Array(3 * this.count);
    for (let place = 0; place < this.count; ++place) all.set(this.of(place), 3 * place);
    return all;
  }

  // Some displacements cannot be said in steps: all become plain numbers.
  private setFar(places: Uint32Array, exceptions: Float32Array): void {
    const far = this.all();
    for (let i = 0; i < places.length; ++i) far.set(exceptions.subarray(3 * i, 3 * i + 3), 3 * places[i]);
    this.values = far;
    this.kind = kMotion.far;
  }
}
