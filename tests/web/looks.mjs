// SPDX-License-Identifier: Apache-2.0
// What is on the screen: pictures, how far two are from each other, and how well texts can be read.
import assert from "node:assert/strict";
import { mkdirSync, readFileSync, writeFileSync } from "node:fs";
import path from "node:path";

const kPictures = path.join(process.env.POINTFAIR_SOURCE ?? ".", "tests/web/pictures");

export const canvas = (page) => page.locator(".stage > canvas");

/** Lets the page read PNGs, in base64, without the browser's own scaling, of which it has several. */
export const readsPixels = (page) => page.addInitScript(() => {
  globalThis.pixelsOf = async (base64) => {
    const image = new Image();
    image.src = `data:image/png;base64,${base64}`;
    await image.decode();
    const { width, height } = image;
    const context = new OffscreenCanvas(width, height).getContext("2d", { willReadFrequently: true });
    context.drawImage(image, 0, 0);
    return { width, height, data: context.getImageData(0, 0, width, height).data };
  };
});

/** Mean colours of blocks of the picture, 64 x 40 of them. */
export async function blocks(page, png, width = 64, height = 40) {
  return page.evaluate(async ([base64, width, height]) => {
    const { data, ...image } = await globalThis.pixelsOf(base64);
    const sums = new Float64Array(3 * width * height), counts = new Uint32Array(width * height);
    for (let y = 0, at = 0; y < image.height; ++y)
      for (let x = 0; x < image.width; ++x, at += 4) {
        const block = Math.floor((y * height) / image.height) * width + Math.floor((x * width) / image.width);
        ++counts[block];
        for (let c = 0; c < 3; ++c) sums[3 * block + c] += data[at + c];
      }
    return Array.from(sums, (sum, i) => sum / Math.max(1, counts[Math.floor(i / 3)]));
  }, [png.toString("base64"), width, height]);
}

/** How many pixels of a picture have the colour of a measured distance. */
export async function pixelsOfDistance(page, png) {
  return page.evaluate(async (base64) => {
    const { data } = await globalThis.pixelsOf(base64);
    let count = 0;
    for (let at = 0; at < data.length; at += 4) count += data[at] > 220 && data[at + 1] > 140 && data[at + 2] < 120;
    return count;
  }, png.toString("base64"));
}

export const difference = (a, b) => a.reduce((sum, v, i) => sum + Math.abs(v - b[i]), 0) / a.length;

/** The picture once it is whole, as a PNG. */
export async function picture(page) {
  await page.evaluate(() => document.activeElement.blur()); // a focus ring is no part of it
  await page.waitForFunction(() => document.body.dataset.still === "true" && !document.querySelector(".toast"));
  await page.waitForTimeout(100);
  return canvas(page).screenshot();
}

/** Compares the picture with the one that is kept under the name; POINTFAIR_UPDATE_PICTURES=1 keeps a new one. */
export async function assertPicture(page, name) {
  const png = await picture(page);
  const file = path.join(kPictures, `${name}.png`);
  if (process.env.POINTFAIR_UPDATE_PICTURES) {
    mkdirSync(kPictures, { recursive: true });
    return writeFileSync(file, png);
  }
  const off = difference(await blocks(page, png), await blocks(page, readFileSync(file)));
  if (off > 4) writeFileSync(path.join(process.env.POINTFAIR_BUILD, `${name}.png`), png);
  assert.ok(off <= 4, `${name} is off by ${off.toFixed(1)} of 255 a block; see ${name}.png in the build`);
}

/** In the page: texts whose contrast with what lies behind them is below 4.5. */
export function faintTexts() {
  const channels = (colour) => colour.match(/[\d.]+/g).map(Number);
  const luminance = ([r, g, b]) => {
    const [x, y, z] = [r, g, b].map((c) => (c / 255 <= 0.04045 ? c / 255 / 12.92 : ((c / 255 + 0.055) / 1.055) ** 2.4));
    return 0.2126 * x + 0.7152 * y + 0.0722 * z;
  };
  const behind = (element) => {
    for (let at = element; at; at = at.parentElement) {
      const [r, g, b, alpha = 1] = channels(getComputedStyle(at).backgroundColor);
      if (alpha > 0.7) return [r, g, b];
    }
    return [255, 255, 255];
  };
  const faint = [];
  for (const element of document.body.querySelectorAll("*")) {
    const text = [...element.childNodes].filter((node) => node.nodeType === 3).map((node) => node.data.trim()).join("") || element.value;
    if (!text || element.disabled || !element.checkVisibility() || element.tagName === "OPTION" || ["range", "checkbox"].includes(element.type)) continue;
    const [a, b] = [luminance(channels(getComputedStyle(element).color)), luminance(behind(element))];
    const contrast = (Math.max(a, b) + 0.05) / (Math.min(a, b) + 0.05);
    if (contrast < 4.5) faint.push(`${text.slice(0, 30)}: ${contrast.toFixed(2)}`);
  }
  return faint;
}
