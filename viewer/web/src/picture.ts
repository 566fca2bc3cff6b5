// SPDX-License-Identifier: Apache-2.0
// Draws: points into an image with depth, as the original, as the result, or as both beside each other, in as many portions
// as wanted; then that image, lit by depth, onto the screen.

import * as THREE from "three";
import { type Colours, mapTexels } from "./colours";
import type { CloudPoints } from "./cloud_points";
import { type Eye, pixelsPerUnit } from "./eye";
import { pointMaterial, screenMaterial } from "./materials";
import { kMotion, type Motion } from "./motion";
import type { Box } from "./region";
import { kColourModes } from "./shaders";
import type { Draw, Mode } from "./state";

export type ColourMode = keyof typeof kColourModes;
const kRoundFrom = 4.5; // pixels; smaller points are squares
const kToneUnderEdges = 0.22; // of the faces of a wireframe, so that edges behind are hidden
const kLookAgain = 3; // ms between looks whether a frame is there
const kEndOfDistance = 7; // pixels of the screen
const kSmallestPoint = 1.7, kLargestPoint = 40; // pixels of the screen

/** What is drawn, and how. */
export interface Shot {
  mode: Mode;
  wipe: number; // share of the width that shows the original
  fineness: number; // pixels of the image a pixel of the screen
  pointSize: number; // file units
  partSize: number; // of the points of a part
  exaggerate: number; // factor on displacements
  draw: Draw;
}

export class Picture {
  readonly canvas: HTMLCanvasElement;
  readonly material = pointMaterial();
  private readonly renderer: THREE.WebGLRenderer;
  private readonly screen = screenMaterial();
  private readonly pointScene = new THREE.Scene();
  private readonly partScene = new THREE.Scene();
  private readonly screenScene = new THREE.Scene();
  private readonly lineScene = new THREE.Scene();
  private readonly fillScene = new THREE.Scene();
  private readonly edgeScene = new THREE.Scene();
  private readonly boxLines: THREE.LineSegments;
  private readonly distanceLine = new THREE.Line(new THREE.BufferGeometry(),
    new THREE.LineBasicMaterial({ color: 0xffd166, depthTest: false }));
  private readonly distanceEnds = new THREE.Points(this.distanceLine.geometry,
    new THREE.PointsMaterial({ color: 0xffd166, size: kEndOfDistance, sizeAttenuation: false, depthTest: false }));
  private target = new THREE.WebGLRenderTarget(1, 1);

  constructor() {
    const canvas = document.createElement("canvas");
    const context = canvas.getContext("webgl2", { alpha: false, antialias: false, depth: false, powerPreference: "high-performance" });
    if (!context) throw new Error("this browser has no WebGL 2");
    this.renderer = new THREE.WebGLRenderer({ canvas, context });
    this.renderer.autoClear = false;
    this.renderer.sortObjects = false; // which would ask for a bounding sphere of points that may be NaN
    this.renderer.outputColorSpace = THREE.LinearSRGBColorSpace; // the shaders write what the screen shows
    this.canvas = this.renderer.domElement;
    const quad = new THREE.Mesh(new THREE.PlaneGeometry(2, 2), this.screen);
    quad.frustumCulled = false;
    this.screenScene.add(quad);
    this.boxLines = new THREE.LineSegments(
      new THREE.EdgesGeometry(new THREE.BoxGeometry(1, 1, 1)),
      new THREE.LineBasicMaterial({ color: 0x55cdb9, transparent: true, opacity: 0.9, depthTest: false }),
    );
    this.boxLines.visible = false;
    this.lineScene.add(this.boxLines);
    this.setDistance([]);
    for (const object of [this.distanceLine, this.distanceEnds]) {
      object.frustumCulled = false;
      this.lineScene.add(object);
    }
  }

  setPoints({ all, part, surface }: CloudPoints): void {
    this.fillScene.add(surface.fill);
    this.edgeScene.add(surface.lines);
    this.pointScene.add(all);
    this.partScene.add(part);
  }

  resize(width: number, height: number): void {
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
  }

  /** The box, relative to the origin; null for none. */
  setBox(box: Box | null): void {
    this.boxLines.visible = box !== null;
    if (!box) return;
    const [low, high] = [new THREE.Vector3(...box.min), new THREE.Vector3(...box.max)];
    this.boxLines.position.addVectors(low, high).multiplyScalar(0.5);
    this.boxLines.scale.subVectors(high, low);
    this.material.uniforms.uBoxMin.value.copy(low);
    this.material.uniforms.uBoxMax.value.copy(high);
  }

  /** The points between which a line is drawn, over all others: none, one or two, relative to the origin. */
  setDistance(ends: THREE.Vector3[]): void {
    this.distanceLine.visible = ends.length > 1;
    this.distanceEnds.visible = ends.length > 0;
    this.distanceLine.geometry.setAttribute("position", new THREE.Float32BufferAttribute(ends.flatMap((end) => end.toArray()), 3));
  }

  setLook(shade: number, edl: number, hide: boolean, up: THREE.Vector3): void {
    const { uniforms } = this.material;
    uniforms.uShade.value = shade;
    uniforms.uHide.value = hide && this.boxLines.visible;
    uniforms.uHeightAxis.value.copy(up);
    this.screen.uniforms.uStrength.value = edl;
  }

  setColourMode(mode: ColourMode, range: [number, number], map: Colours): void {
    const { uniforms } = this.material;
    uniforms.uColour.value = kColourModes[mode];
    uniforms.uRange.value.set(range[0], range[1]);
    uniforms.uMap.value.image.data.set(mapTexels(map));
    uniforms.uMap.value.needsUpdate = true;
  }

  /** Pixels that a side of a picture on faces may have. */
  get mostOfSide(): number {
    return this.renderer.capabilities.maxTextureSize;
  }

  /** Begins an image. */
  clear(): void {
    this.aim(0, 0, this.target.width, this.target.height);
    this.renderer.clear();
  }

  /** Adds the points of the places [from, from + count) to the image, and after them the part. */
  draw(points: CloudPoints, motion: Motion, eye: Eye, shot: Shot, from: number, count: number, withPart: boolean): void {
    const [width, height] = this.sizeOf(shot);
    const divider = this.dividerOf(shot, width);
    const beside = shot.mode === "side";
    this.setSizes(shot, eye, height);
    points.all.geometry.setDrawRange(from, count);
    eye.setAspect((beside ? width / 2 : width) / height);
    const half = beside ? divider : width;
    const draw = (after: number) => {
      if (shot.draw !== "points") return this.drawFaces(points, motion, eye, after, shot);
      this.drawAll(points, motion, eye, after, shot.pointSize);
      if (withPart && points.ball) this.drawPart(motion, eye, after, shot.partSize);
    };
    if (shot.mode === "before" || divider > 0) {
      this.aim(0, 0, half, height, 0, divider || width);
      draw(0);
    }
    if (shot.mode !== "before" && divider < width) {
      this.aim(beside ? divider : 0, 0, half, height, divider, width - divider);
      draw(shot.exaggerate);
    }
    eye.setAspect(width / height);
  }

  /** Brings the image onto the screen. */
  show(eye: Eye, shot: Shot): void {
    const [width, height] = this.sizeOf(shot);
    const { uniforms } = this.screen;
    uniforms.uNearFar.value.set(eye.camera.near, eye.camera.far);
    uniforms.uDivider.value = this.dividerOf(shot, width);
    uniforms.uRadius.value = Math.max(1, Math.round(this.renderer.getPixelRatio() * shot.fineness * 1.4));
    uniforms.uFineness.value = shot.fineness;
    uniforms.uSize.value.set(width, height);
    this.renderer.setRenderTarget(null);
    this.renderer.render(this.screenScene, eye.camera);
    if (this.boxLines.visible || this.distanceEnds.visible) this.drawLines(eye, shot.mode === "side");
  }

  /** Resolves once all that was drawn is there, with the milliseconds from now until then. */
  finished(): Promise<number> {
    const gl = this.renderer.getContext() as WebGL2RenderingContext;
    const start = performance.now();
    const fence = gl.fenceSync(gl.SYNC_GPU_COMMANDS_COMPLETE, 0);
    return new Promise((resolve) => {
      const look = () => {
        const state = fence && gl.clientWaitSync(fence, gl.SYNC_FLUSH_COMMANDS_BIT, 0);
        if (state === gl.TIMEOUT_EXPIRED) return void setTimeout(look, kLookAgain);
        gl.deleteSync(fence);
        resolve(performance.now() - start);
      };
      setTimeout(look);
    });
  }

  /** What is on the screen, as a PNG. Only right after show(). */
  async png(): Promise<Blob> {
    return new Promise((resolve, reject) =>
      this.canvas.toBlob((blob) => (blob ? resolve(blob) : reject(new Error("no picture"))), "image/png"),
    );
  }

  private sizeOf({ fineness }: Shot): [number, number] {
    return [Math.ceil(this.target.width * fineness), Math.ceil(this.target.height * fineness)];
  }

  private dividerOf({ mode, wipe }: Shot, width: number): number {
    return mode === "side" ? Math.round(width / 2) : mode === "wipe" ? Math.round(width * wipe) : 0;
  }

  // Draws into a part of the image, and cuts it to [left, left + shown) in x.
  private aim(x: number, y: number, width: number, height: number, left = x, shown = width): void {
    this.target.viewport.set(x, y, width, height);
    this.target.scissor.set(left, y, shown, height);
    this.renderer.setRenderTarget(this.target);
  }

  private drawAll(points: CloudPoints, motion: Motion, eye: Eye, after: number, size: number): void {
    const { ball } = points;
    this.material.uniforms.uHole.value.set(...(ball?.center ?? [0, 0, 0]), ball ? ball.radius : -1);
    this.drawScene(this.pointScene, eye, after, motion.kind, motion.step, size);
  }

  private drawFaces({ surface }: CloudPoints, motion: Motion, eye: Eye, after: number, shot: Shot): void {
    const { uniforms } = this.material;
    const kind = surface.hasOwnMotion ? kMotion.far : motion.kind;
    uniforms.uSmooth.value = shot.draw === "smooth";
    uniforms.uTone.value = shot.draw === "wireframe" ? kToneUnderEdges : 1;
    surface.refresh();
    this.drawScene(this.fillScene, eye, after, kind, motion.step, shot.pointSize);
    if (shot.draw === "wireframe") this.drawScene(this.edgeScene, eye, after, kind, motion.step, shot.pointSize);
  }

  private drawPart(motion: Motion, eye: Eye, after: number, size: number): void {
    this.material.uniforms.uHole.value.w = -1;
    this.drawScene(this.partScene, eye, after, kMotion.far, motion.step, size);
  }

  private drawScene(scene: THREE.Scene, eye: Eye, after: number, motion: number, step: number, size: number): void {
    const { uniforms } = this.material;
    uniforms.uAfter.value = after;
    uniforms.uMotion.value = motion;
    uniforms.uStep.value = step;
    uniforms.uPointSize.value = size;
    this.material.uniformsNeedUpdate = true;
    this.renderer.render(scene, eye.camera);
  }

  private setSizes({ pointSize }: Shot, eye: Eye, height: number): void {
    const { uniforms } = this.material;
    uniforms.uPixelsPerUnit.value = pixelsPerUnit(height);
    uniforms.uMinSize.value = (kSmallestPoint * height) / this.canvas.clientHeight;
    uniforms.uMaxSize.value = (kLargestPoint * height) / this.canvas.clientHeight;
    const pixels = (pointSize * uniforms.uPixelsPerUnit.value) / Math.max(1e-20, eye.distance);
    const defines: Record<string, string> = pixels >= kRoundFrom ? { ROUND: "" } : {};
    if ("ROUND" in this.material.defines !== "ROUND" in defines) {
      this.material.defines = defines;
      this.material.needsUpdate = true;
    }
  }

  private drawLines(eye: Eye, beside: boolean): void {
    const { x: width, y: height } = this.renderer.getSize(new THREE.Vector2());
    const half = beside ? width / 2 : width;
    eye.setAspect(half / height);
    for (const left of beside ? [0, half] : [0]) {
      this.renderer.setViewport(left, 0, half, height);
      this.renderer.render(this.lineScene, eye.camera);
    }
    eye.setAspect(width / height);
    this.renderer.setViewport(0, 0, width, height);
  }
}
