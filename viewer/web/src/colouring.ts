// SPDX-License-Identifier: Apache-2.0
// What the points are coloured by, with the legend that says so.

import { kindColour, kindName, kindsOf } from "./categories";
import { binned, type Kind, localRms, type MapName, quantileRange, type Spread } from "./colours";
import { lengthInWords, short } from "./dom";
import type { Legend } from "./legend";
import type { CloudHead, Numbers } from "./protocol";
import type { Scene } from "./scene";

const kRmsCell = 6; // spacings
const kQuickRms = 200000; // up to so many points it is computed while a slider moves; of more once it rests
const kRmsDelay = 400; // ms
const kPrefix = "attribute:"; // of the choices that are the file's own
const kNoiseTitle = "noise (standard deviation)";
const kOutliersTitle = "outliers of this run";

export class Colouring {
  private cloud: CloudHead | null = null;
  private rms = 0; // of the displacements
  private choice = "plain";
  private has: Record<string, "asked" | "here"> = {}; // what the server sends: colours of the file, and the noise
  private scalar: Float32Array = new Float32Array(); // of the attribute that is here, or the noise
  private timer = 0;

  /** `askColours` sends for colours of the file, `askTexture` for the pictures of its faces, `askNoise` for the noise at each point, `askOutliers` for the reasons of the last run's. */
  constructor(
    private readonly scene: Scene,
    private readonly legend: Legend,
    private readonly askColours: (name: string) => void,
    private readonly askTexture: () => void,
    private readonly askNoise: () => void,
    private readonly askOutliers: () => void,
  ) {}

  setCloud(cloud: CloudHead): void {
    this.cloud = cloud;
    this.rms = 0;
    this.has = {};
  }

  /** Displacements have come. */
  setMoved(rms: number): void {
    this.rms = rms;
    delete this.has.outliers;
    if (this.choice === "outliers") return this.showOutliersSoon();
    if (["displacement", "rms", "height"].includes(this.choice)) this.apply(this.choice);
  }

  /** Colours of the file have come, or the noise. */
  setColours(name: string, arrays: Record<string, Numbers>): void {
    const choice = arrays.rgb ? "rgb" : arrays.noise ? "noise" : arrays.outliers ? "outliers" : kPrefix + name;
    if (arrays.rgb) this.scene.setColours(arrays.rgb as Uint8Array);
    else {
      this.forgetScalar();
      this.scalar = (arrays.noise ?? arrays.outliers ?? arrays.scalar) as Float32Array;
      this.scene.setScalar(this.scalar);
    }
    this.has[choice] = "here";
    if (this.choice === choice) this.apply(choice);
  }

  /** The pictures of the faces have come, as far as there are some. */
  setTexture(): void {
    this.has.texture = "here";
    if (this.choice === "texture") this.apply("texture");
  }

  apply(choice: string): void {
    this.choice = choice;
    clearTimeout(this.timer);
    if (!this.cloud) return;
    if (choice === "displacement") return this.showDisplacement(this.cloud);
    if (choice === "height") return this.show("height", "sequential", this.spread((place) => this.scene.height(place)), "height", true);
    if (choice === "rms") return this.showRmsSoon(this.cloud);
    if (choice === "texture" || choice === "rgb" || choice === "noise" || choice === "outliers" || choice.startsWith(kPrefix)) return this.showSent(choice);
    this.legend.hide();
    this.scene.setColourMode(choice === "normal" ? "normal" : "plain", [0, 1], "sequential");
  }

  private showDisplacement(cloud: CloudHead): void {
    // of so many points that the longest moves, which are few, do not make all others pale
    const length = (place: number) => Math.abs(this.scene.signedDisplacement(place));
    // and 7.1 times the rms bounds that quantile, where what the page holds are steps that small moves do not reach
    const most = this.rms > 0 ? Math.min(7.1 * this.rms, quantileRange(length, this.scene.count, "amount")[1]) : cloud.spacing || 1;
    const spread = binned((place) => this.scene.signedDisplacement(place), this.scene.count, [-most, most]);
    this.show("displacement", "diverging", spread, "displacement (+ toward you)", true);
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
    this.show("scalar", "sequential", this.spread((place) => rms[place], "amount"), "rms displacement nearby", true);
  }

  // A run that comes soon has others.
  private showOutliersSoon(): void {
    clearTimeout(this.timer);
    this.timer = window.setTimeout(() => this.showSent("outliers"), kRmsDelay);
  }

  private showSent(choice: string): void {
    const name = choice === "noise" ? kNoiseTitle : choice === "outliers" ? kOutliersTitle : choice.slice(kPrefix.length);
    if (this.has[choice] === "here") {
      const kinds = this.kindsIn(choice);
      if (kinds) return this.showKinds(kinds, name);
      const isNoise = choice === "noise";
      if (choice !== "rgb" && choice !== "texture")
        return this.show("scalar", "sequential", this.spread((place) => this.scalar[place], isNoise ? "level" : "any"), name, isNoise);
      this.legend.hide();
      return this.scene.setColourMode(choice, [0, 1], "sequential");
    }
    this.legend.hide();
    if (this.has[choice]) return;
    this.has[choice] = "asked";
    if (choice === "texture") this.askTexture();
    else if (choice === "noise") this.askNoise();
    else if (choice === "outliers") this.askOutliers();
    else this.askColours(choice === "rgb" ? "rgb" : name);
  }

  private kindsIn(choice: string): string[] | null {
    return choice === "outliers" ? kindsOf("outlier") : choice.startsWith(kPrefix) ? kindsOf(choice.slice(kPrefix.length)) : null;
  }

  // The scene has room for one.
  private forgetScalar(): void {
    for (const other of Object.keys(this.has)) if (other !== "rgb" && other !== "texture") delete this.has[other];
  }

  private spread(value: (place: number) => number, kind: Kind = "any"): Spread {
    return binned(value, this.scene.count, quantileRange(value, this.scene.count, kind));
  }

  private show(mode: "displacement" | "height" | "scalar", map: MapName, spread: Spread, title: string, isLength = false): void {
    this.scene.setColourMode(mode, spread.range, map);
    const metres = this.cloud!.metres_per_unit;
    this.legend.show(title, map, spread, isLength ? (value) => lengthInWords(value, metres) : short);
  }

  // Each kind that is there, with its name; the commonest first.
  private showKinds(names: string[], title: string): void {
    const counts = new Map<number, number>();
    for (const value of this.scalar) counts.set(value, (counts.get(value) ?? 0) + 1);
    this.scene.setColourMode("scalar", [0, 255], { of: (value) => kindColour(names, value) });
    const kinds = [...counts].sort(([, a], [, b]) => b - a);
    this.legend.showKinds(title, kinds.map(([value, count]) =>
      ({ colour: kindColour(names, value), name: `${value} ${kindName(names, value)}`, count })));
  }

  /** What a place is coloured by, in words; empty where its colour says nothing in numbers. */
  valueAt(place: number): string {
    const metres = this.cloud?.metres_per_unit ?? null;
    if (this.choice === "displacement") return `displacement ${lengthInWords(this.scene.signedDisplacement(place), metres)}`;
    if (this.choice === "height") return `height ${lengthInWords(this.scene.height(place), metres)}`;
    if (this.has[this.choice] !== "here" || this.choice === "rgb" || this.choice === "texture") return "";
    const value = this.scalar[place];
    if (this.choice === "noise") return `noise ${lengthInWords(value, metres)}`;
    const name = this.choice === "outliers" ? "outlier" : this.choice.slice(kPrefix.length);
    const kinds = this.kindsIn(this.choice);
    return kinds ? `${name} ${value} ${kindName(kinds, value)}` : `${name} ${short(value, 6)}`;
  }
}
