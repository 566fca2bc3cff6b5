// SPDX-License-Identifier: Apache-2.0
// The first minute: a file is chosen in the page, the first view shows what the run did, the cloud stands upright, and what
// there is to choose says something of this file.
import assert from "node:assert/strict";
import { writeFileSync } from "node:fs";
import path from "node:path";
import { blocks, difference, picture } from "./looks.mjs";
import { dataset, entry, openBrowser, openPage, run, settled, sheet, show, temporaryFolder, test, view } from "./program.mjs";

const checked = (page) => page.getByRole("radio", { checked: true }).first().textContent();

test("without a file the page asks for one", async (t) => {
  const folder = temporaryFolder(t);
  const { url } = await view(t, ["--port", 0, "--save-folder", folder]);
  const { page } = await openPage(t, await openBrowser(), url);
  await page.getByRole("heading", { name: "Open a scan" }).waitFor();
  const broken = path.join(folder, "broken.ply");
  writeFileSync(broken, "ply\nformat ascii 1.0\n");
  for (const [file, comes] of [[broken, false], [sheet(folder, "sheet.xyz", 60), true]]) {
    const chooser = page.waitForEvent("filechooser");
    await page.locator("#choose").press("Enter");
    await (await chooser).setFiles(file);
    if (!comes) await page.locator(".toast.error", { hasText: "broken.ply" }).waitFor();
  }
  await settled(page);
  assert.equal(await dataset(page, "cloud"), "sheet.xyz");
  assert.ok(await page.getByRole("heading", { name: "Open a scan" }).isHidden());
  const again = page.waitForEvent("filechooser");
  await page.keyboard.press("o");
  await (await again).setFiles([sheet(folder, "first.xyz", 60), sheet(folder, "second.xyz", 60)]);
  await page.locator(".toast", { hasText: "One cloud at a time: second.xyz left aside" }).waitFor();
  await page.waitForFunction(() => document.body.dataset.cloud === "first.xyz");
  await settled(page);
});

test("the first view shows what the run did, and a later one what the user asked for", async (t) => {
  const folder = temporaryFolder(t);
  const browser = await openBrowser();
  for (const [name, noise, mode, colour] of [["rough.xyz", 2, "Wipe", "plain"], ["fine.xyz", 0.05, "Denoised", "displacement"]]) {
    const { url } = await view(t, [sheet(folder, name, 60, noise), "--port", 0]);
    const { page } = await openPage(t, browser, url);
    await settled(page);
    assert.equal(await checked(page), mode, name);
    assert.equal(await page.locator("#colour").inputValue(), colour, name);
    await page.locator("#colour").selectOption("height");
    await page.waitForFunction(() => location.hash.includes("view.colour=height"));
    await page.reload();
    await settled(page);
    assert.equal(await page.locator("#colour").inputValue(), "height");
  }
});

test("attributes that are zero everywhere are not offered, and lengths are in mm where the file says its unit", async (t) => {
  const folder = temporaryFolder(t);
  const rows = Array.from({ length: 3600 }, (_, i) =>
    `${(i % 60) / 4},${Math.floor(i / 60) / 4},${0.05 * (((i * 7919) % 101) / 101 - 0.5)},${i % 9},0`);
  const [csv, e57] = ["a.csv", "a.e57"].map((name) => path.join(folder, name)); // E57 is in metres
  writeFileSync(csv, ["x,y,z,depth,nothing", ...rows].join("\n"));
  run(["run", csv, e57, "--strength", 0, "-q"]);
  const browser = await openBrowser();
  const { page } = await openPage(t, browser, (await view(t, [csv, "--port", 0])).url);
  await settled(page);
  const offered = await page.locator("#colour option").allTextContents();
  assert.ok(offered.includes("depth") && !offered.includes("nothing"), String(offered));
  assert.equal(await page.locator('[data-param="noise"] select.unit').inputValue(), "s");

  const { page: metric } = await openPage(t, browser, (await view(t, [e57, "--port", 0])).url);
  await settled(metric);
  assert.equal(await metric.locator('[data-param="noise"] select.unit').inputValue(), "mm");
  const told = (await metric.locator("#findings").textContent()).match(/noise ([\d.]+) mm/)[1];
  assert.ok(Math.abs(Number((await entry(metric, "noise").inputValue()).replace("mm", "")) / Number(told) - 1) < 0.3);
  await entry(metric, "noise").fill("2cm");
  await metric.keyboard.press("Enter");
  await settled(metric);
  assert.equal(await dataset(metric, "error"), undefined);
});

/** Where the camera that the URL holds sees a place: -1 to 1 across and upwards inside the picture. */
function seen(place, words, aspect) {
  const camera = words.get("view.camera").split(",").map(Number);
  const minus = (a, b) => a.map((v, i) => v - b[i]);
  const dot = (a, b) => a.reduce((sum, v, i) => sum + v * b[i], 0);
  const cross = ([a, b, c], [d, e, f]) => [b * f - c * e, c * d - a * f, a * e - b * d];
  const unit = (a) => a.map((v) => v / Math.hypot(...a));
  const forward = unit(minus(camera.slice(3), camera.slice(0, 3)));
  const right = unit(cross(forward, words.get("view.up") === "y" ? [0, 1, 0] : [0, 0, 1]));
  const way = minus(place, camera.slice(0, 3));
  const half = dot(way, forward) * Math.tan(Math.PI / 9); // the field of view is 40 degrees high
  return [dot(way, right) / (half * aspect), dot(way, cross(right, forward)) / half];
}

test("a file of three points, none of which moves, is whole in the picture, and the URL names it", async (t) => {
  const folder = temporaryFolder(t);
  const { page } = await show(t, [sheet(folder, "sheet.xyz", 60)]);
  const places = [[0, 0, 0], [10, 0, 0], [0, 6, 1]];
  const file = path.join(folder, "three.xyz");
  writeFileSync(file, places.map((place) => place.join(" ")).join("\n"));
  const chooser = page.waitForEvent("filechooser");
  await page.keyboard.press("o");
  await (await chooser).setFiles(file);
  await page.waitForFunction(() => document.body.dataset.cloud === "three.xyz");
  await settled(page);
  const words = async () => new URLSearchParams(await page.evaluate(() => location.hash.slice(1)));
  await page.waitForTimeout(500); // the URL is written a little later
  assert.equal((await words()).get("cloud"), "three.xyz");
  const { width, height } = await page.locator(".stage > canvas").boundingBox();
  await page.locator(".stage > canvas").focus();
  await page.keyboard.press("ArrowLeft"); // a little, and the URL says where the camera is
  await page.waitForFunction(() => location.hash.includes("view.camera"));
  for (const place of places)
    for (const at of seen(place, await words(), width / height)) assert.ok(Math.abs(at) < 1, `${place} at ${at}`);
});

test("outliers of a run are told by reason, though it did not mark them", async (t) => {
  const { page } = await show(t, [sheet(temporaryFolder(t), "spike.xyz", 60, 0.3, true)]);
  const before = await blocks(page, await picture(page));
  await page.locator("#colour").selectOption("outliers");
  await page.locator(".legend li", { hasText: /^1 isolated · / }).waitFor();
  assert.ok(difference(before, await blocks(page, await picture(page))) > 0.2);
});
