// SPDX-License-Identifier: Apache-2.0
// What the colours mean: the map with its ends, and how often each value occurs.

import { mapGradient, type MapName, type Spread } from "./colours";
import { h, short } from "./dom";

export class Legend {
  private readonly title = h("div", {});
  private readonly chart = h("canvas", { width: 424, height: 88, role: "img", "aria-label": "histogram" });
  private readonly bar = h("div", { class: "bar" });
  private readonly ends = h("div", { class: "ends" });
  readonly element = h("div", { class: "legend", hidden: true }, this.title, this.chart, this.bar, this.ends);

  hide(): void {
    this.element.hidden = true;
  }

  show(title: string, map: MapName, { range, counts }: Spread): void {
    this.element.hidden = false;
    this.title.textContent = title;
    this.bar.style.background = mapGradient(map);
    const middle = (range[0] + range[1]) / 2;
    this.ends.replaceChildren(...[range[0], middle, range[1]].map((value) =>
      h("span", {}, Math.abs(value) < 1e-9 * (range[1] - range[0]) ? "0" : short(value))));
    const context = this.chart.getContext("2d")!;
    const { width, height } = this.chart;
    context.clearRect(0, 0, width, height);
    const highest = Math.max(1, ...counts.slice(1, -1), 0.25 * Math.max(counts[0], counts[counts.length - 1]));
    context.fillStyle = "#a3afbb";
    counts.forEach((count, i) => {
      const share = Math.min(1, Math.sqrt(count / highest));
      const step = width / counts.length;
      context.fillRect(i * step + 1, height * (1 - share), step - 2, height * share);
    });
  }
}
