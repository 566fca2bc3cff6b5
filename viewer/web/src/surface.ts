// SPDX-License-Identifier: Apache-2.0
// The faces on the graphics card, over the attributes of the points. Memory, here and there: 12 bytes a triangle, 8 an edge
// once a wireframe is drawn, and 16 a point once they are smooth. With pictures 8 a vertex more, and where these have seams
// all attributes once more, for the vertices are then the points and a twin of each for every further place in a picture.

import * as THREE from "three";
import { edges, pictureVertices, type Polygons, triangles, vertexNormals, welded } from "./faces";
import { faceMaterial } from "./materials";
import type { Numbers } from "./protocol";
import { put } from "./put";
import type { Draw } from "./state";

const kNone: Polygons = { ends: new Uint32Array(), corners: new Uint32Array() };

export class Surface {
  readonly fill: THREE.Mesh<THREE.BufferGeometry, THREE.RawShaderMaterial | THREE.RawShaderMaterial[]>;
  readonly lines: THREE.LineSegments<THREE.BufferGeometry, THREE.RawShaderMaterial>;
  private readonly plain: THREE.RawShaderMaterial;
  private faces = kNone; // over the places
  private filled = kNone; // the same over vertices
  private twins: Uint32Array = new Uint32Array(); // the place of each vertex behind the places
  private pictureOf: Uint32Array = new Uint32Array(); // of each face
  private pictures: (THREE.Texture | null)[] = [];
  private shared = new Map<string, THREE.BufferAttribute>(); // of the points
  private positions: Float32Array = new Float32Array(); // of the vertices
  private vertex: Uint32Array | null = null;
  private smooth = { before: false, after: false }; // normals that are up to date
  private ownMotion = false; // displacements that are not those of the points

  constructor(private readonly points: THREE.RawShaderMaterial) {
    this.plain = faceMaterial(points, {});
    this.fill = new THREE.Mesh<THREE.BufferGeometry, THREE.RawShaderMaterial | THREE.RawShaderMaterial[]>(new THREE.BufferGeometry(), this.plain);
    this.lines = new THREE.LineSegments(new THREE.BufferGeometry(), faceMaterial(points, { LINES: "" }));
    this.fill.frustumCulled = this.lines.frustumCulled = false;
  }

  get isThere(): boolean {
    return this.faces.ends.length > 0;
  }

  /** Forgets everything but the new faces. */
  reset(positions: Float32Array, faces: Polygons): void {
    this.forgetGeometry();
    this.setPictures([]);
    this.shared.clear();
    this.positions = positions;
    this.faces = this.filled = faces;
    this.twins = this.pictureOf = new Uint32Array();
    this.ownMotion = false;
  }

  /** Lays pictures on the faces: `coordinates` are two a corner, `pictureOf` each face says which; null ones are not there. */
  setTexture(coordinates: Float32Array, pictureOf: Uint32Array, pictures: (THREE.Texture | null)[]): void {
    if (pictureOf.length !== this.faces.ends.length) return; // of faces that are not drawn
    const count = this.positions.length / 3 - this.twins.length;
    const vertices = pictureVertices(this.faces.corners, coordinates, count);
    this.positions = this.positions.subarray(0, 3 * count);
    this.forgetGeometry();
    this.twins = vertices.twins;
    this.positions = this.withTwins(this.positions, 3);
    this.filled = { ends: this.faces.ends, corners: vertices.corners };
    this.pictureOf = pictureOf;
    this.setPictures(pictures);
    for (const [name, attribute] of this.shared) this.share(name, attribute);
    this.fill.geometry.setAttribute("in_picture", new THREE.BufferAttribute(vertices.coordinates, 2));
  }

  /** An attribute of the points, which are the corners. */
  share(name: string, attribute: THREE.BufferAttribute): void {
    if (!this.isThere) return;
    this.shared.set(name, attribute);
    const { array, itemSize, normalized } = attribute;
    const its = this.twins.length
      ? put(this.fill.geometry, name, this.withTwins(array as Numbers, itemSize), itemSize, normalized) : attribute;
    this.fill.geometry.setAttribute(name, its);
    this.lines.geometry.setAttribute(name, its);
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

  /** Uniforms have changed. */
  refresh(): void {
    for (const material of [this.fill.material, this.lines.material].flat()) material.uniformsNeedUpdate = true;
  }

  /** Makes what this way to draw needs. `displacements`: of all places, in file units, three each. */
  prepare(draw: Draw, displacements: () => Float32Array): void {
    if (!this.fill.geometry.index) this.setTriangles();
    if (draw === "wireframe" && !this.lines.geometry.index)
      this.lines.geometry.setIndex(new THREE.BufferAttribute(edges(this.faces, this.positions), 1));
    if (draw !== "smooth") return;
    if (!this.smooth.before) this.setNormals("face_before", this.positions);
    if (!this.smooth.after) {
      const moved = this.withTwins(displacements(), 3).map((d, i) => this.positions[i] + d);
      this.setNormals("face_after", moved);
    }
    this.smooth = { before: true, after: true };
  }

  // Group 0 has the faces without a picture, the next one those with the first picture.
  private setTriangles(): void {
    const group = (face: number) => {
      const picture = this.pictureOf[face];
      return this.pictures[picture] ? picture + 1 : 0;
    };
    const { indices, ends } = triangles(this.filled, this.positions, this.pictures.length + 1, group);
    this.fill.geometry.setIndex(new THREE.BufferAttribute(indices, 1));
    this.fill.geometry.clearGroups();
    ends.forEach((end, g) => this.fill.geometry.addGroup(g ? ends[g - 1] : 0, end - (g ? ends[g - 1] : 0), g));
  }

  private setPictures(pictures: (THREE.Texture | null)[]): void {
    for (const material of [this.fill.material].flat()) if (material !== this.plain) material.dispose();
    for (const picture of this.pictures) picture?.dispose();
    this.pictures = pictures;
    this.fill.material = [this.plain, ...pictures.map((picture) => (picture ? faceMaterial(this.points, {}, picture) : this.plain))];
  }

  private forgetGeometry(): void {
    for (const object of [this.fill, this.lines]) {
      object.geometry.dispose();
      object.geometry = new THREE.BufferGeometry();
    }
    this.vertex = null;
    this.smooth = { before: false, after: false };
  }

  // Values of the places, and behind them those of the twins.
  private withTwins<T extends Numbers>(values: T, size: number): T {
    const { twins } = this;
    if (!twins.length) return values;
    const all = new (values.constructor as { new (length: number): T })(values.length + size * twins.length);
    all.set(values);
    twins.forEach((place, t) => {
      for (let c = 0; c < size; ++c) all[values.length + size * t + c] = values[size * place + c];
    });
    return all;
  }

  private setNormals(name: string, positions: Float32Array): void {
    this.vertex ??= welded(this.positions);
    const normals = vertexNormals(this.fill.geometry.index!.array as Uint32Array, this.vertex, positions);
    this.fill.geometry.setAttribute(name, new THREE.BufferAttribute(normals, 4, true));
  }
}
