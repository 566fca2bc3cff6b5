// SPDX-License-Identifier: Apache-2.0
// The camera, what the pointer and the keys do to it, and how it fits a cloud.

import * as THREE from "three";
import { OrbitControls } from "three/addons/controls/OrbitControls.js";
import type { CloudHead } from "./protocol";

const kFieldOfView = 40;
const kGlide = 220; // ms

const kFrontY = new THREE.Vector3(0.35, 0.25, 0.9); // where one looks from, by which axis is up
const kFrontZ = new THREE.Vector3(0.45, -0.8, 0.42);
const kFitSample = 4000;
const kFitted = 0.995; // of the points
const kFew = 100; // points, of which none may lie outside
const kMargin = 1.18;
const kRounds = 4;

export const pixelsPerUnit = (height: number) => height / (2 * Math.tan((kFieldOfView * Math.PI) / 360));

export class Eye {
  readonly camera = new THREE.PerspectiveCamera(kFieldOfView, 1, 0.01, 100);
  private controls: OrbitControls;
  private glide: { from: THREE.Vector3; to: THREE.Vector3; eye: THREE.Vector3; start: number } | null = null;

  constructor(private readonly canvas: HTMLCanvasElement, private readonly moved: () => void) {
    this.controls = this.makeControls();
  }

  get target(): THREE.Vector3 {
    return this.controls.target;
  }

  get distance(): number {
    return this.camera.position.distanceTo(this.controls.target);
  }

  /** Position and target. */
  get numbers(): number[] {
    return [...this.camera.position.toArray(), ...this.controls.target.toArray()];
  }

  /** From offsets of the cloud's origin to the picture. */
  get matrix(): THREE.Matrix4 {
    this.camera.updateMatrixWorld();
    return new THREE.Matrix4().multiplyMatrices(this.camera.projectionMatrix, this.camera.matrixWorldInverse);
  }

  setAspect(aspect: number): void {
    this.camera.aspect = aspect;
    this.camera.updateProjectionMatrix();
  }

  /** Whether zooming goes to the pointer or to the middle. */
  set zoomsToPointer(yes: boolean) {
    this.controls.zoomToCursor = yes;
  }

  setUp(up: THREE.Vector3): void {
    if (this.camera.up.equals(up)) return;
    this.camera.up.copy(up);
    this.controls.dispose();
    this.controls = this.makeControls();
  }

  /** Goes to a place that `numbers` gave. */
  place(numbers: number[]): void {
    this.camera.position.fromArray(numbers);
    this.controls.target.fromArray(numbers, 3);
    this.controls.update();
  }

  /**
   * Sees the cloud from the front and a little from above, in a picture of this aspect. What is far from nearly all other
   * points may lie outside. `positions` are relative to the origin, x, y, z each.
   */
  fit(positions: Float32Array, cloud: CloudHead, aspect: number): void {
    const { camera, target } = this;
    const sample = finiteSample(positions);
    target.copy(middle(sample) ?? centerOf(cloud));
    camera.position.copy(target).add(camera.up.z > 0.5 ? kFrontZ : kFrontY);
    camera.lookAt(target);
    camera.updateMatrixWorld();
    const turned = sample.map((at) => at.sub(target).applyQuaternion(camera.quaternion.clone().invert()));
    const { distance, x, y } = framing(turned, aspect);
    const shift = new THREE.Vector3(x, y, 0).applyQuaternion(camera.quaternion);
    camera.position.sub(target).setLength(distance || 1.4 * (cloud.diagonal || 1)).add(target.add(shift));
    this.controls.update();
  }

  /** Makes a place the point that the camera turns about, gliding there. */
  pivot(at: THREE.Vector3): void {
    this.glide = { from: this.target.clone(), to: at, eye: this.camera.position.clone(), start: performance.now() };
  }

  /** Before a frame. */
  advance(now: number): void {
    if (!this.glide) return;
    const { from, to, eye, start } = this.glide;
    const t = Math.min(1, Math.max(0, (now - start) / kGlide));
    this.target.lerpVectors(from, to, t * t * (3 - 2 * t));
    this.camera.position.copy(eye).add(this.target).sub(from);
    this.controls.update();
    if (t >= 1) this.glide = null;
    this.moved();
  }

  /** Turns by angles, moves by shares of the distance, or zooms by a factor: what keys ask for. */
  nudge(turn: [number, number], move: [number, number], zoom: number): void {
    const { camera, target } = this;
    const offset = camera.position.clone().sub(target);
    const toUp = new THREE.Quaternion().setFromUnitVectors(camera.up, new THREE.Vector3(0, 1, 0));
    const spherical = new THREE.Spherical().setFromVector3(offset.applyQuaternion(toUp));
    spherical.theta -= turn[0];
    spherical.phi = Math.min(Math.PI - 0.01, Math.max(0.01, spherical.phi - turn[1]));
    spherical.radius *= zoom;
    offset.setFromSpherical(spherical).applyQuaternion(toUp.invert());
    const right = new THREE.Vector3().setFromMatrixColumn(camera.matrix, 0);
    const up = new THREE.Vector3().setFromMatrixColumn(camera.matrix, 1);
    target.addScaledVector(right, move[0] * spherical.radius).addScaledVector(up, move[1] * spherical.radius);
    camera.position.copy(target).add(offset);
    this.controls.update();
    this.moved();
  }

  /** Between which distances the cloud lies. */
  setClipPlanes(cloud: CloudHead): void {
    const { camera } = this;
    const size = cloud.diagonal || 1;
    const distance = camera.position.distanceTo(centerOf(cloud));
    camera.near = Math.max(distance - 0.55 * size, size * 5e-4);
    camera.far = Math.max(distance + 0.55 * size, camera.near * 2);
    camera.updateMatrixWorld();
  }

  private makeControls(): OrbitControls {
    const target = this.controls?.target.clone();
    const controls = new OrbitControls(this.camera, this.canvas);
    if (target) controls.target.copy(target);
    controls.rotateSpeed = 0.9;
    controls.zoomToCursor = true;
    controls.addEventListener("change", () => this.moved());
    return controls;
  }
}

const centerOf = ({ min, max }: CloudHead) => new THREE.Vector3(...min).add(new THREE.Vector3(...max)).multiplyScalar(0.5);

function finiteSample(positions: Float32Array): THREE.Vector3[] {
  const stride = Math.max(1, Math.floor(positions.length / 3 / kFitSample));
  const sample: THREE.Vector3[] = [];
  for (let i = 0; 3 * i < positions.length; i += stride) {
    const at = new THREE.Vector3().fromArray(positions, 3 * i);
    if (Number.isFinite(at.x + at.y + at.z)) sample.push(at);
  }
  return sample;
}

function quantile(values: number[], share: number): number | undefined {
  const at = share * (values.length - 1);
  return values.sort((a, b) => a - b)[values.length < kFew ? Math.round(at) : Math.floor(at)];
}

// From how far, and how far aside, a camera that looks along -z sees nearly all of the points in the middle of its picture.
function framing(points: THREE.Vector3[], aspect: number): { distance: number; x: number; y: number } {
  const tangent = Math.tan((kFieldOfView * Math.PI) / 360);
  const frame = { distance: 0, x: 0, y: 0 };
  for (let round = 0; round < kRounds && points.length; ++round) {
    // how far away a point lies inside the picture's edges
    const needed = points.map(({ x, y, z }) =>
      Math.max(Math.abs(x - frame.x) / (tangent * aspect), Math.abs(y - frame.y) / tangent) + z);
    frame.distance = kMargin * quantile(needed, kFitted)!;
    for (const axis of ["x", "y"] as const) {
      const slopes = points.map((at) => (at[axis] - frame[axis]) / Math.max(1e-30, frame.distance - at.z));
      frame[axis] += (frame.distance * (quantile(slopes, 1 - kFitted)! + quantile(slopes, kFitted)!)) / 2;
    }
  }
  return frame;
}

// Of the box that holds nearly all.
function middle(sample: THREE.Vector3[]): THREE.Vector3 | null {
  if (!sample.length) return null;
  const [x, y, z] = (["x", "y", "z"] as const).map((axis) => {
    const values = sample.map((at) => at[axis]);
    return (quantile(values, 1 - kFitted)! + quantile(values, kFitted)!) / 2;
  });
  return new THREE.Vector3(x, y, z);
}
