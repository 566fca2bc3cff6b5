// SPDX-License-Identifier: Apache-2.0
// What the pointer finds in the picture: the pivot, the value of a point, and the distance between two.

import type { Colouring } from "./colouring";
import { lengthInWords, short } from "./dom";
import type { CloudHead } from "./protocol";
import type { Scene } from "./scene";
import type { Stage } from "./stage";

const kPointerRest = 120; // ms
const kReadoutReach = 0.02; // of the picture's height
const kToastOfDistance = 15000; // ms

export class Pointer {
  private cloud: CloudHead | null = null;
  private timer = 0;
  private measured: ReturnType<Scene["position"]>[] | null = null; // points of a distance; null: none is measured

  constructor(
    private readonly scene: Scene,
    private readonly stage: Stage,
    private readonly colouring: Colouring,
  ) {
    scene.canvas.addEventListener("dblclick", (event) => this.pivot(event));
    scene.canvas.addEventListener("click", (event) => this.measureAt(event));
    scene.canvas.addEventListener("pointermove", (event) => this.showUnder(event));
    scene.canvas.addEventListener("pointerleave", () => stage.showReadout(""));
    window.addEventListener("keydown", (event) => this.measureWithKeys(event));
  }

  setCloud(cloud: CloudHead | null): void {
    this.cloud = cloud;
    this.scene.setDistance([]);
  }

  // The next two points that are clicked.
  measure(): void {
    this.measured = [];
    this.scene.setDistance([]);
    this.stage.showHint("Click two points to measure their distance, or press Enter for the one in the middle. Escape cancels.");
    this.showCross();
  }

  private measureAt(event: MouseEvent): void {
    if (!this.measured || !this.cloud) return;
    this.measureFrom(this.placeUnder(event));
  }

  // The middle of the picture is marked while keys choose points.
  private showCross(): void {
    this.stage.element.classList.toggle("measuring", this.measured !== null);
  }

  private measureFrom(place: number): void {
    if (place < 0 || !this.measured || !this.cloud) return;
    this.measured.push(this.scene.position(place));
    this.scene.setDistance(this.measured);
    if (this.measured.length < 2) return this.stage.showHint("Now the second point. Escape cancels.");
    const distance = lengthInWords(this.measured[0].distanceTo(this.measured[1]), this.cloud.metres_per_unit);
    this.measured = null;
    this.showCross();
    document.body.dataset.distance = distance;
    this.stage.showHint("");
    this.stage.say(`Distance in the original: ${distance}`, false, kToastOfDistance);
  }

  private measureWithKeys(event: KeyboardEvent): void {
    if (event.key === "Escape") this.scene.setDistance([]);
    if (!this.measured) return;
    if (event.key === "Enter" && event.target === this.scene.canvas) return this.measureFrom(this.scene.pickPlace(0, 0));
    if (event.key !== "Escape") return;
    this.measured = null;
    this.showCross();
    this.stage.showHint("");
  }

  // The place that is under the pointer; -1 where none is.
  private placeUnder(event: MouseEvent, reach?: number): number {
    const box = this.scene.canvas.getBoundingClientRect();
    return this.scene.pickPlace(...this.scene.inPicture(
      [((event.clientX - box.left) / box.width) * 2 - 1, 1 - ((event.clientY - box.top) / box.height) * 2]), reach);
  }

  private pivot(event: MouseEvent): void {
    const place = this.placeUnder(event);
    if (place >= 0) this.scene.pivot(this.scene.position(place));
  }

  // Where the pointer rests, the point there says where it is and what it is coloured by.
  private showUnder(event: PointerEvent): void {
    clearTimeout(this.timer);
    this.stage.showReadout("");
    if (event.buttons || !this.cloud) return;
    this.timer = window.setTimeout(() => {
      const place = this.cloud ? this.placeUnder(event, kReadoutReach) : -1;
      if (place < 0) return;
      const value = this.colouring.valueAt(place);
      const at = this.filePosition(place).map((c) => short(c, 9)).join("  ");
      this.stage.showReadout(value ? `${value} · ${at}` : at);
    }, kPointerRest);
  }

  private filePosition(place: number): number[] {
    return this.scene.position(place).toArray().map((c, axis) => c + this.cloud!.origin[axis]);
  }
}
