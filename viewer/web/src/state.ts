// SPDX-License-Identifier: Apache-2.0
// What the user has set: the recipe with its history, the view, and both in the URL.

import type { Recipe } from "./protocol";

export type Mode = "after" | "wipe" | "side" | "before";
export type Draw = "smooth" | "flat" | "wireframe" | "points";

export interface View {
  mode: Mode;
  wipe: number; // share of the width that shows the original
  colour: string; // "auto": the file's own colours, where it has some
  size: number; // of a point, in spacings
  edl: number; // strength of eye-dome lighting
  shade: number; // strength of shading by normals
  exaggerate: number; // factor on displacements in the picture
  draw: Draw; // of a cloud with faces; of others the points are drawn
  up: "auto" | "y" | "z"; // auto: as the cloud looks upright
  hide: boolean; // points outside the clip box
  camera: number[]; // position and target, relative to the cloud's origin; empty: fitted
}

export const defaultView = (): View => ({
  mode: "after", wipe: 0.5, colour: "auto", size: 2, edl: 0.4, shade: 0.8, exaggerate: 1, draw: "smooth", up: "auto", hide: false, camera: [],
});

export const equalRecipes = (a: Recipe, b: Recipe) => recipeKey(a) === recipeKey(b);
const recipeKey = (recipe: Recipe) => JSON.stringify([sorted(recipe.params), sorted(recipe.limits)]);
const sorted = (texts: Record<string, string>) => Object.entries(texts).filter(([, t]) => t !== "").sort();

export const copyRecipe = (recipe: Recipe): Recipe => ({ params: { ...recipe.params }, limits: { ...recipe.limits } });

/** Undo and redo. A change under way is not part of it until it is kept. */
export class History {
  private past: Recipe[] = [];
  private future: Recipe[] = [];
  constructor(private now: Recipe) {}

  keep(recipe: Recipe): void {
    if (equalRecipes(recipe, this.now)) return;
    this.past.push(this.now);
    this.now = copyRecipe(recipe);
    this.future = [];
  }
  /** A run with the newest recipe failed: it is void, and `recipe` holds again. */
  revert(recipe: Recipe): void {
    if (this.past.length && equalRecipes(this.past[this.past.length - 1], recipe)) this.past.pop();
    this.now = copyRecipe(recipe);
  }
  undo(): Recipe | null {
    return this.step(this.past, this.future);
  }
  redo(): Recipe | null {
    return this.step(this.future, this.past);
  }
  get canUndo(): boolean {
    return this.past.length > 0;
  }
  get canRedo(): boolean {
    return this.future.length > 0;
  }
  private step(from: Recipe[], to: Recipe[]): Recipe | null {
    const next = from.pop();
    if (!next) return null;
    to.push(this.now);
    this.now = next;
    return copyRecipe(next);
  }
}

/** What the part of the URL after # says; only what differs from the defaults is written. */
export function writeFragment(cloud: string, recipe: Recipe, defaults: Recipe, view: View): string {
  const words = new URLSearchParams();
  words.set("cloud", cloud);
  for (const [name, text] of Object.entries(recipe.params)) if (text !== defaults.params[name]) words.set(name, text);
  for (const [name, text] of Object.entries(recipe.limits)) if (text !== "") words.set(`limit.${name}`, text);
  const plain = defaultView();
  for (const key of Object.keys(plain) as (keyof View)[]) {
    if (key === "camera") {
      if (view.camera.length) words.set("view.camera", view.camera.map((c) => Number(c.toPrecision(6))).join(","));
    } else if (view[key] !== plain[key]) words.set(`view.${key}`, String(view[key]));
  }
  return "#" + words.toString();
}

const kOfCloud = ["view.mode", "view.up"]; // what a cloud of another name does not take over

/**
 * Reads a fragment into copies of the defaults. What names no parameter of the table, or is no sound value, is left. `hasLook`:
 * it says how the cloud is compared or coloured.
 */
export function readFragment(
  fragment: string,
  cloud: string,
  defaults: Recipe,
): { recipe: Recipe; view: View; hasLook: boolean } {
  const recipe = copyRecipe(defaults);
  const view = defaultView();
  const words = new URLSearchParams(fragment.replace(/^#/, ""));
  const same = words.get("cloud") === cloud;
  const other = words.has("cloud") && !same;
  for (const [key, text] of words) {
    if (key in defaults.params) recipe.params[key] = text;
    else if (same && key.startsWith("limit.") && key.slice(6) in defaults.limits) recipe.limits[key.slice(6)] = text;
    else if (key.startsWith("view.") && !(other && kOfCloud.includes(key))) readView(view, key.slice(5), text, same);
  }
  return { recipe, view, hasLook: !other && (words.has("view.mode") || words.has("view.colour")) };
}

function readView(view: View, key: string, text: string, same: boolean): void {
  const number = Number(text);
  const inRange = (least: number, most: number) => text !== "" && number >= least && number <= most;
  if (key === "mode" && ["after", "wipe", "side", "before"].includes(text)) view.mode = text as Mode;
  if (key === "wipe" && inRange(0, 1)) view.wipe = number;
  if (key === "colour" && same) view.colour = text;
  if (key === "size" && inRange(0.1, 10)) view.size = number;
  if (key === "edl" && inRange(0, 1)) view.edl = number;
  if (key === "shade" && inRange(0, 1)) view.shade = number;
  if (key === "exaggerate" && inRange(1, 10)) view.exaggerate = number;
  if (key === "up" && (text === "y" || text === "z")) view.up = text;
  if (key === "draw" && ["smooth", "flat", "wireframe", "points"].includes(text)) view.draw = text as Draw;
  if (key === "hide") view.hide = text === "true";
  if (key === "camera" && same) {
    const camera = text.split(",").map(Number);
    if (camera.length === 6 && camera.every(Number.isFinite)) view.camera = camera;
  }
}
