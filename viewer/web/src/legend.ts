// SPDX-License-Identifier: Apache-2.0
// What the colours mean: the map with its ends, and how often each value occurs.

import { mapGradient, type MapName, mapStops, type Spread } from "./colours";
import { grouped, h, short } from "./dom";

export class Legend {
  private readonly title = h("div", {});
  private readonly chart = h("canvas", { width: 424, height: 88, role: "img", "aria-label": "histogram" });
  private readonly bar = h("div", { class: "bar" });
  private stops: string[] = []; // of the bar
  private readonly ends = h("div", { class: "ends" });
  private readonly kinds = h("ul", { hidden: true });
  readonly element = h("div", { class: "legend", hidden: true }, this.title, this.chart, this.bar, this.ends, this.kinds);

  hide(): void {
    this.element.hidden = true;
  }

  /** Kinds with their colours and how many points are of each. */
  showKinds(title: string, kinds: { colour: string; name: string; count: number }[]): void {
    this.showParts(true);
    this.title.textContent = title;
    this.kinds.replaceChildren(...kinds.map(({ colour, name, count }) => {
      const swatch = h("i");
      swatch.style.background = colour;
      return h("li", {}, swatch, `${name} · ${grouped(count)}`);
    }));
  }

  /** Draws what is shown onto a picture, at its lower left; `scale`: pixels of the picture a pixel of the page. */
  drawOnto(context: CanvasRenderingContext2D, height: number, scale: number): void {
    if (this.element.hidden) return;
    const lines = this.kinds.hidden ? [] : [...this.kinds.children] as HTMLElement[];
    const tall = this.kinds.hidden ? 62 : 30 + 18 * lines.length;
    context.save();
    context.scale(scale, scale);
    context.translate(14, height / scale - 14 - tall);
    context.fillStyle = "#0d1115d9";
    context.fillRect(0, 0, 250, tall);
    context.font = "12px system-ui, sans-serif";
    context.fillStyle = "#e8ecf0";
    context.fillText(this.title.textContent ?? "", 12, 18);
    lines.forEach((line, i) => {
      context.fillStyle = (line.firstChild as HTMLElement).style.background;
      context.fillRect(12, 28 + 18 * i, 10, 10);
      context.fillStyle = "#e8ecf0";
      context.fillText(line.textContent ?? "", 29, 37 + 18 * i);
    });
    if (this.kinds.hidden) this.drawBar(context);
    context.restore();
  }

  private drawBar(context: CanvasRenderingContext2D): void {
    const gradient = context.createLinearGradient(12, 0, 238, 0);
    this.stops.forEach((colour, i) => gradient.addColorStop(i / (this.stops.length - 1), colour));
    context.fillStyle = gradient;
    context.fillRect(12, 28, 226, 8);
    context.fillStyle = "#e8ecf0";
    [...this.ends.children].forEach((end, i) => {
      context.textAlign = (["left", "center", "right"] as const)[i];
      context.fillText(end.textContent ?? "", 12 + 113 * i, 52);
    });
  }

  private showParts(kinds: boolean): void {
    this.element.hidden = false;
    this.kinds.hidden = !kinds;
    this.chart.hidden = this.bar.hidden = this.ends.hidden = kinds;
  }

  /** `told`: a value in words. */
  show(title: string, map: MapName, { range, counts }: Spread, told: (value: number) => string = short): void {
    this.showParts(false);
    this.title.textContent = title;
    this.bar.style.background = mapGradient(map);
    this.stops = mapStops(map);
    const middle = (range[0] + range[1]) / 2;
    this.ends.replaceChildren(...[range[0], middle, range[1]].map((value) =>
      h("span", {}, Math.abs(value) < 1e-9 * (range[1] - range[0]) ? "0" : told(value))));
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
