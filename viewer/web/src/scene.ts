// SPDX-License-Identifier: Apache-2.0
// The cloud in the picture: what there is to see, from where, and what is known of a place in it.

import * as THREE from "three";
import { CloudPoints } from "./cloud_points";
import type { Colours } from "./colours";
import { Eye, pixelsPerUnit } from "./eye";
import { Frames, type Painter } from "./frames";
import { Motion } from "./motion";
import { type ColourMode, Picture, type Shot } from "./picture";
import type { CloudHead, Numbers, Result } from "./protocol";
import type { Box } from "./region";
import type { Draw, View } from "./state";
import { upAxis } from "./upright";

const kPicked = 400000; // points looked at for one under the pointer

export class Scene {
  readonly canvas: HTMLCanvasElement;
  private readonly picture = new Picture();
  private readonly points = new CloudPoints(this.picture.material);
  readonly frames = new Frames(this.painter(), () => this.rest());
  private readonly eye: Eye;
  private motion = new Motion();
  private previewed: Float32Array | null = null; // displacements that faces show until a whole result comes
  private cloud: CloudHead | null = null;
  private positions: Float32Array = new Float32Array();
  private moving = false; // the camera does
  private holding = false;
  private fittedAspect = 0; // for which the camera was placed
  onCamera: () => void = () => {};

  constructor(private readonly parent: HTMLElement, private readonly view: View) {
    this.canvas = this.picture.canvas;
    this.canvas.tabIndex = 0;
    this.canvas.setAttribute("role", "application");
    this.canvas.setAttribute("aria-label", "The cloud. Arrow keys turn it, with shift they move it; plus and minus zoom.");
    this.picture.setPoints(this.points);
    this.eye = new Eye(this.canvas, () => this.cameraMoved());
    new ResizeObserver(() => this.resize()).observe(parent);
    this.canvas.addEventListener("webglcontextlost", (event) => event.preventDefault());
    this.canvas.addEventListener("webglcontextrestored", () => this.render());
  }

  // Of what one of the views shows.
  private get aspect(): number {
    const { clientWidth: width, clientHeight: height } = this.parent;
    return (this.view.mode === "side" ? width / 2 : width) / (height || 1) || 1;
  }

  get allPositions(): Float32Array {
    return this.positions;
  }

  get count(): number {
    return this.cloud?.shown ?? 0;
  }

  // What there is to see.

  setCloud(head: CloudHead, arrays: Record<string, Numbers>): void {
    this.cloud = head;
    this.positions = arrays.positions as Float32Array;
    if (this.view.up === "auto") this.view.up = upAxis(head.name, head.origin, this.positions);
    this.motion = new Motion(head.shown);
    this.points.reset(this.positions, { ends: arrays.face_ends as Uint32Array, corners: arrays.face_corners as Uint32Array });
    this.setShading(arrays.normals, ["normal_before", "normal_after"]);
    this.picture.material.uniforms.uHasNormals.value = arrays.normals.length > 0;
    this.applyView();
    this.placeCamera();
    this.touch();
  }

  /** Shows the displacements of a whole run. */
  setResult(head: Result, arrays: Record<string, Numbers>): void {
    this.endPreview();
    for (const attribute of this.motion.take(head, arrays)) this.points.set(attribute);
    this.points.surface.moved();
    if (arrays.motion_normals && !this.cloud?.settles) {
      this.setShading(arrays.motion_normals, ["normal_before", "normal_after"]);
      this.picture.material.uniforms.uHasNormals.value = true;
    }
    this.touch();
  }

  /** Shows displacements, in file units, of the places in a ball, until a whole result comes. */
  setPreview(places: Uint32Array, displacements: Float32Array, center: [number, number, number], radius: number): void {
    if (this.draw === "points") this.points.setPart(places, displacements, { center, radius });
    else {
      const all = this.motion.all();
      places.forEach((place, i) => all.set(displacements.subarray(3 * i, 3 * i + 3), 3 * place));
      this.previewed = all;
      this.points.surface.showMotion(all);
    }
    this.touch();
  }

  /** Back to the last whole result. */
  clearPreview(): void {
    this.endPreview();
    this.touch();
  }

  private endPreview(): void {
    this.points.clearPart();
    if (!this.previewed) return;
    this.previewed = null;
    this.points.surface.moved();
    const far = this.points.all.geometry.getAttribute("far_move");
    if (far) this.points.surface.share("far_move", far as THREE.BufferAttribute);
  }

  /** Whether there are faces to draw. */
  get hasFaces(): boolean {
    return this.points.surface.isThere;
  }

  private get draw(): Draw {
    return this.hasFaces ? this.view.draw : "points";
  }

  /** Normals of the result, for shading. */
  setNormals(normals: Numbers): void {
    this.setShading(normals, ["normal_after"]);
    this.render();
  }

  private setShading(normals: Numbers, names: string[]): void {
    if (normals.length) for (const name of names) this.points.set({ name, array: normals, size: 2 });
  }

  setColours(rgb: Uint8Array): void {
    this.points.set({ name: "rgb", array: rgb, size: 4 }, true);
    this.render();
  }

  /** Pixels that a side of a picture on faces may have. */
  get mostOfSide(): number {
    return this.picture.mostOfSide;
  }

  /** Lays pictures on the faces. */
  setTexture(arrays: Record<string, Numbers>, pictures: (THREE.Texture | null)[]): void {
    this.points.surface.setTexture(arrays.coordinates as Float32Array, arrays.face_pictures as Uint32Array, pictures);
    this.render();
  }

  setScalar(values: Float32Array): void {
    this.points.set({ name: "scalar", array: values, size: 1 });
    this.render();
  }

  /** Dims what the limits hold still; null: nothing. */
  setInside(mask: Uint8Array | null): void {
    if (mask) this.points.set({ name: "inside", array: mask, size: 1 });
    this.picture.material.uniforms.uDim.value = mask !== null;
    this.touch();
  }

  /** In file coordinates. */
  setBox(box: Box | null): void {
    const origin = this.cloud?.origin ?? [0, 0, 0];
    const relative = (corner: number[]) => corner.map((v, c) => v - origin[c]);
    this.picture.setBox(box && { min: relative(box.min), max: relative(box.max) });
    this.applyView();
  }

  /** Between two points that were picked, and the first of them alone; none: nothing is drawn. */
  setDistance(ends: THREE.Vector3[]): void {
    this.picture.setDistance(ends);
    this.render();
  }

  setColourMode(mode: ColourMode, range: [number, number], map: Colours): void {
    this.picture.setColourMode(mode, range, map);
    this.render();
  }

  /** After a change of the view. */
  applyView(): void {
    this.eye.zoomsToPointer = this.view.mode !== "side";
    if (this.view.camera.length === 0 && this.aspect !== this.fittedAspect) this.placeCamera();
    const up = new THREE.Vector3(0, this.view.up === "y" ? 1 : 0, this.view.up === "y" ? 0 : 1);
    this.eye.setUp(up);
    this.picture.setLook(this.view.shade, this.view.edl, this.view.hide, up);
    this.touch();
  }

  /** The original while true. */
  hold(original: boolean): void {
    if (this.holding === original) return;
    this.holding = original;
    this.touch();
  }

  // What is known of it.

  /** The displacement of a place, file units. */
  displacement(place: number): [number, number, number] {
    return this.motion.of(place);
  }

  /** Positive toward the eye, as the colours show it. */
  signedDisplacement(place: number): number {
    const d = this.motion.of(place);
    const eye = this.eye.camera.position;
    const toward =
      d[0] * (eye.x - this.positions[3 * place]) +
      d[1] * (eye.y - this.positions[3 * place + 1]) +
      d[2] * (eye.z - this.positions[3 * place + 2]);
    return Math.hypot(...d) * (toward < 0 ? -1 : 1);
  }

  height(place: number): number {
    return this.positions[3 * place + (this.view.up === "y" ? 1 : 2)];
  }

  /** How many pixels a length in the middle of the picture takes. */
  pixels(length: number): number {
    return (length * pixelsPerUnit(this.canvas.clientHeight)) / Math.max(1e-30, this.eye.distance);
  }

  /** Where the picture's point (x, y), -1 to 1, meets the cloud, relative to the origin; null if nowhere near. */
  pick(x: number, y: number, reach = 0.06): THREE.Vector3 | null {
    const place = this.pickPlace(x, y, reach);
    return place < 0 ? null : this.position(place);
  }

  /** In the original, relative to the origin. */
  position(place: number): THREE.Vector3 {
    return new THREE.Vector3().fromArray(this.positions, 3 * place);
  }

  /** The place that is there; -1 if none is near. */
  pickPlace(x: number, y: number, reach = 0.06): number {
    const m = this.matrix.elements;
    const { aspect } = this;
    const stride = Math.max(1, Math.floor(this.count / kPicked));
    let best = -1;
    let least = Infinity;
    for (let i = 0; i < this.count; i += stride) {
      const [px, py, pz] = [this.positions[3 * i], this.positions[3 * i + 1], this.positions[3 * i + 2]];
      const w = m[3] * px + m[7] * py + m[11] * pz + m[15];
      if (!(w > 0)) continue;
      const dx = ((m[0] * px + m[4] * py + m[8] * pz + m[12]) / w - x) * aspect;
      const dy = (m[1] * px + m[5] * py + m[9] * pz + m[13]) / w - y;
      const off = Math.hypot(dx, dy);
      // nearest to the eye among those under the pointer
      const score = w * (1 + 25 * off);
      if (off < reach && score < least) [least, best] = [score, i];
    }
    return best;
  }

  /** Where the user looks, in file coordinates. */
  focus(): number[] | undefined {
    if (!this.cloud) return undefined;
    const at = this.pick(0, 0, 0.3) ?? this.eye.target;
    return at.toArray().map((v, c) => v + this.cloud!.origin[c]);
  }

  // From offsets of the origin to -1 to 1 in the picture, or in either of two beside each other.
  private get matrix(): THREE.Matrix4 {
    this.eye.setAspect(this.aspect);
    return this.eye.matrix;
  }

  /** A place on the stage, -1 to 1, as a place in the picture: where two are beside each other, in that one of them. */
  inPicture([x, y]: [number, number], left = x < 0): [number, number] {
    return this.view.mode === "side" ? [2 * x + (left ? 1 : -1), y] : [x, y];
  }

  get fileMatrix(): { elements: number[]; origin: number[] } {
    return { elements: this.matrix.elements, origin: this.cloud?.origin ?? [0, 0, 0] };
  }

  // The camera.

  /** Makes a place the point that the camera turns about. */
  pivot(at: THREE.Vector3): void {
    this.eye.pivot(at);
    this.render();
  }

  fit(): void {
    this.view.camera = [];
    this.placeCamera();
    this.onCamera();
  }

  nudge(turn: [number, number], move: [number, number], zoom: number): void {
    this.eye.nudge(turn, move, zoom);
  }

  private placeCamera(): void {
    if (!this.cloud) return;
    if (this.view.camera.length === 6) this.eye.place(this.view.camera);
    else this.eye.fit(this.positions, this.cloud, (this.fittedAspect = this.aspect));
    this.moving = false; // by the hand, that is
  }

  private cameraMoved(): void {
    this.moving = true;
    this.touch();
  }

  // Frames.

  /** The picture as a PNG. */
  async screenshot(): Promise<Blob> {
    this.frames.drawWhole();
    return this.picture.png();
  }

  private render(): void {
    this.frames.render();
  }

  private touch(): void {
    this.frames.touch();
  }

  private rest(): void {
    if (!this.moving) return;
    this.moving = false;
    this.view.camera = this.eye.numbers;
    this.onCamera();
  }

  private painter(): Painter {
    const scene = this;
    return {
      get count() {
        return scene.count;
      },
      get drawsPortions() {
        return scene.draw === "points";
      },
      advance: (now) => this.eye.advance(now),
      clear: () => this.picture.clear(),
      paint: (from, count, of, fineness, last) => this.paint(from, count, this.shot(of, fineness), last),
      finished: () => this.picture.finished(),
    };
  }

  private paint(from: number, count: number, shot: Shot, last: boolean): void {
    if (this.cloud) {
      if (shot.draw !== "points") this.points.surface.prepare(shot.draw, () => this.previewed ?? this.motion.all());
      this.eye.setClipPlanes(this.cloud);
      this.picture.draw(this.points, this.motion, this.eye, shot, from, count, last);
    }
    if (last) this.picture.show(this.eye, shot);
  }

  // Points grow as fewer are drawn, so that the surface stays closed.
  private shot(drawn: number, fineness: number): Shot {
    const { mode, wipe, size, exaggerate } = this.view;
    const { points, spacing, diagonal, shown } = this.cloud ?? { points: 1, spacing: 1, diagonal: 1, shown: 1 };
    const whole = size * (spacing || diagonal / 500 || 1);
    return {
      mode: this.holding ? "before" : mode, wipe, fineness, exaggerate, draw: this.draw,
      pointSize: whole * Math.sqrt(points / Math.max(1, drawn)),
      partSize: whole * Math.sqrt(points / Math.max(1, shown)),
    };
  }

  private resize(): void {
    const { clientWidth: width, clientHeight: height } = this.parent;
    if (!width || !height) return;
    this.picture.resize(width, height);
    this.eye.setAspect(width / height);
    if (this.cloud && this.view.camera.length === 0) this.placeCamera();
    this.frames.drawQuickly(); // the new size cleared the screen
    this.touch();
  }
}
