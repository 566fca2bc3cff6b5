// SPDX-License-Identifier: Apache-2.0
// The picture: one geometry, drawn as the original, as the result, or as both beside each other, and lit by depth.
// Memory a point, here and again on the graphics card: 12 bytes position, 2 to 6 (12 where displacements are far) motion,
// 4 motion normal, 8 shading normals, 4 each for colours, a scalar and the limits where they are shown.

import * as THREE from "three";
import { OrbitControls } from "three/addons/controls/OrbitControls.js";
import { mapTexels, type MapName } from "./colours";
import { type CloudHead, decodeNormal, type Numbers, type Result } from "./protocol";
import type { Box } from "./region";
import { kColourModes, pointFragment, pointVertex, screenFragment, screenVertex } from "./shaders";
import type { View } from "./state";

type ColourMode = keyof typeof kColourModes;
const kFieldOfView = 40;
const kSlowFrame = 50; // ms; while things change slower frames become coarser, then hold fewer points
const kCoarsest = 0.5;
const kRestDelay = 350;
const kLongestFrame = 3000;
const kRoundFrom = 4.5; // pixels; smaller points are squares
const kMinDrawn = 20000;
const kLeastShare = 0.3; // of the points, or so many, while only their displacements change
const kLeastDrawn = 150000;

export class Scene {
  readonly canvas: HTMLCanvasElement;
  readonly camera = new THREE.PerspectiveCamera(kFieldOfView, 1, 0.01, 100);
  private readonly renderer: THREE.WebGLRenderer;
  private controls: OrbitControls;
  private readonly material: THREE.RawShaderMaterial;
  private readonly screen: THREE.RawShaderMaterial;
  private readonly points: THREE.Points;
  private readonly pointScene = new THREE.Scene();
  private readonly screenScene = new THREE.Scene();
  private readonly lineScene = new THREE.Scene();
  private readonly boxLines: THREE.LineSegments;
  private target = new THREE.WebGLRenderTarget(1, 1);
  private geometry = new THREE.BufferGeometry();
  private cloud: CloudHead | null = null;
  private positions = new Float32Array();
  private motionNormals: Int16Array | null = null;
  private values: Int16Array | Float32Array | null = null;
  private motion = 0; // as uMotion
  private step = 1;
  private frame = 0;
  private restTimer = 0;
  private moving = false;
  private share = 1; // of the points, drawn while moving
  private fineness = 1; // of the picture while it changes
  private changing = false;
  private restDelay = kRestDelay;
  private holding = false;
  private glide: { from: THREE.Vector3; to: THREE.Vector3; eye: THREE.Vector3; start: number } | null = null;
  view!: View;
  onCamera: () => void = () => {};
  /** Told whether the picture is whole, at its finest, and nothing is about to change it. */
  onStill: (still: boolean) => void = () => {};

  constructor(parent: HTMLElement, view: View) {
    const canvas = document.createElement("canvas");
    const context = canvas.getContext("webgl2", { alpha: false, antialias: false, depth: false, powerPreference: "high-performance" });
    if (!context) throw new Error("this browser has no WebGL 2");
    this.renderer = new THREE.WebGLRenderer({ canvas, context });
    this.renderer.autoClear = false;
    this.renderer.outputColorSpace = THREE.LinearSRGBColorSpace; // the shaders write what the screen shows
    this.canvas = this.renderer.domElement;
    this.canvas.tabIndex = 0;
    this.canvas.setAttribute("role", "application");
    this.canvas.setAttribute("aria-label", "The cloud. Arrow keys turn it, with shift they move it; plus and minus zoom.");
    parent.append(this.canvas);
    this.material = pointMaterial();
    this.screen = screenMaterial();
    this.points = new THREE.Points(this.geometry, this.material);
    this.points.frustumCulled = false;
    this.pointScene.add(this.points);
    const quad = new THREE.Mesh(new THREE.PlaneGeometry(2, 2), this.screen);
    quad.frustumCulled = false;
    this.screenScene.add(quad);
    this.boxLines = new THREE.LineSegments(
      new THREE.EdgesGeometry(new THREE.BoxGeometry(1, 1, 1)),
      new THREE.LineBasicMaterial({ color: 0x55cdb9, transparent: true, opacity: 0.9, depthTest: false }),
    );
    this.boxLines.visible = false;
    this.lineScene.add(this.boxLines);
    this.view = view;
    this.controls = this.makeControls();
    new ResizeObserver(() => this.resize()).observe(parent);
    this.canvas.addEventListener("webglcontextlost", (event) => event.preventDefault());
    this.canvas.addEventListener("webglcontextrestored", () => this.render());
    this.resize();
  }

  get allPositions(): Float32Array {
    return this.positions;
  }

  get count(): number {
    return this.cloud?.shown ?? 0;
  }

  setCloud(head: CloudHead, arrays: Record<string, Numbers>): void {
    this.geometry.dispose();
    this.geometry = new THREE.BufferGeometry();
    this.cloud = head;
    this.positions = arrays.positions as Float32Array<ArrayBuffer>;
    this.set("position", this.positions, 3);
    if (arrays.normals.length) {
      this.set("normal_before", arrays.normals, 2);
      this.set("normal_after", arrays.normals, 2);
    }
    this.points.geometry = this.geometry;
    this.motionNormals = this.values = null;
    this.motion = 0;
    this.share = 1;
    this.material.uniforms.uHasNormals.value = arrays.normals.length > 0;
    this.applyView();
    this.resetCamera();
  }

  /** Shows the displacements of a whole run. */
  setResult(head: Result, arrays: Record<string, Numbers>): void {
    if (arrays.motion_normals) {
      this.motionNormals = arrays.motion_normals as Int16Array;
      this.set("motion", this.motionNormals, 2);
      if (!this.cloud?.settles) {
        this.set("normal_before", this.motionNormals, 2);
        this.set("normal_after", this.motionNormals, 2);
        this.material.uniforms.uHasNormals.value = true;
      }
    }
    this.step = head.step;
    this.values = arrays.displacements as Int16Array;
    this.motion = head.along_normals ? 1 : 2;
    if (arrays.places.length) this.setFar(arrays.places as Uint32Array, arrays.exceptions as Float32Array);
    this.setMotion();
  }

  /** Shows displacements, in file units, of some places over what is shown. */
  setPreview(places: Uint32Array, displacements: Float32Array): void {
    if (!this.values) {
      this.values = new Int16Array(3 * this.count);
      this.motion = 2;
    }
    for (let i = 0; i < places.length; ++i) {
      const d = displacements.subarray(3 * i, 3 * i + 3);
      if (this.motion === 1) {
        const n = this.motionNormal(places[i]);
        this.values[places[i]] = n ? clampSteps((n[0] * d[0] + n[1] * d[1] + n[2] * d[2]) / this.step) : 0;
      } else if (this.motion === 2) {
        for (let c = 0; c < 3; ++c) this.values[3 * places[i] + c] = clampSteps(d[c] / this.step);
      } else {
        this.values.set(d, 3 * places[i]);
      }
    }
    this.setMotion();
  }

  setStep(step: number): void {
    this.step = step;
  }

  setNormals(normals: Numbers): void {
    this.set("normal_after", normals, 2);
    this.render();
  }

  setColours(rgb: Uint8Array): void {
    this.set("rgb", rgb, 4, true);
    this.render();
  }

  setScalar(values: Float32Array): void {
    this.set("scalar", values, 1);
    this.render();
  }

  /** Dims what the limits hold still; null: nothing. */
  setInside(mask: Uint8Array | null): void {
    if (mask) this.set("inside", mask, 1);
    this.material.uniforms.uDim.value = mask !== null;
    this.render();
  }

  setBox(box: Box | null): void {
    this.boxLines.visible = box !== null;
    if (box && this.cloud) {
      const { origin } = this.cloud;
      const low = new THREE.Vector3(...box.min.map((v, c) => v - origin[c]));
      const high = new THREE.Vector3(...box.max.map((v, c) => v - origin[c]));
      this.boxLines.position.addVectors(low, high).multiplyScalar(0.5);
      this.boxLines.scale.subVectors(high, low);
      this.material.uniforms.uBoxMin.value.copy(low);
      this.material.uniforms.uBoxMax.value.copy(high);
    }
    this.render();
  }

  setColourMode(mode: ColourMode, range: [number, number], map: MapName): void {
    const { uniforms } = this.material;
    uniforms.uColour.value = kColourModes[mode];
    uniforms.uRange.value.set(range[0], range[1]);
    uniforms.uMap.value.image.data.set(mapTexels(map));
    uniforms.uMap.value.needsUpdate = true;
    this.render();
  }

  /** After a change of `view`. */
  applyView(): void {
    const { uniforms } = this.material;
    uniforms.uShade.value = this.view.shade;
    uniforms.uHide.value = this.view.hide && this.boxLines.visible;
    uniforms.uHeightAxis.value.set(0, this.view.up === "y" ? 1 : 0, this.view.up === "z" ? 1 : 0);
    this.screen.uniforms.uStrength.value = this.view.edl;
    const up = new THREE.Vector3(0, this.view.up === "y" ? 1 : 0, this.view.up === "z" ? 1 : 0);
    if (!this.camera.up.equals(up)) {
      this.camera.up.copy(up);
      this.controls.dispose();
      this.controls = this.makeControls();
    }
    this.render();
  }

  /** The original while true. */
  hold(original: boolean): void {
    if (this.holding === original) return;
    this.holding = original;
    this.render();
  }

  /** The displacement of a place, file units. */
  displacement(place: number): [number, number, number] {
    if (!this.values || this.motion === 0) return [0, 0, 0];
    if (this.motion === 1) {
      const n = this.motionNormal(place);
      const steps = this.values[place] * this.step;
      return n ? [n[0] * steps, n[1] * steps, n[2] * steps] : [0, 0, 0];
    }
    const scale = this.motion === 2 ? this.step : 1;
    return [0, 1, 2].map((c) => this.values![3 * place + c] * scale) as [number, number, number];
  }

  /** Positive toward the eye, as the colours show it. */
  signedDisplacement(place: number): number {
    const d = this.displacement(place);
    const eye = this.camera.position;
    const toward =
      d[0] * (eye.x - this.positions[3 * place]) +
      d[1] * (eye.y - this.positions[3 * place + 1]) +
      d[2] * (eye.z - this.positions[3 * place + 2]);
    return Math.hypot(...d) * (toward < 0 ? -1 : 1);
  }

  height(place: number): number {
    return this.positions[3 * place + (this.view.up === "y" ? 1 : 2)];
  }

  /** Where the picture's point (x, y), -1 to 1, meets the cloud, relative to the origin; null if nowhere near. */
  pick(x: number, y: number, reach = 0.06): THREE.Vector3 | null {
    const m = new THREE.Matrix4().multiplyMatrices(this.camera.projectionMatrix, this.camera.matrixWorldInverse).elements;
    const aspect = this.camera.aspect;
    const stride = Math.max(1, Math.floor(this.count / 400000));
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
    return best < 0 ? null : new THREE.Vector3().fromArray(this.positions, 3 * best);
  }

  /** Where the user looks, in file coordinates. */
  focus(): number[] | undefined {
    if (!this.cloud) return undefined;
    const at = this.pick(0, 0, 0.3) ?? this.controls.target;
    return at.toArray().map((v, c) => v + this.cloud!.origin[c]);
  }

  get fileMatrix(): { elements: number[]; origin: number[] } {
    this.camera.updateMatrixWorld();
    const matrix = new THREE.Matrix4().multiplyMatrices(this.camera.projectionMatrix, this.camera.matrixWorldInverse);
    return { elements: matrix.elements, origin: this.cloud?.origin ?? [0, 0, 0] };
  }

  /** Makes a place the point that the camera turns about. */
  pivot(at: THREE.Vector3): void {
    this.glide = { from: this.controls.target.clone(), to: at, eye: this.camera.position.clone(), start: performance.now() };
    this.render();
  }

  fit(): void {
    this.view.camera = [];
    this.resetCamera();
    this.onCamera();
  }

  /** Turns by angles, moves by shares of the distance, or zooms by a factor: what keys ask for. */
  nudge(turn: [number, number], move: [number, number], zoom: number): void {
    const { target } = this.controls;
    const offset = this.camera.position.clone().sub(target);
    const toUp = new THREE.Quaternion().setFromUnitVectors(this.camera.up, new THREE.Vector3(0, 1, 0));
    const spherical = new THREE.Spherical().setFromVector3(offset.applyQuaternion(toUp));
    spherical.theta -= turn[0];
    spherical.phi = Math.min(Math.PI - 0.01, Math.max(0.01, spherical.phi - turn[1]));
    spherical.radius *= zoom;
    offset.setFromSpherical(spherical).applyQuaternion(toUp.invert());
    const right = new THREE.Vector3().setFromMatrixColumn(this.camera.matrix, 0);
    const up = new THREE.Vector3().setFromMatrixColumn(this.camera.matrix, 1);
    target.addScaledVector(right, move[0] * spherical.radius).addScaledVector(up, move[1] * spherical.radius);
    this.camera.position.copy(target).add(offset);
    this.controls.update();
    this.cameraMoved();
  }

  /** The picture as a PNG. */
  async screenshot(): Promise<Blob> {
    this.drawNow();
    return new Promise((resolve, reject) =>
      this.canvas.toBlob((blob) => (blob ? resolve(blob) : reject(new Error("no picture"))), "image/png"),
    );
  }

  render(): void {
    if (!this.frame) this.frame = requestAnimationFrame((now) => this.draw(now));
    this.tellStill();
  }

  private tellStill(): void {
    this.onStill(this.frame === 0 && !this.changing);
  }

  private makeControls(): OrbitControls {
    const target = this.controls?.target.clone();
    const controls = new OrbitControls(this.camera, this.canvas);
    if (target) controls.target.copy(target);
    controls.rotateSpeed = 0.9;
    controls.zoomToCursor = true;
    controls.addEventListener("change", () => this.cameraMoved());
    return controls;
  }

  private cameraMoved(): void {
    this.moving = true;
    this.touch();
  }

  // Something changes: the picture may be coarse until it rests.
  private touch(): void {
    this.changing = true;
    clearTimeout(this.restTimer);
    this.restTimer = window.setTimeout(() => this.rest(), this.restDelay);
    this.render();
  }

  private rest(): void {
    const moved = this.moving;
    this.moving = this.changing = false;
    this.restDelay = kRestDelay;
    this.lastFrame = -Infinity;
    if (this.fineness < 1 || this.share < 1) this.render();
    this.tellStill();
    if (!moved) return;
    this.view.camera = [...this.camera.position.toArray(), ...this.controls.target.toArray()];
    this.onCamera();
  }

  private resetCamera(): void {
    const { cloud, view } = this;
    if (!cloud) return;
    if (view.camera.length === 6) {
      this.camera.position.fromArray(view.camera);
      this.controls.target.fromArray(view.camera, 3);
    } else {
      const center = new THREE.Vector3().addVectors(
        new THREE.Vector3(...cloud.min), new THREE.Vector3(...cloud.max)).multiplyScalar(0.5);
      const fits = Math.min(1, this.camera.aspect);
      const distance = (0.5 * (cloud.diagonal || 1)) / Math.tan((kFieldOfView * Math.PI) / 360) / fits;
      const direction = view.up === "z" ? new THREE.Vector3(0.45, -0.8, 0.42) : new THREE.Vector3(0.35, 0.25, 0.9);
      this.controls.target.copy(center);
      this.camera.position.copy(center).addScaledVector(direction.normalize(), distance);
    }
    this.controls.update();
    clearTimeout(this.restTimer);
    this.moving = this.changing = false;
    this.render();
  }

  private set(name: string, array: Numbers, size: number, normalized = false): void {
    const old = this.geometry.getAttribute(name) as THREE.BufferAttribute | undefined;
    if (old && old.array.length === array.length && old.array.constructor === array.constructor) {
      old.array = array;
      old.needsUpdate = true;
    } else {
      this.geometry.setAttribute(name, new THREE.BufferAttribute(array, size, normalized));
    }
  }

  private setMotion(): void {
    const name = ["", "along", "move", "far_move"][this.motion];
    if (this.values) this.set(name, this.values, this.motion === 1 ? 1 : 3);
    this.touch();
  }

  private motionNormal(place: number): [number, number, number] | null {
    return this.motionNormals && decodeNormal(this.motionNormals[2 * place], this.motionNormals[2 * place + 1]);
  }

  // Some displacements cannot be said in steps: all become plain numbers.
  private setFar(places: Uint32Array, exceptions: Float32Array): void {
    const far = new Float32Array(3 * this.count);
    for (let place = 0; place < this.count; ++place) far.set(this.displacement(place), 3 * place);
    for (let i = 0; i < places.length; ++i) far.set(exceptions.subarray(3 * i, 3 * i + 3), 3 * places[i]);
    this.values = far;
    this.motion = 3;
  }

  private resize(): void {
    const { clientWidth: width, clientHeight: height } = this.canvas.parentElement!;
    if (!width || !height) return;
    this.renderer.setPixelRatio(Math.min(window.devicePixelRatio, 2));
    this.renderer.setSize(width, height);
    const size = this.renderer.getDrawingBufferSize(new THREE.Vector2());
    this.target.dispose();
    this.target = new THREE.WebGLRenderTarget(size.x, size.y, {
      depthTexture: new THREE.DepthTexture(size.x, size.y, THREE.UnsignedIntType),
      minFilter: THREE.NearestFilter, magFilter: THREE.NearestFilter,
    });
    this.target.scissorTest = true;
    this.screen.uniforms.uColourImage.value = this.target.texture;
    this.screen.uniforms.uDepthImage.value = this.target.depthTexture;
    const fitted = this.cloud !== null && this.view.camera.length === 0;
    this.camera.aspect = width / height;
    this.camera.updateProjectionMatrix();
    if (fitted) this.resetCamera();
    this.drawNow();
  }

  private drawNow(): void {
    cancelAnimationFrame(this.frame);
    this.frame = 0;
    this.draw(performance.now(), true);
  }

  private draw(now: number, whole = false): void {
    this.frame = 0;
    if (this.glide) this.followGlide(now);
    const coarse = this.changing && !whole;
    const start = performance.now();
    this.drawParts(coarse ? this.share : 1, coarse ? this.fineness : 1);
    if (coarse) this.adapt(performance.now() - start, now);
    this.tellStill();
  }

  // The calls return before the picture is there, so between frames of one movement the time from one to the next counts.
  private lastFrame = 0;
  private adapt(spent: number, now: number): void {
    const between = now - this.lastFrame;
    this.lastFrame = now;
    const time = between < kLongestFrame ? Math.max(spent, between) : spent;
    this.restDelay = Math.max(kRestDelay, 2 * time);
    const count = Math.max(1, this.count);
    const least = Math.min(1, Math.max(kMinDrawn / count, this.moving ? 0 : Math.min(kLeastShare, kLeastDrawn / count)));
    if (time > kSlowFrame) {
      const factor = Math.max(0.5, kSlowFrame / time);
      if (this.fineness > kCoarsest) this.fineness = Math.max(kCoarsest, this.fineness * factor);
      else this.share = Math.max(least, this.share * factor);
    } else if (time < kSlowFrame / 2) {
      if (this.share < 1) this.share = Math.min(1, this.share * 1.15);
      else this.fineness = Math.min(1, this.fineness * 1.1);
    }
  }

  private followGlide(now: number): void {
    const { from, to, eye, start } = this.glide!;
    const t = Math.min(1, (now - start) / 220);
    const eased = t * t * (3 - 2 * t);
    this.controls.target.lerpVectors(from, to, eased);
    this.camera.position.copy(eye).add(this.controls.target).sub(from);
    this.controls.update();
    if (t >= 1) this.glide = null;
    this.cameraMoved();
  }

  private drawParts(share: number, fineness: number): void {
    const { renderer, target, camera, view } = this;
    const [width, height] = [target.width, target.height].map((length) => Math.ceil(length * fineness));
    const mode = this.holding ? "before" : view.mode;
    const divider = mode === "side" ? Math.round(width / 2) : mode === "wipe" ? Math.round(width * view.wipe) : 0;
    this.setClipPlanes();
    this.setSizes(share, height);
    camera.aspect = (mode === "side" ? width / 2 : width) / height;
    camera.updateProjectionMatrix();
    renderer.setRenderTarget(target);
    target.viewport.set(0, 0, width, height);
    target.scissor.set(0, 0, width, height);
    renderer.setRenderTarget(target);
    renderer.clear();
    const half = mode === "side" ? divider : width;
    if (mode === "before" || divider > 0) this.drawPart(0, 0, half, 0, divider || width, height);
    if (mode !== "before" && divider < width)
      this.drawPart(1, mode === "side" ? divider : 0, half, divider, width - divider, height);
    renderer.setRenderTarget(null);
    const { uniforms } = this.screen;
    uniforms.uNearFar.value.set(camera.near, camera.far);
    uniforms.uDivider.value = divider;
    uniforms.uRadius.value = Math.max(1, Math.round(renderer.getPixelRatio() * fineness * 1.4));
    uniforms.uFineness.value = fineness;
    uniforms.uSize.value.set(width, height);
    renderer.render(this.screenScene, camera);
    if (this.boxLines.visible) this.drawLines(mode === "side");
    camera.aspect = width / height;
    camera.updateProjectionMatrix();
  }

  private drawLines(side: boolean): void {
    const { x: width, y: height } = this.renderer.getSize(new THREE.Vector2());
    for (const left of side ? [0, width / 2] : [0]) {
      this.renderer.setViewport(left, 0, side ? width / 2 : width, height);
      this.renderer.render(this.lineScene, this.camera);
    }
    this.renderer.setViewport(0, 0, width, height);
  }

  private drawPart(after: number, left: number, width: number, from: number, shown: number, height: number): void {
    const { target } = this;
    target.viewport.set(left, 0, width, height);
    target.scissor.set(from, 0, shown, height);
    this.renderer.setRenderTarget(target);
    const { uniforms } = this.material;
    uniforms.uAfter.value = after;
    uniforms.uMotion.value = this.motion;
    uniforms.uStep.value = this.step;
    this.material.uniformsNeedUpdate = true;
    this.renderer.render(this.pointScene, this.camera);
  }

  private setClipPlanes(): void {
    const { cloud, camera } = this;
    if (!cloud) return;
    const center = new THREE.Vector3(...cloud.min).add(new THREE.Vector3(...cloud.max)).multiplyScalar(0.5);
    const radius = 0.55 * (cloud.diagonal || 1);
    const distance = camera.position.distanceTo(center);
    camera.near = Math.max(distance - radius, (cloud.diagonal || 1) * 5e-4);
    camera.far = Math.max(distance + radius, camera.near * 2);
    camera.updateMatrixWorld();
  }

  // Points grow as fewer are drawn, so that the surface stays closed.
  private setSizes(share: number, height: number): void {
    const { uniforms } = this.material;
    const cloud = this.cloud;
    if (!cloud) return;
    const drawn = Math.ceil(share * this.count);
    this.geometry.setDrawRange(0, drawn);
    const thinning = Math.sqrt(cloud.points / Math.max(1, drawn));
    uniforms.uPointSize.value = this.view.size * (cloud.spacing || cloud.diagonal / 500 || 1) * thinning;
    uniforms.uPixelsPerUnit.value = height / (2 * Math.tan((kFieldOfView * Math.PI) / 360));
    uniforms.uMaxSize.value = (24 * height) / this.canvas.clientHeight;
    const pixels = (uniforms.uPointSize.value * uniforms.uPixelsPerUnit.value) /
      Math.max(1e-20, this.camera.position.distanceTo(this.controls.target));
    const defines: Record<string, string> = pixels >= kRoundFrom ? { ROUND: "" } : {};
    if ("ROUND" in this.material.defines !== "ROUND" in defines) {
      this.material.defines = defines;
      this.material.needsUpdate = true;
    }
  }
}

const clampSteps = (steps: number) => Math.round(Math.min(32767, Math.max(-32767, steps)));

function pointMaterial(): THREE.RawShaderMaterial {
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
      uPixelsPerUnit: { value: 1 }, uMaxSize: { value: 24 }, uShade: { value: 1 }, uColour: { value: 0 },
      uRange: { value: new THREE.Vector2(0, 1) }, uHeightAxis: { value: new THREE.Vector3(0, 0, 1) },
      uMap: { value: map }, uBoxMin: { value: new THREE.Vector3() }, uBoxMax: { value: new THREE.Vector3() },
      uHide: { value: false }, uHasNormals: { value: false }, uDim: { value: false },
    },
  });
}

function screenMaterial(): THREE.RawShaderMaterial {
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
