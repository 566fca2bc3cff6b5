// SPDX-License-Identifier: Apache-2.0
// The line at the bottom: what the last run took, on what, and what is under way.

import { grouped, h, short } from "./dom";
import type { Hello, Result } from "./protocol";

const kStageColours: Record<string, string> = {
  upload: "#8794a1", index: "#7aa2f7", estimate: "#b9a1ff", neighbors: "#55cdb9", normals: "#e5c07b", fairing: "#f28fad",
  download: "#8794a1",
};
const kCopies = ["upload", "download"]; // what runs where the result is known already
const kRateWindow = 2000;

export class Status {
  private readonly total = h("span", { id: "total" });
  private readonly stages = h("span", { class: "stages" });
  private readonly reasons = h("span", { class: "reasons" });
  private readonly kept = h("span", { class: "kept" });
  private readonly rate = h("span", { id: "rate" });
  private readonly bar = h("progress", { max: 1, value: 0, "aria-label": "progress" });
  private readonly stage = h("span", {});
  private readonly progress: HTMLElement;
  private readonly updates: number[] = [];
  private readonly device = h("span", { class: "device" });
  readonly element: HTMLElement;

  constructor(cancel: () => void) {
    this.progress = h("span", { class: "progress", hidden: true }, this.stage, this.bar,
      h("button", { type: "button", class: "plain", onclick: cancel }, "Stop"));
    this.element = h("footer", { class: "status", "aria-label": "Last run" }, this.total, this.rate, this.stages, this.kept, this.progress, this.device);
  }

  setDevice(device: Hello["device"]): void {
    if (!device) return;
    this.device.textContent = `${device.kind} · ${device.name}`;
    this.device.title = `${this.device.textContent}: ${device.reason}`;
  }

  showResult(result: Result, points: number): void {
    this.hideProgress();
    const computed = result.stages.some(({ name }) => !kCopies.includes(name));
    const rate = points / (result.total_ms / 1000);
    this.total.replaceChildren(h("b", {}, `${short(result.total_ms)} ms`), ` run, ${short(result.server_ms)} ms answer`);
    this.rate.textContent = !computed ? "" : `${grouped(Math.round(rate / 1e4) / 100)} M points/s`;
    this.stages.replaceChildren(...result.stages.map(({ name, ms }) => {
      const item = h("i", {}, `${name} ${short(ms)}`);
      item.style.setProperty("--dot", kStageColours[name] ?? "#8794a1");
      return item;
    }));
    this.stages.title = result.stages.map(({ name, ms }) => `${name} ${short(ms)} ms`).join(", ");
    this.showKept(result);
  }

  // The number stays in sight where the reasons have no room.
  private showKept({ unmoved, reasons, pulled }: Result): void {
    const there = Object.entries(reasons).filter(([, count]) => count > 0);
    this.reasons.textContent = `: ${there.map(([reason, count]) => `${grouped(count)} ${reason}`).join(", ")}`;
    const counts = [pulled && `${grouped(pulled)} outliers pulled in`, unmoved && `${grouped(unmoved)} kept in place`].filter(Boolean).join("; ");
    this.kept.replaceChildren(...(counts ? [h("span", {}, counts)] : []), ...(unmoved ? [this.reasons] : []));
    this.kept.title = this.kept.textContent ?? "";
  }

  /** Nothing was computed. */
  clear(): void {
    this.hideProgress();
    this.total.replaceChildren("no result");
    this.rate.textContent = this.stages.title = this.kept.title = "";
    this.stages.replaceChildren();
    this.kept.replaceChildren();
  }

  showProgress(stage: string, share: number): void {
    this.progress.hidden = false;
    this.stage.textContent = stage;
    this.bar.value = share;
  }

  hideProgress(): void {
    this.progress.hidden = true;
  }

  /** A picture with new displacements was shown. Updates a second, lately. */
  countUpdate(now: number): number {
    this.updates.push(now);
    while (this.updates[0] < now - kRateWindow) this.updates.shift();
    return this.updates.length / (kRateWindow / 1000);
  }
}
