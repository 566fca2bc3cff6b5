// SPDX-License-Identifier: Apache-2.0
// What the user takes out of the page: texts, pictures and files.

import { h } from "./dom";
import type { Legend } from "./legend";
import type { Scene } from "./scene";
import type { Stage } from "./stage";

const kForgotten = 10000; // ms after which a file that was given is not held any more

export class Takeaway {
  constructor(private readonly scene: Scene, private readonly stage: Stage, private readonly legend: Legend) {}

  /** Puts a text onto the clipboard, and says so; `what`: its name at the beginning of a sentence. */
  async copy(text: string, what: string): Promise<void> {
    try {
      await navigator.clipboard.writeText(text);
      this.stage.say(`${what} is on the clipboard.`);
    } catch {
      this.showText(what, text); // a page that is not on loopback has no clipboard
    }
  }

  /** Gives the picture of a cloud, with the legend and what the sides are. */
  async screenshot(cloud: string): Promise<void> {
    const picture = await this.withLegend(await this.scene.screenshot());
    this.download(picture, `${cloud.replace(/\.[^.]*$/, "")}.png`);
  }

  download(file: Blob, name: string): void {
    const url = URL.createObjectURL(file);
    h("a", { href: url, download: name }).click();
    setTimeout(() => URL.revokeObjectURL(url), kForgotten);
  }

  private showText(title: string, text: string): void {
    const area = h("textarea", { class: "text", readOnly: true, value: text, rows: 12 });
    const dialog = h("dialog", { onclose: () => dialog.remove() }, h("h2", {}, title), area);
    document.body.append(dialog);
    dialog.showModal();
    area.select();
  }

  private async withLegend(picture: Blob): Promise<Blob> {
    const image = await createImageBitmap(picture);
    const canvas = h("canvas", { width: image.width, height: image.height });
    const context = canvas.getContext("2d")!;
    const scale = image.width / this.scene.canvas.clientWidth;
    context.drawImage(image, 0, 0);
    this.legend.drawOnto(context, image.height, scale);
    this.stage.drawTagsOnto(context, image.width, scale);
    return new Promise((resolve) => canvas.toBlob((blob) => resolve(blob ?? picture), "image/png"));
  }
}
