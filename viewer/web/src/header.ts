// SPDX-License-Identifier: Apache-2.0
// The line at the top: what is open, how it is compared, and the tools.

import { choice, grouped, h, iconButton } from "./dom";
import type { CloudHead } from "./protocol";
import type { Mode } from "./state";

export interface HeaderActions {
  setMode(mode: Mode): void;
  undo(): void;
  redo(): void;
  fit(): void;
  screenshot(): void;
  measure(): void;
  open(): void;
  help(): void;
}

export class Header {
  readonly element: HTMLElement;
  private readonly file = h("div", { class: "file" });
  private readonly undo: HTMLButtonElement;
  private readonly redo: HTMLButtonElement;
  private readonly panel: HTMLButtonElement;
  private readonly modes: { element: HTMLElement; set(mode: Mode): void };
  private mode: Mode = "after";
  private hasResult = false;

  constructor(actions: HeaderActions) {
    this.undo = iconButton("Undo", "M8 5 4 9l4 4M4 9h7a5 5 0 0 1 0 10H9", actions.undo, "Ctrl Z");
    this.redo = iconButton("Redo", "m12 5 4 4-4 4m4-4H9a5 5 0 0 0 0 10h2", actions.redo, "Ctrl Shift Z");
    this.panel = iconButton("Settings", "M3 5h14M3 10h14M3 15h14M7 3v4M13 8v4M6 13v4", () => this.togglePanel(), "P");
    this.panel.setAttribute("aria-pressed", "true");
    this.modes = choice<Mode>("View", [["after", "Denoised"], ["wipe", "Wipe"], ["side", "Side by side"], ["before", "Original"]],
      actions.setMode);
    this.setHistory(false, false);
    this.element = h("header", {},
      h("div", { class: "brand" }, h("img", { src: "./icon.svg", alt: "" }), h("span", {}, "pointfair")),
      this.file, h("div", { class: "spacer" }), this.modes.element, h("div", { class: "spacer" }),
      h("div", { class: "tools", role: "toolbar", "aria-label": "Tools" },
        iconButton("Open a file", "M2.5 15.5v-11h5l1.5 2h7v2M2.5 15.5l2.5-7h13l-2.5 7z", actions.open, "O"), this.undo, this.redo,
        iconButton("Fit", "M3 7V3h4M13 3h4v4M17 13v4h-4M7 17H3v-4M7 7h6v6H7z", actions.fit, "F"),
        iconButton("Measure", "M3.5 13 13 3.5l3.5 3.5L7 16.5zM6.2 10.3l1.6 1.6M8.7 7.8l2.4 2.4M11.2 5.3l1.6 1.6", actions.measure, "M"),
        iconButton("Screenshot", "M3 6h3l1.5-2h5L14 6h3v10H3zM10 8a3 3 0 1 0 0 6 3 3 0 0 0 0-6z", actions.screenshot, "S"),
        iconButton("Keyboard", "M2.5 5.5h15v9h-15zM5 8.5h.01M8 8.5h.01M11 8.5h.01M14 8.5h.01M6 11.5h8", actions.help, "?"),
        this.panel));
  }

  setCloud(head: CloudHead): void {
    const points = `${grouped(head.points)} ${head.points === 1 ? "point" : "points"}`;
    const shown = head.shown < head.points ? `, ${grouped(head.shown)} shown` : "";
    const faces = head.faces ? `, ${grouped(head.faces)} faces` : "";
    this.file.replaceChildren(h("b", { title: head.path }, head.name), h("span", { class: "count" }, ` · ${points}${shown}${faces}`));
  }

  setMode(mode: Mode): void {
    this.mode = mode;
    this.modes.set(this.hasResult ? mode : "before");
  }

  /** Without a result there is the original only. */
  setResult(has: boolean): void {
    this.hasResult = has;
    this.modes.element.inert = !has;
    this.modes.element.title = has ? "" : "There is no result yet";
    this.setMode(this.mode);
  }

  setHistory(canUndo: boolean, canRedo: boolean): void {
    this.undo.disabled = !canUndo;
    this.redo.disabled = !canRedo;
  }

  togglePanel(): void {
    const closed = document.body.classList.toggle("closed");
    this.panel.setAttribute("aria-pressed", String(!closed));
  }
}
