// SPDX-License-Identifier: Apache-2.0
// What lies over the picture: the wipe's handle, tags, the lasso while it is drawn, hints, toasts, the file drop.

import { h } from "./dom";
import type { View } from "./state";
import { kReads, Welcome } from "./welcome";

export class Stage {
  readonly element = h("main", { class: "stage" });
  private readonly left = h("div", { class: "tag left", hidden: true }, "original");
  private readonly right = h("div", { class: "tag right", hidden: true }, "denoised");
  private readonly seam = h("div", { class: "seam", hidden: true });
  private readonly handle = h("button", { class: "wipe", type: "button", role: "slider", "aria-label": "wipe",
    "aria-valuemin": "0", "aria-valuemax": "100", hidden: true });
  private readonly hint = h("div", { class: "hint", role: "status", hidden: true });
  private readonly drop = h("div", { class: "drop", hidden: true }, `Drop a scan: ${kReads}`);
  private readonly readout = h("div", { class: "readout", hidden: true });
  private readonly toasts = h("div", { class: "toasts", role: "alert", "aria-live": "assertive" });
  readonly welcome: Welcome;

  constructor(private readonly view: View, private readonly wiped: (done: boolean) => void, dropped: (files: File[]) => void) {
    this.welcome = new Welcome(dropped);
    this.element.append(this.seam, this.handle, this.left, this.right, this.readout, this.hint, this.welcome.element, this.toasts, this.drop);
    this.listenToWipe();
    this.listenToDrops(dropped);
  }

  /** In front of the canvas. */
  add(...elements: Element[]): void {
    this.hint.before(...elements);
  }

  showView(held: boolean): void {
    const mode = held ? "before" : this.view.mode;
    const both = mode === "wipe" || mode === "side";
    this.handle.hidden = mode !== "wipe";
    this.seam.hidden = mode !== "side";
    this.left.hidden = !both && mode !== "before";
    this.right.hidden = !both;
    this.handle.style.left = `${100 * this.view.wipe}%`;
    this.handle.setAttribute("aria-valuenow", String(Math.round(100 * this.view.wipe)));
  }

  /** What is under the pointer; empty: nothing. */
  showReadout(text: string): void {
    this.readout.textContent = text;
    this.readout.hidden = text === "";
  }

  /** Draws what the sides are onto a picture. */
  drawTagsOnto(context: CanvasRenderingContext2D, width: number, scale: number): void {
    context.font = `${12 * scale}px system-ui, sans-serif`;
    context.fillStyle = "#e8ecf0";
    context.textAlign = "left";
    if (!this.left.hidden) context.fillText("original", 16 * scale, 26 * scale);
    context.textAlign = "right";
    if (!this.right.hidden) context.fillText("denoised", width - 16 * scale, 26 * scale);
  }

  say(text: string, error = false, time = error ? 9000 : 3500): void {
    const toast = h("div", { class: error ? "toast error" : "toast" }, text);
    this.toasts.append(toast);
    while (this.toasts.children.length > 3) this.toasts.firstChild!.remove();
    setTimeout(() => toast.remove(), time);
  }

  showHint(text: string): void {
    this.hint.textContent = text;
    this.hint.hidden = text === "";
  }

  /** Lets the user draw an outline; corners from -1 to 1, y up. Null if it was given up. */
  drawLasso(): Promise<[number, number][] | null> {
    const svg = document.createElementNS("http://www.w3.org/2000/svg", "svg");
    svg.classList.add("lasso");
    const polygon = document.createElementNS("http://www.w3.org/2000/svg", "polygon");
    svg.append(polygon);
    this.add(svg);
    this.showHint("Draw around the points that may move. Escape cancels.");
    return new Promise((resolve) => {
      const outline: [number, number][] = [];
      const end = (result: [number, number][] | null) => {
        svg.remove();
        this.showHint("");
        window.removeEventListener("keydown", escape, true);
        resolve(result);
      };
      const escape = (event: KeyboardEvent) => {
        if (event.key !== "Escape") return;
        event.stopPropagation();
        end(null);
      };
      window.addEventListener("keydown", escape, true);
      const box = this.element.getBoundingClientRect();
      svg.addEventListener("pointerdown", (event) => svg.setPointerCapture(event.pointerId));
      svg.addEventListener("pointermove", (event) => {
        if (!event.buttons) return;
        const [x, y] = [event.clientX - box.left, event.clientY - box.top];
        outline.push([(2 * x) / box.width - 1, 1 - (2 * y) / box.height]);
        const point = svg.createSVGPoint();
        [point.x, point.y] = [x, y];
        polygon.points.appendItem(point);
      });
      svg.addEventListener("pointerup", () => end(outline.length > 2 ? outline : null));
    });
  }

  private listenToWipe(): void {
    const to = (share: number, done: boolean) => {
      this.view.wipe = Math.min(0.98, Math.max(0.02, share));
      this.showView(false);
      this.wiped(done);
    };
    this.handle.addEventListener("pointerdown", (event) => this.handle.setPointerCapture(event.pointerId));
    this.handle.addEventListener("pointermove", (event) => {
      if (!event.buttons) return;
      const box = this.element.getBoundingClientRect();
      to((event.clientX - box.left) / box.width, false);
    });
    this.handle.addEventListener("pointerup", () => to(this.view.wipe, true));
    this.handle.addEventListener("keydown", (event) => {
      const step = { ArrowRight: 0.02, ArrowLeft: -0.02 }[event.key];
      if (!step) return;
      event.preventDefault();
      event.stopPropagation();
      to(this.view.wipe + step, true);
    });
  }

  private listenToDrops(dropped: (files: File[]) => void): void {
    const holdsFile = (event: DragEvent) => event.dataTransfer?.types.includes("Files");
    window.addEventListener("dragover", (event) => {
      if (!holdsFile(event)) return;
      event.preventDefault();
      this.drop.hidden = false;
    });
    window.addEventListener("dragleave", (event) => {
      if (!event.relatedTarget) this.drop.hidden = true;
    });
    window.addEventListener("drop", (event) => {
      if (!holdsFile(event)) return;
      event.preventDefault();
      this.drop.hidden = true;
      const files = [...event.dataTransfer!.files];
      if (files.length) dropped(files);
    });
  }
}
