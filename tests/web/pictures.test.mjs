// SPDX-License-Identifier: Apache-2.0
// Pictures are compared with those in pictures/. POINTFAIR_UPDATE_PICTURES=1 writes these, and the README's picture and
// animation.
import assert from "node:assert/strict";
import { spawnSync } from "node:child_process";
import path from "node:path";
import { assertPicture, canvas } from "./looks.mjs";
import { kModels, noisyArmadillo, run, show, temporaryFolder, test, type, withModels } from "./program.mjs";

const kSource = process.env.POINTFAIR_SOURCE;
const models = withModels();

test("pictures are as they were", models, async (t) => {
  const noisy = noisyArmadillo(temporaryFolder(t), 30000, kModels);
  const { page } = await show(t, [noisy], "#k=24&iterations=1&view.up=y&view.mode=after", { viewport: { width: 988, height: 490 } });
  await page.waitForFunction(() => document.body.dataset.settled); // and with it the normals of the result
  await assertPicture(page, "denoised");
  await page.locator("#colour").selectOption("displacement");
  await assertPicture(page, "displacement");
  await page.locator("#colour").selectOption("rms");
  await assertPicture(page, "rms_displacement");
  await page.locator("#colour").selectOption("normal");
  await page.keyboard.press("3");
  await assertPicture(page, "side_by_side");
});

// The README's picture and animation: a slider is pulled, then the wipe.
test("pictures of the README", process.env.POINTFAIR_UPDATE_PICTURES ? models : { skip: "POINTFAIR_UPDATE_PICTURES is not set" }, async (t) => {
  const noisy = noisyArmadillo(temporaryFolder(t), 150000, kModels);
  const { bounds, diagonal } = JSON.parse(run(["info", noisy, "--report", "-"]));
  const target = bounds.min.map((low, i) => (low + bounds.max[i]) / 2);
  const eye = [-0.42, 0.22, -0.88].map((d, i) => target[i] + 1.02 * diagonal * d);
  const state = new URLSearchParams({ cloud: "noisy.ply", k: "32", "view.up": "y", "view.mode": "wipe", "view.camera": [...eye, ...target].join(",") });
  const { page } = await show(t, [noisy], `#${state}`, { viewport: { width: 1280, height: 760 } });
  await page.waitForTimeout(2500);
  await page.screenshot({ path: path.join(kSource, "docs/pictures/viewer.png") });

  const frames = temporaryFolder(t);
  let frame = 0;
  const shoot = async (ms) => {
    const file = path.join(frames, `${String(frame++).padStart(3, "0")}.png`);
    await page.screenshot({ path: file });
    return ["-d", String(ms), file];
  };
  const words = [];
  await page.keyboard.press("1");
  for (const value of ["0.02s", "0.05s", "0.1s", "0.2s", "0.35s", "0.6s", "0.9s", "1.3s", "1.8s"]) {
    await type(page, "similarity_sigma", value);
    await page.waitForTimeout(1200);
    words.push(...(await shoot(260)));
  }
  await canvas(page).focus();
  await page.keyboard.press("2");
  await page.evaluate(() => document.activeElement.blur());
  const handle = page.locator(".wipe");
  for (const share of [0.15, 0.25, 0.35, 0.45, 0.55, 0.65, 0.75, 0.85, 0.7, 0.5]) {
    const box = await page.locator(".stage").boundingBox();
    const grip = await handle.boundingBox();
    await page.mouse.move(grip.x + grip.width / 2, box.y + box.height / 2);
    await page.mouse.down();
    await page.mouse.move(box.x + share * box.width, box.y + box.height / 2);
    await page.mouse.up();
    await page.waitForTimeout(400);
    words.push(...(await shoot(share === 0.5 ? 1500 : 140)));
  }
  const animation = path.join(kSource, "docs/pictures/viewer.webp");
  const made = spawnSync("img2webp", ["-loop", "0", "-lossy", "-q", "60", "-m", "6", ...words, "-o", animation]);
  assert.equal(made.status, 0, "img2webp of Debian's webp is needed");
});
