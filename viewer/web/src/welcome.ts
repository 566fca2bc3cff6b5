// SPDX-License-Identifier: Apache-2.0
// What is there before a cloud is: a place to drop a file, and a button to choose one.

import { h } from "./dom";
import { kIsLocal } from "./connection";

export const kReads = "PLY, LAS, LAZ, COPC, E57, PCD, PTX, PTS, XYZ, TXT, CSV, NPY, STL, OFF, OBJ, GLB";

/** Lets the user choose a file of this machine, and those that it names. */
export function chooseFiles(chosen: (files: File[]) => void): void {
  const input = h("input", { type: "file", multiple: true, onchange: () => {
    if (input.files?.length) chosen([...input.files]);
  } });
  input.click();
}

export class Welcome {
  private readonly words = h("p", {}, "Reading…");
  private readonly door: HTMLElement;
  readonly element: HTMLElement;

  constructor(chosen: (files: File[]) => void) {
    this.door = h("div", { class: "door", hidden: true },
      h("h1", {}, "Open a scan"),
      h("p", {}, "Drop a file here, or choose one of this machine."),
      h("button", { type: "button", class: "plain primary", id: "choose", onclick: () => chooseFiles(chosen) }, "Choose a file"),
      h("p", { class: "note" }, kReads),
      h("p", { class: "note" }, "A mesh with a texture together with the .mtl file and the pictures that it names."),
      kIsLocal ? h("p", { class: "note" }, "Up to 1\u202f000\u202f000 points. The file does not leave this machine: pointfair runs in this page.") : null);
    this.element = h("div", { class: "welcome" }, this.words, this.door);
  }

  /** Until a cloud comes. */
  wait(words: string): void {
    this.words.textContent = words;
    this.show(false);
  }

  /** Asks for a file. */
  ask(): void {
    this.show(true);
  }

  hide(): void {
    this.element.hidden = true;
  }

  private show(asks: boolean): void {
    this.element.hidden = false;
    this.door.hidden = !asks;
    this.words.hidden = asks;
  }
}
