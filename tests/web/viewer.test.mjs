// SPDX-License-Identifier: Apache-2.0
// End to end in a headless Chromium with a graphics card in software: what a user does, and what then is on the screen and
// on the disk. POINTFAIR_UPDATE_PICTURES=1 writes the pictures that later runs are compared with.
import assert from "node:assert/strict";
import { execFileSync, spawnSync } from "node:child_process";
import { existsSync, mkdirSync, readFileSync, writeFileSync } from "node:fs";
import path from "node:path";
import test from "node:test";
import {
  dataset, grip, kProgram, noisyArmadillo, openBrowser, openPage, run, settled, slider, temporaryFolder, updates, view,
} from "./program.mjs";

const kSource = process.env.POINTFAIR_SOURCE;
const kModels = path.join(process.env.POINTFAIR_BUILD, "demo");
const kPictures = path.join(kSource, "tests/web/pictures");

function models() {
  if (existsSync(path.join(kModels, "building.ply"))) return true;
  return spawnSync("python3", [path.join(kSource, "scripts/models.py"), kModels]).status === 0;
}
const withModels = models() ? {} : { skip: "the models of libcgal-demo are not here and cannot be fetched" };

const entry = (page, name) => page.locator(`[data-param="${name}"] input.entry`);
const canvas = (page) => page.locator(".stage > canvas");

/** Pulls a slider through places; at each it waits, the pointer still down, until the picture has changed. */
async function pull(page, locator, from, ...places) {
  const hand = await grip(page, locator, from);
  for (const place of places) {
    const before = await updates(page);
    await hand.move(place);
    await page.waitForFunction((n) => Number(document.body.dataset.updates) > n, before);
  }
  await hand.release();
}

/** Mean colours of blocks of the picture, 64 x 40 of them, as the browser decodes it. */
async function blocks(page, png, width = 64, height = 40) {
  return page.evaluate(async ([base64, width, height]) => {
    const image = new Image();
    image.src = `data:image/png;base64,${base64}`;
    await image.decode();
    const small = new OffscreenCanvas(width, height);
    const context = small.getContext("2d");
    context.imageSmoothingQuality = "high";
    context.drawImage(image, 0, 0, width, height);
    return [...context.getImageData(0, 0, width, height).data].filter((_, i) => i % 4 !== 3);
  }, [png.toString("base64"), width, height]);
}
const difference = (a, b) => a.reduce((sum, v, i) => sum + Math.abs(v - b[i]), 0) / a.length;

async function picture(page) {
  await page.evaluate(() => document.activeElement.blur()); // a focus ring is no part of it
  await page.waitForFunction(() => document.body.dataset.still === "true" && !document.querySelector(".toast"));
  await page.waitForTimeout(100);
  return canvas(page).screenshot();
}

async function assertPicture(page, name) {
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
function faintTexts() {
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

const armadillo = (folder, points) => noisyArmadillo(folder, points, kModels);

const distance = (cloud) =>
  JSON.parse(run(["compare", cloud, path.join(kModels, "armadillo.off"), "--report", "-"])).mean;

test("a scan is loaded, faired, compared, saved, and all of it comes back", withModels, async (t) => {
  const folder = temporaryFolder(t);
  const scan = path.join(kModels, "building.ply");
  const { url } = await view(t, [scan, "--port", 0, "--save-folder", folder]);
  const browser = await openBrowser(t);
  const { page, faults, context } = await openPage(t, browser, url);
  await context.grantPermissions(["clipboard-read", "clipboard-write"]);
  await settled(page);
  assert.equal(await dataset(page, "cloud"), "building.ply");

  await t.test("the picture follows the slider while it is pulled", async () => {
    await page.locator("#colour").selectOption("plain");
    const before = await blocks(page, await picture(page), 640, 400);
    await pull(page, slider(page, "closeness_sigma"), 0.5, 0.6, 0.7, 0.75);
    await settled(page);
    const changed = difference(before, await blocks(page, await picture(page), 640, 400));
    t.diagnostic(`pixels changed by ${changed.toFixed(2)} of 255`);
    assert.ok(changed > 0.1);
    assert.match(await entry(page, "closeness_sigma").inputValue(), /^[\d.]+[sr]$/);
  });

  await t.test("the noise that is left is less", async () => {
    await page.waitForFunction(() => document.body.dataset.noise);
    const [, before, after] = (await page.locator("#findings").textContent()).match(/noise ([\d.e-]+) → ([\d.e-]+)/);
    assert.ok(Number(after) < 0.7 * Number(before), `${before} to ${after}`);
  });

  await t.test("the wipe, side by side, and a held key show the original", async () => {
    const faired = await blocks(page, await picture(page));
    await page.keyboard.press("2");
    const wiped = await blocks(page, await picture(page));
    await page.keyboard.press("3");
    const beside = await blocks(page, await picture(page));
    await page.keyboard.press("4");
    const original = await blocks(page, await picture(page));
    await page.keyboard.press("1");
    await page.keyboard.down("b");
    const held = await blocks(page, await picture(page));
    await page.keyboard.up("b");
    const released = await blocks(page, await picture(page));
    t.diagnostic(`held ${difference(held, original)}, released ${difference(released, faired)}, original ${difference(original, faired)}`);
    assert.ok(difference(held, original) < 0.1);
    assert.ok(difference(released, faired) < 0.1);
    const halves = (a, b) => {
      const part = (from) => a.filter((_, i) => Math.floor(i / 3) % 64 >= from && Math.floor(i / 3) % 64 < from + 30);
      const other = (from) => b.filter((_, i) => Math.floor(i / 3) % 64 >= from && Math.floor(i / 3) % 64 < from + 30);
      return [difference(part(0), other(0)), difference(part(34), other(34))];
    };
    t.diagnostic(`wipe ${halves(wiped, original)} ${halves(wiped, faired)}`);
    assert.ok(halves(wiped, original)[0] < 0.6 && halves(wiped, faired)[1] < 0.6);
    assert.ok(difference(beside, faired) > 1);
  });

  await t.test("undo and redo go through what was set", async () => {
    const changed = await entry(page, "closeness_sigma").inputValue();
    const auto = page.locator('[data-param="closeness_sigma"] button.auto');
    assert.equal(await auto.getAttribute("aria-pressed"), "false");
    await canvas(page).focus();
    await page.keyboard.press("Control+z");
    await settled(page);
    assert.equal(await auto.getAttribute("aria-pressed"), "true");
    await page.keyboard.press("Control+Shift+z");
    await settled(page);
    assert.equal(await entry(page, "closeness_sigma").inputValue(), changed);
  });

  await t.test("a snapshot brings its parameters back", async () => {
    await page.locator("summary", { hasText: "Snapshots" }).click();
    await page.getByLabel("Name of the snapshot").fill("soft");
    await page.getByRole("button", { name: "Keep", exact: true }).click();
    const kept = await entry(page, "closeness_sigma").inputValue();
    await entry(page, "closeness_sigma").fill("0.9s");
    await page.keyboard.press("Enter");
    await settled(page);
    await page.getByRole("button", { name: "soft", exact: true }).click();
    await settled(page);
    assert.equal(await entry(page, "closeness_sigma").inputValue(), kept);
  });

  await t.test("a number that cannot be is refused in words", async () => {
    await entry(page, "k").fill("many");
    await page.keyboard.press("Enter");
    await page.locator(".toast.error", { hasText: "--k cannot be 'many'" }).waitFor();
    await canvas(page).focus();
    await page.keyboard.press("Control+z");
    await settled(page);
  });

  await t.test("a lasso and a box hold points still", async () => {
    await page.getByRole("button", { name: "Draw lasso" }).click();
    const box = await canvas(page).boundingBox();
    const corners = [[0.35, 0.35], [0.65, 0.3], [0.7, 0.6], [0.5, 0.75], [0.32, 0.6]];
    await page.mouse.move(box.x + corners[0][0] * box.width, box.y + corners[0][1] * box.height);
    await page.mouse.down();
    for (const [x, y] of corners) await page.mouse.move(box.x + x * box.width, box.y + y * box.height, { steps: 8 });
    await page.mouse.up();
    await page.locator("#box").check();
    await page.getByLabel("box x from").press("ArrowRight");
    await settled(page);
    await page.waitForFunction(() => location.hash.includes("limit.lasso=") && location.hash.includes("limit.box="));
  });

  await t.test("what is saved is what the copied command writes, bit for bit", async () => {
    await page.locator("#output").fill("fair.ply");
    await page.keyboard.press("Tab");
    await settled(page);
    await page.locator("#save").click();
    await page.waitForFunction(() => document.body.dataset.saved);
    const saved = readFileSync(path.join(folder, "fair.ply"));
    await page.locator("#copy-command").click();
    await page.locator(".toast", { hasText: "on the clipboard" }).waitFor();
    const command = await page.evaluate(() => navigator.clipboard.readText());
    assert.match(command, /--lasso=.*|--box=/);
    const elsewhere = temporaryFolder(t);
    execFileSync("sh", ["-c", command], { cwd: elsewhere, env: { ...process.env, PATH: `${path.dirname(kProgram)}:${process.env.PATH}` }, stdio: "pipe" });
    assert.ok(saved.equals(readFileSync(path.join(elsewhere, "fair.ply"))));
    assert.ok(!saved.equals(readFileSync(scan)));
  });

  await t.test("reloading restores the state from the URL", async () => {
    await page.keyboard.press("Escape");
    await canvas(page).focus();
    const camera = () => new URLSearchParams(location.hash.slice(1)).get("view.camera");
    const earlier = await page.evaluate(camera);
    await page.keyboard.press("2");
    await page.keyboard.press("ArrowLeft");
    await page.waitForFunction((old) => {
      const state = new URLSearchParams(location.hash.slice(1));
      return state.get("view.mode") === "wipe" && state.get("view.camera") !== old;
    }, earlier);
    const [closeness, hash] = [await entry(page, "closeness_sigma").inputValue(), await page.evaluate(() => location.hash)];
    const before = await blocks(page, await picture(page));
    await page.reload();
    await settled(page);
    assert.equal(await entry(page, "closeness_sigma").inputValue(), closeness);
    assert.ok(await page.locator("#box").isChecked());
    assert.ok(await page.locator(".wipe").isVisible());
    assert.equal(await page.evaluate(() => location.hash), hash);
    await page.waitForFunction(() => document.body.dataset.noise); // and with it the normals of the result
    const after = difference(before, await blocks(page, await picture(page)));
    assert.ok(after < 1.5, `the picture differs by ${after}`);
  });

  assert.deepEqual(faults, []);
});

test("100,000 points: the picture follows the slider, and what is saved is nearer to the truth", withModels, async (t) => {
  const folder = temporaryFolder(t);
  const noisy = armadillo(folder, 100000);
  const { url } = await view(t, [noisy, "--port", 0, "--save-folder", folder]);
  const browser = await openBrowser(t);
  const { page, faults } = await openPage(t, browser, `${url}#k=16&passes=1&view.up=y`);
  await settled(page);
  await pull(page, slider(page, "similarity_sigma"), 0.3, 0.4, 0.5, 0.6, 0.7, 0.8);
  await settled(page);
  for (const name of ["k", "passes", "similarity_sigma"]) await page.locator(`[data-param="${name}"] button.auto`).click();
  await settled(page);
  await page.locator("#save").click();
  await page.waitForFunction(() => document.body.dataset.saved);
  const [before, after] = [distance(noisy), distance(path.join(folder, "fair.ply"))];
  t.diagnostic(`mean distance to the mesh ${before} before, ${after} after`);
  assert.ok(after < 0.6 * before, `${before} to ${after}`);
  assert.deepEqual(faults, []);
});

test("pictures are as they were", withModels, async (t) => {
  const noisy = armadillo(temporaryFolder(t), 30000);
  const { url } = await view(t, [noisy, "--port", 0]);
  const browser = await openBrowser(t);
  const { page, faults } = await openPage(t, browser, `${url}#k=24&passes=1&view.up=y`, { viewport: { width: 988, height: 490 } });
  await settled(page);
  await page.waitForFunction(() => document.body.dataset.noise); // and with it the normals of the result
  await assertPicture(page, "faired");
  await page.locator("#colour").selectOption("displacement");
  await assertPicture(page, "displacement");
  await page.locator("#colour").selectOption("noise");
  await assertPicture(page, "noise");
  await page.locator("#colour").selectOption("normal");
  await page.keyboard.press("3");
  await assertPicture(page, "side_by_side");
  assert.deepEqual(faults, []);
});

test("the keyboard alone, phone width, a dropped file, and colours of the file", withModels, async (t) => {
  const folder = temporaryFolder(t);
  const small = armadillo(folder, 3000);
  const { url } = await view(t, [small, "--port", 0]);
  const browser = await openBrowser(t);
  const { page, faults } = await openPage(t, browser, url, { viewport: { width: 390, height: 780 }, hasTouch: true });
  await settled(page);
  assert.ok(await page.evaluate(() => document.documentElement.scrollWidth <= innerWidth), "nothing is wider than a phone");

  // Every control is reached with the tabulator, has a name, and shows that it has the focus.
  const reached = new Set();
  for (let i = 0; i < 120; ++i) {
    await page.keyboard.press("Tab");
    const focus = await page.evaluate(() => {
      const element = document.activeElement;
      if (element === document.body) return null;
      const label = element.labels?.[0]?.textContent ?? "";
      const name = element.getAttribute("aria-label") || label || element.textContent || element.title;
      return { name: name.trim(), outline: getComputedStyle(element).outlineStyle, tag: element.tagName };
    });
    if (!focus) break;
    assert.ok(focus.name, `a ${focus.tag} without a name`);
    assert.notEqual(focus.outline, "none", focus.name);
    reached.add(focus.name);
  }
  for (const name of ["Fit", "Screenshot", "--k", "--passes", "Clip box", "Only what is in view", "Save", "Copy as command"])
    assert.ok(reached.has(name), `${name} cannot be reached`);

  const faint = await page.evaluate(faintTexts);
  assert.deepEqual(faint, [], "text with less contrast than WCAG AA asks for");

  const k = slider(page, "k");
  await k.focus();
  await page.keyboard.press("ArrowRight");
  await settled(page);
  const first = Number(await entry(page, "k").inputValue());
  await page.keyboard.press("ArrowRight");
  await settled(page);
  assert.equal(Number(await entry(page, "k").inputValue()), first + 1);

  const scan = path.join(folder, "coloured.ply");
  const lines = Array.from({ length: 400 }, (_, i) => `${i % 20} ${Math.floor(i / 20)} ${(i * 7) % 5 / 20} ${i % 256} 100 200 ${i}`);
  writeFileSync(scan, ["ply", "format ascii 1.0", "element vertex 400", "property float x", "property float y", "property float z",
    "property uchar red", "property uchar green", "property uchar blue", "property float depth", "end_header", ...lines, ""].join("\n"));
  const transfer = await page.evaluateHandle((text) => {
    const data = new DataTransfer();
    data.items.add(new File([text], "coloured.ply"));
    return data;
  }, readFileSync(scan, "utf8"));
  await page.dispatchEvent("body", "drop", { dataTransfer: transfer });
  await page.waitForFunction(() => document.body.dataset.cloud === "coloured.ply");
  await settled(page);
  assert.equal(await page.locator("#colour").inputValue(), "rgb");
  await page.locator("#colour").selectOption("attribute:depth");
  await page.locator(".legend", { hasText: "depth" }).waitFor();

  await canvas(page).focus();
  const download = page.waitForEvent("download");
  await page.keyboard.press("s");
  assert.equal((await download).suggestedFilename(), "coloured.png");
  await page.keyboard.press("?");
  await page.getByRole("dialog").waitFor();
  await page.keyboard.press("Escape");
  assert.deepEqual(faults, []);
});

// The README's picture and animation: a slider is pulled, then the wipe.
test("pictures of the README", process.env.POINTFAIR_UPDATE_PICTURES ? withModels : { skip: "POINTFAIR_UPDATE_PICTURES is not set" }, async (t) => {
  const noisy = armadillo(temporaryFolder(t), 150000);
  const { bounds, diagonal } = JSON.parse(run(["info", noisy, "--report", "-"]));
  const target = bounds.min.map((low, i) => (low + bounds.max[i]) / 2);
  const eye = [-0.42, 0.22, -0.88].map((d, i) => target[i] + 1.22 * diagonal * d);
  const { url } = await view(t, [noisy, "--port", 0]);
  const browser = await openBrowser(t);
  const state = new URLSearchParams({ cloud: "noisy.ply", k: "32", "view.up": "y", "view.mode": "wipe", "view.camera": [...eye, ...target].join(",") });
  const { page } = await openPage(t, browser, `${url}#${state}`, { viewport: { width: 1280, height: 760 } });
  await settled(page);
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
  const width = entry(page, "similarity_sigma");
  for (const value of ["0.02s", "0.05s", "0.1s", "0.2s", "0.35s", "0.6s", "0.9s", "1.3s", "1.8s"]) {
    await width.fill(value);
    await page.keyboard.press("Enter");
    await settled(page);
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
