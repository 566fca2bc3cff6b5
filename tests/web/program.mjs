// SPDX-License-Identifier: Apache-2.0
// The program under test and a browser to look at its page. Node modules come from where the page was built.
import assert from "node:assert/strict";
import { spawn, spawnSync } from "node:child_process";
import { existsSync, mkdtempSync, rmSync, writeFileSync } from "node:fs";
import { createRequire } from "node:module";
import { tmpdir } from "node:os";
import path from "node:path";
import nodeTest, { after } from "node:test";
import { canvas, readsPixels } from "./looks.mjs";

export const kProgram = process.env.POINTFAIR_BIN;
export const modules = createRequire(path.join(process.env.POINTFAIR_WEB, "package.json"));

/** The models of libcgal-demo, fetched where they are not here; tests that need them are skipped without. */
export const kModels = path.join(process.env.POINTFAIR_BUILD ?? "build", "demo");
export function withModels() {
  const script = path.join(process.env.POINTFAIR_SOURCE ?? ".", "scripts/models.py");
  const here = existsSync(path.join(kModels, "building.ply")) || spawnSync("python3", [script, kModels]).status === 0;
  return here ? {} : { skip: "the models of libcgal-demo are not here and cannot be fetched" };
}

let browser, closes = false;

/** A test at whose end no page that it opened has a fault. */
export function test(name, options, body = options) {
  if (!closes) after(() => browser?.close());
  closes = true;
  return nodeTest(name, body === options ? {} : options, async (t) => {
    await body(t);
    assert.deepEqual(t.faults ?? [], []);
  });
}

/** A folder that goes with the test. */
export function temporaryFolder(t) {
  const folder = mkdtempSync(path.join(tmpdir(), "pointfair-web-"));
  t.after(() => rmSync(folder, { recursive: true, force: true }));
  return folder;
}

/** Runs the program to its end; its standard output. Throws with what it said if it failed. */
export function run(words, options = {}) {
  const done = spawnSync(kProgram, words.map(String), { encoding: "utf8", ...options });
  if (done.status !== 0) throw new Error(`pointfair ${words.join(" ")}: ${done.status} ${done.stderr}`);
  return done.stdout;
}

/** Starts `pointfair view`; resolves with its URL once it listens. It ends with the test. */
export async function view(t, words, options = {}) {
  const child = spawn(kProgram, ["view", ...words.map(String), "--no-open"], { stdio: ["ignore", "pipe", "pipe"], ...options });
  t.after(async () => {
    if (child.exitCode !== null) return;
    const ended = new Promise((resolve) => child.once("exit", resolve));
    child.kill("SIGTERM");
    await ended;
  });
  let errors = "";
  child.stderr.on("data", (text) => (errors += text));
  const url = await new Promise((resolve, reject) => {
    let output = "";
    child.stdout.on("data", (text) => {
      output += text;
      if (output.includes("\n")) resolve(output.trim());
    });
    child.once("exit", (code) => reject(new Error(`pointfair view ended with ${code}: ${errors}`)));
  });
  return { url, child };
}

/** Debian's Chromium, with a graphics card in software. */
export const launchBrowser = () => modules("playwright-core").chromium.launch({
  executablePath: process.env.POINTFAIR_CHROMIUM ?? "/usr/bin/chromium",
  args: ["--no-sandbox", "--use-angle=swiftshader", "--enable-unsafe-swiftshader", "--disable-dev-shm-usage"],
});

/** One browser for all tests of a file: it takes long to start, and pages of two tests have nothing in common. */
export const openBrowser = async () => (browser = browser?.isConnected() ? browser : await launchBrowser());

/** A page at the URL, which prepare(page) sees first. What it logs as an error, or asks of another address, is a fault of the test. */
export async function openPage(t, browser, url, options = {}, prepare = async () => {}) {
  const context = await browser.newContext({ viewport: { width: 1280, height: 800 }, acceptDownloads: true, ...options });
  context.setDefaultTimeout(120000); // for what never comes; how long things take is measured by bench/viewer_page.mjs
  const page = await context.newPage();
  page.on("filechooser", () => {}); // with the first listener the browser begins to tell of choosers, some time later
  const faults = (t.faults ??= []);
  page.on("pageerror", (error) => faults.push(String(error)));
  page.on("console", (message) => message.type() === "error" && faults.push(message.text()));
  page.on("request", (request) => {
    const asked = new URL(request.url());
    if (!["blob:", "data:"].includes(asked.protocol) && asked.host !== new URL(url).host) faults.push(`asks for ${asked}`);
  });
  t.after(() => context.close());
  await readsPixels(page);
  await prepare(page);
  await page.goto(url);
  return { page, faults, context };
}

/** `pointfair view` of the words, and a page with the state, once it shows a result. */
export async function show(t, words, state = "", options = {}) {
  const { url, child } = await view(t, [...words, "--port", 0]);
  const opened = await openPage(t, await openBrowser(), url + state, options);
  await settled(opened.page);
  return { ...opened, url, child };
}

/** Waits until the page shows the whole result of what it asked for last; the limit is for what never comes. */
export async function settled(page, timeout = 300000) {
  await page.waitForFunction(() => document.body.dataset.last === "result" && document.body.dataset.busy === "false", null, { timeout });
  await page.waitForTimeout(150);
}

/** Pulls a slider through places; at each it waits, the pointer still down, until the picture has changed. */
export async function pull(page, locator, from, ...places) {
  const hand = await grip(page, locator, from);
  for (const place of places) {
    const before = await updates(page);
    await hand.move(place);
    await page.waitForFunction((n) => Number(document.body.dataset.updates) > n, before);
  }
  await hand.release();
}

export const entry = (page, name) => page.locator(`[data-param="${name}"] input.entry`);
export const slider = (page, name) => page.locator(`[data-param="${name}"] input[type=range]`);

/** Types what a parameter is to be, and waits for the result. */
export async function type(page, name, value) {
  await entry(page, name).fill(value);
  await page.keyboard.press("Enter");
  await settled(page);
}

/** Sets a slider at once. */
export const slide = (page, id, value) => page.locator(id).evaluate((element, to) => {
  element.value = to;
  for (const kind of ["input", "change"]) element.dispatchEvent(new Event(kind, { bubbles: true }));
}, value);

/** Draws a lasso, whose corners are shares of the picture. */
export async function drawLasso(page, ...corners) {
  await page.getByRole("button", { name: "Draw lasso" }).click();
  const box = await canvas(page).boundingBox();
  const move = ([x, y], steps) => page.mouse.move(box.x + x * box.width, box.y + y * box.height, { steps });
  await move(corners[0], 1);
  await page.mouse.down();
  for (const corner of corners) await move(corner, 8);
  await page.mouse.up();
}

/** Saves under a name and waits until it is there. */
export async function save(page, name, encoding = "") {
  const error = await dataset(page, "error"); // of what failed before
  await page.locator("#output").fill(name);
  await page.locator("#encoding").selectOption(encoding);
  await page.locator("#save").click();
  await page.waitForFunction(([wanted, old]) => document.body.dataset.saved?.endsWith(wanted) || document.body.dataset.error !== old, [name, error]);
  assert.equal(await dataset(page, "error"), error);
}

/** What the button puts on the clipboard; it is called `what` then. */
export async function copied(page, button, what) {
  await page.context().grantPermissions(["clipboard-read", "clipboard-write"]);
  await page.getByRole("button", { name: button }).click();
  await page.locator(".toast", { hasText: `The ${what} is on the clipboard` }).waitFor();
  return page.evaluate(() => navigator.clipboard.readText());
}

export const dataset = (page, key) => page.evaluate((k) => document.body.dataset[k], key);

/** How often the picture has changed. */
export const updates = async (page) => Number((await dataset(page, "updates")) ?? 0);

/** Takes hold of a slider with the pointer; the hand that is returned moves to a share of its length, and lets go. */
export async function grip(page, locator, from) {
  await locator.scrollIntoViewIfNeeded();
  const box = await locator.boundingBox();
  const move = (share) => page.mouse.move(box.x + 8 + share * (box.width - 16), box.y + box.height / 2);
  await move(from);
  await page.mouse.down();
  return { move, release: () => page.mouse.up() };
}

/** The Armadillo with `points` points and noise of 0.3 % of its diagonal. */
export function noisyArmadillo(folder, points, models) {
  const noisy = path.join(folder, "noisy.ply");
  run(["noise", path.join(models, "armadillo.off"), noisy, "--points", points, "--sigma", "0.3%", "--seed", 1, "-q"]);
  return noisy;
}

/** A waving sheet of `across` x `across` points; `noise` is the width of its noise, in spacings. */
export function sheet(folder, name, across, noise = 1, spike = false) {
  const rows = Array.from({ length: across * across }, (_, i) => {
    const [x, y] = [i % across, Math.floor(i / across)];
    return `${x} ${y} ${Math.sin(x / 6) + noise * (((i * 7919) % 101) / 101 - 0.5) + (spike && i === 1830 ? 25 : 0)}`;
  });
  const file = path.join(folder, name);
  writeFileSync(file, rows.join("\n"));
  return file;
}
