// SPDX-License-Identifier: Apache-2.0
// The box and the lasso in the picture: which points they let move.

import type { CloudHead, Texts } from "./protocol";
import { fileCamera, insideMask, lassoText, parseBox, parseLasso } from "./region";
import type { Scene } from "./scene";

export class ShownLimits {
  private shown = "";

  constructor(private readonly scene: Scene) {}

  /** Another cloud shows nothing yet. */
  forget(): void {
    this.shown = "";
  }

  show(limits: Texts, cloud: CloudHead): void {
    const key = `${limits.box}|${limits.lasso}`;
    if (key === this.shown) return;
    this.shown = key;
    const [box, lasso] = [parseBox(limits.box ?? ""), parseLasso(limits.lasso ?? "")];
    this.scene.setBox(box);
    this.scene.setInside(box || lasso ? insideMask(this.scene.allPositions, cloud.origin, box, lasso) : null);
  }

  /** A polygon of the picture as the limit that it is from where the camera stands. */
  lassoOf(polygon: [number, number][]): string {
    const { elements, origin } = this.scene.fileMatrix;
    return lassoText({ camera: fileCamera(elements, origin), polygon });
  }
}
