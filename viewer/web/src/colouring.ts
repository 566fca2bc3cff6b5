// SPDX-License-Identifier: Apache-2.0
// What the points are coloured by, with the legend that says so.

import { binned, localRms, type MapName, quantileRange, type Spread } from "./colours";
import type { Legend } from "./legend";
import type { CloudHead, Numbers } from "./protocol";
import type { Scene } from "./scene";

const kRmsCell = 6; // spacings
const kQuickRms = 200000; // up to so many points it is computed while a slider moves; of more once it rests
const kRmsDelay = 400; // ms
const kPrefix = "attribute:"; // of the choices that are the file's own

export class Colouring {
  private cloud: CloudHead | null = null;
  private rms = 0; // of the displacements
  private choice = "plain";
  private has: Record<string, "asked" | "here"> = {}; // colours of the file
  private scalar: Float32Array = new Float32Array(); // of the attribute that is here
  private timer = 0;

  /** `ask` sends for colours of the file. */
  constructor(private readonly scene: Scene, private readonly legend: Legend, private readonly ask: (name: string) => void) {}

  setCloud(cloud: CloudHead): void {
    this.cloud = cloud;
    this.rms = 0;
    this.has = {};
  }

  /** Displacements have come. */
  setMoved(rms: number): void {
    this.rms = rms;
    if (["displacement", "rms", "height"].includes(this.choice)) this.apply(this.choice);
  }

  /** Colours of the file have come. */
  setColours(name: string, arrays: Record<string, Numbers>): void {
    const choice = arrays.rgb ? "rgb" : kPrefix + name;
    if (arrays.rgb) this.scene.setColours(arrays.rgb as Uint8Array);
    else {
      this.forgetScalar();
      this.scalar = arrays.scalar as Float32Array;
      this.scene.setScalar(this.scalar);
    }
    this.has[choice] = "here";
    if (this.choice === choice) this.apply(choice);
  }

  apply(choice: string): void {
    this.choice = choice;
    clearTimeout(this.timer);
    if (!this.cloud) return;
    if (choice === "displacement") return this.showDisplacement(this.cloud);
    if (choice === "height") return this.show("height", "sequential", this.spread((place) => this.scene.height(place)), "height");
    if (choice === "rms") return this.showRmsSoon(this.cloud);
    if (choice === "rgb" || choice.startsWith(kPrefix)) return this.showOwn(choice);
    this.legend.hide();
    this.scene.setColourMode(choice === "normal" ? "normal" : "plain", [0, 1], "sequential");
  }

  private showDisplacement(cloud: CloudHead): void {
    const most = 2.5 * (this.rms || cloud.spacing || 1);
    const spread = binned((place) => this.scene.signedDisplacement(place), this.scene.count, [-most, most]);
    this.show("displacement", "diverging", spread, "displacement (+ toward you)");
  }

  private showRmsSoon(cloud: CloudHead): void {
    if (this.scene.count <= kQuickRms) return this.showRms(cloud);
    this.timer = window.setTimeout(() => this.showRms(cloud), kRmsDelay);
  }

  private showRms(cloud: CloudHead): void {
    const squared = (place: number) => {
      const [x, y, z] = this.scene.displacement(place);
      return x * x + y * y + z * z;
    };
    const rms = localRms(this.scene.allPositions, squared, kRmsCell * (cloud.spacing || 1));
    this.forgetScalar();
    this.scene.setScalar(rms);
    this.show("scalar", "sequential", this.spread((place) => rms[place]), "rms displacement nearby");
  }

  private showOwn(choice: string): void {
    if (this.has[choice] === "here") {
      if (choice !== "rgb")
        return this.show("scalar", "sequential", this.spread((place) => this.scalar[place]), choice.slice(kPrefix.length));
      this.legend.hide();
      return this.scene.setColourMode("rgb", [0, 1], "sequential");
    }
    this.legend.hide();
    if (this.has[choice]) return;
    this.has[choice] = "asked";
    this.ask(choice === "rgb" ? "rgb" : choice.slice(kPrefix.length));
  }

  // The scene has room for one.
  private forgetScalar(): void {
    for (const other of Object.keys(this.has)) if (other !== "rgb") delete this.has[other];
  }

  private spread(value: (place: number) => number): Spread {
    return binned(value, this.scene.count, quantileRange(value, this.scene.count));
  }

  private show(mode: "displacement" | "height" | "scalar", map: MapName, spread: Spread, title: string): void {
    this.scene.setColourMode(mode, spread.range, map);
    this.legend.show(title, map, spread);
  }
}
