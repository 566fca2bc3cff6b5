// SPDX-License-Identifier: Apache-2.0
// The faces on the graphics card, over the attributes of the points. Memory, here and there: 12 bytes a triangle, 8 an edge
// once a wireframe is drawn, and 16 a point once they are smooth.

import * as THREE from "three";
import { edges, type Polygons, triangles, vertexNormals, welded } from "./faces";
import { faceMaterial } from "./materials";
import type { Draw } from "./state";

export class Surface {
  readonly fill: THREE.Mesh<THREE.BufferGeometry, THREE.RawShaderMaterial>;
  readonly lines: THREE.LineSegments<THREE.BufferGeometry, THREE.RawShaderMaterial>;
  private faces: Polygons = { ends: new Uint32Array(), corners: new Uint32Array() };
  private positions: Float32Array = new Float32Array();
  private vertex: Uint32Array | null = null;
  private smooth = { before: false, after: false }; // normals that are up to date
  private ownMotion = false; // displacements that are not those of the points

  constructor(points: THREE.RawShaderMaterial) {
    this.fill = new THREE.Mesh(new THREE.BufferGeometry(), faceMaterial(points, {}));
    this.lines = new THREE.LineSegments(new THREE.BufferGeometry(), faceMaterial(points, { LINES: "" }));
    this.fill.frustumCulled = this.lines.frustumCulled = false;
  }

  get isThere(): boolean {
    return this.faces.ends.length > 0;
  }

  /** Forgets everything but the new faces. */
  reset(positions: Float32Array, faces: Polygons): void {
    for (const object of [this.fill, this.lines]) {
      object.geometry.dispose();
      object.geometry = new THREE.BufferGeometry();
    }
    this.positions = positions;
    this.faces = faces;
    this.vertex = null;
    this.ownMotion = false;
    this.smooth = { before: false, after: false };
  }

  /** An attribute of the points, which are the corners. */
  share(name: string, attribute: THREE.BufferAttribute): void {
    if (!this.isThere) return;
    this.fill.geometry.setAttribute(name, attribute);
    this.lines.geometry.setAttribute(name, attribute);
  }

  /** The displacements of all places have changed. */
  moved(): void {
    this.smooth.after = false;
    this.ownMotion = false;
  }

  /** Shows displacements of its own until moved() is called; file units, three a place. */
  showMotion(displacements: Float32Array): void {
    this.share("far_move", new THREE.BufferAttribute(displacements, 3));
    this.smooth.after = false;
    this.ownMotion = true;
  }

  get hasOwnMotion(): boolean {
    return this.ownMotion;
  }

  /** Makes what this way to draw needs. `displacements`: of all places, in file units, three each. */
  prepare(draw: Draw, displacements: () => Float32Array): void {
    if (!this.fill.geometry.index) this.fill.geometry.setIndex(new THREE.BufferAttribute(triangles(this.faces, this.positions), 1));
    if (draw === "wireframe" && !this.lines.geometry.index)
      this.lines.geometry.setIndex(new THREE.BufferAttribute(edges(this.faces, this.positions), 1));
    if (draw !== "smooth") return;
    if (!this.smooth.before) this.setNormals("face_before", this.positions);
    if (!this.smooth.after) {
      const moved = displacements().map((d, i) => this.positions[i] + d);
      this.setNormals("face_after", moved);
    }
    this.smooth = { before: true, after: true };
  }

  private setNormals(name: string, positions: Float32Array): void {
    this.vertex ??= welded(this.positions);
    const normals = vertexNormals(this.fill.geometry.index!.array as Uint32Array, this.vertex, positions);
    this.fill.geometry.setAttribute(name, new THREE.BufferAttribute(normals, 4, true));
  }
}
