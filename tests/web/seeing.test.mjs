// SPDX-License-Identifier: Apache-2.0
// What can be seen: every way to colour and to light, the legend, the pointer on the picture, files that are dropped, and
// clouds that are organised or too large.
import assert from "node:assert/strict";
import { readFileSync, writeFileSync } from "node:fs";
import path from "node:path";
import { blocks, canvas, difference, picture } from "./looks.mjs";
import {
  dataset, grip, kModels, noisyArmadillo, openBrowser, openPage, run, settled, sheet, show, slide, slider, temporaryFolder, test, type,
  updates, view, withModels,
} from "./program.mjs";
import { parts } from "./textured.mjs";

const models = withModels();

/** 20 x 20 points with colours and a scalar, as PLY. */
function coloured(folder) {
  const file = path.join(folder, "coloured.ply");
  const lines = Array.from({ length: 400 }, (_, i) =>
    `${i % 20} ${Math.floor(i / 20)} ${((i * 7) % 5) / 20} ${(i * 3) % 256} 100 ${255 - (i % 256)} ${i}`);
  writeFileSync(file, ["ply", "format ascii 1.0", "element vertex 400", "property float x", "property float y", "property float z",
    "property uchar red", "property uchar green", "property uchar blue", "property float depth", "end_header", ...lines, ""].join("\n"));
  return file;
}

test("a dropped file is shown; each way to colour it is another picture", models, async (t) => {
  const folder = temporaryFolder(t);
  const { page } = await show(t, [noisyArmadillo(folder, 3000, kModels)]);
  const transfer = await page.evaluateHandle(parts, [["coloured.ply", readFileSync(coloured(folder)).toString("base64")]]);
  await page.dispatchEvent("body", "dragover", { dataTransfer: transfer });
  await page.locator(".drop").waitFor();
  await page.dispatchEvent("body", "drop", { dataTransfer: transfer });
  await page.waitForFunction(() => document.body.dataset.cloud === "coloured.ply");
  await settled(page);
  await page.waitForFunction(() => document.body.dataset.settled);

  assert.ok(await page.locator('#colour option[value="rgb"]').count(), "the file's colours are offered");
  const seen = [];
  for (const choice of ["rgb", "plain", "height", "normal", "displacement", "rms", "attribute:depth"]) {
    await page.locator("#colour").selectOption(choice);
    const withLegend = ["height", "displacement", "rms", "attribute:depth"].includes(choice);
    await page.locator(".legend").waitFor({ state: withLegend ? "visible" : "hidden" });
    if (withLegend) {
      const inked = await page.locator(".legend canvas").evaluate((chart) =>
        chart.getContext("2d").getImageData(0, 0, chart.width, chart.height).data.filter((v, i) => i % 4 === 3 && v > 0).length);
      assert.ok(inked > 500, `the histogram of ${choice} is empty`);
    }
    const colours = await blocks(page, await picture(page));
    for (const [other, its] of seen) assert.ok(difference(colours, its) > 0.2, `${choice} looks like ${other}`);
    seen.push([choice, colours]);
  }
  await page.locator(".legend", { hasText: "depth" }).waitFor();
  assert.deepEqual(await page.locator(".legend .ends span").allTextContents(), ["4", "200", "395"]); // 1 % and 99 % of 0 to 399
});

test("lighting, the size of points and the axis that is up change the picture", models, async (t) => {
  const { page } = await show(t, [noisyArmadillo(temporaryFolder(t), 20000, kModels)]);
  await page.waitForFunction(() => document.body.dataset.settled);
  let last = await blocks(page, await picture(page));
  for (const [id, value] of [["#view-edl", "1"], ["#view-shade", "0"], ["#view-size", "4.5"]]) {
    await slide(page, id, value);
    const now = await blocks(page, await picture(page));
    assert.ok(difference(now, last) > 0.2, `${id} changes nothing`);
    last = now;
  }
  await page.getByRole("radio", { name: "z up" }).click();
  assert.ok(difference(await blocks(page, await picture(page)), last) > 0.5, "the axis changes nothing");
});

test("the pointer turns, moves, zooms, chooses what to turn about, and takes a screenshot", models, async (t) => {
  const { page } = await show(t, [noisyArmadillo(temporaryFolder(t), 3000, kModels)], "#view.up=y&view.mode=after");
  const box = await canvas(page).boundingBox();
  const camera = () => page.evaluate(() => new URLSearchParams(location.hash.slice(1)).get("view.camera") ?? "");
  const at = (x, y) => page.mouse.move(box.x + x * box.width, box.y + y * box.height, { steps: 4 });
  const changed = async (act) => {
    const old = await camera();
    await act();
    await page.waitForFunction((was) => (new URLSearchParams(location.hash.slice(1)).get("view.camera") ?? "") !== was, old);
    return [old, await camera()].map((text) => text.split(",").map(Number));
  };
  const drag = (button) => async () => {
    await at(0.5, 0.5);
    await page.mouse.down({ button });
    await at(0.6, 0.55);
    await page.mouse.up({ button });
  };
  const apart = (a, b, from) => Math.hypot(...[0, 1, 2].map((i) => a[from + i] - b[from + i]));
  await changed(drag("left"));
  const [turned, moved] = await changed(drag("right"));
  assert.ok(apart(turned, moved, 3) > 0, "the right button moves the target");
  const reach = (c) => Math.hypot(c[0] - c[3], c[1] - c[4], c[2] - c[5]);
  const [far, near] = await changed(async () => {
    await at(0.5, 0.5);
    await page.mouse.wheel(0, -600);
  });
  assert.ok(reach(near) < reach(far), "the wheel comes nearer");
  await page.keyboard.press("f");
  await page.waitForFunction(() => !location.hash.includes("view.camera"));
  await page.waitForFunction(() => document.body.dataset.still === "true");
  const [, pivoted] = await changed(() => page.mouse.dblclick(box.x + 0.5 * box.width, box.y + 0.35 * box.height));
  const info = JSON.parse(run(["info", path.join(kModels, "armadillo.off"), "--report", "-"]));
  const nearest = [3, 4, 5].every((i) => pivoted[i] > -info.diagonal && pivoted[i] < info.diagonal);
  assert.ok(nearest && pivoted.every(Number.isFinite));

  const download = page.waitForEvent("download");
  await canvas(page).focus();
  await page.keyboard.press("s");
  const file = await download;
  assert.equal(file.suggestedFilename(), "noisy.png");
  const png = readFileSync(await file.path());
  assert.equal(png.subarray(1, 4).toString(), "PNG");
  assert.equal(png.readUInt32BE(16), Math.round(box.width), "its width is that of the picture");
});

test("the original and the result turn together, side by side, and the wipe is pulled", models, async (t) => {
  const { page } = await show(t, [noisyArmadillo(temporaryFolder(t), 20000, kModels)], "#view.up=y&view.mode=side");
  const halves = async () => {
    const all = await blocks(page, await picture(page));
    const half = (from) => all.filter((_, i) => Math.floor(i / 3) % 64 >= from && Math.floor(i / 3) % 64 < from + 32);
    return [half(0), half(32)];
  };
  const [left, right] = await halves();
  await canvas(page).focus();
  for (let i = 0; i < 8; ++i) await page.keyboard.press("ArrowRight");
  const [leftTurned, rightTurned] = await halves();
  const moved = [difference(left, leftTurned), difference(right, rightTurned)];
  t.diagnostic(`turned by ${moved}, apart ${difference(left, right)} and ${difference(leftTurned, rightTurned)}`);
  assert.ok(moved[0] > 2 && moved[1] > 2, "both turn");
  assert.ok(difference(leftTurned, rightTurned) < 0.6 * Math.min(...moved), "and show the same from the same place");

  await page.keyboard.press("2");
  const stage = await page.locator(".stage").boundingBox();
  const handle = await page.locator(".wipe").boundingBox();
  await page.mouse.move(handle.x + handle.width / 2, stage.y + stage.height / 2);
  await page.mouse.down();
  await page.mouse.move(stage.x + 0.75 * stage.width, stage.y + stage.height / 2, { steps: 5 });
  await page.mouse.up();
  await page.waitForFunction(() => Math.abs(Number(new URLSearchParams(location.hash.slice(1)).get("view.wipe")) - 0.75) < 0.01);
});

test("points are coloured by their noise, whose two levels the legend tells", async (t) => {
  const folder = temporaryFolder(t);
  const file = path.join(folder, "halves.ply");
  const noise = (i) => Math.sqrt(-2 * Math.log(((i * 7919 + 1) % 10007) / 10007)) * Math.cos((2 * Math.PI * ((i * 104729) % 9973)) / 9973);
  const lines = Array.from({ length: 10000 }, (_, i) =>
    `${i % 100} ${Math.floor(i / 100)} ${(i % 100 < 50 ? 0.1 : 0.6) * noise(i)}`);
  writeFileSync(file, ["ply", "format ascii 1.0", "element vertex 10000", "property float x", "property float y", "property float z",
    "end_header", ...lines, ""].join("\n"));
  const told = JSON.parse(run(["info", file, "--report", "-"])).noise_quantiles;
  const { page } = await show(t, [file], "#view.up=z");
  const before = await blocks(page, await picture(page));
  await page.locator("#colour").selectOption("noise");
  await page.locator(".legend", { hasText: "noise" }).waitFor();
  assert.ok(difference(before, await blocks(page, await picture(page))) > 0.2, "the picture shows the noise");
  const [low, , high] = (await page.locator(".legend .ends span").allTextContents()).map(parseFloat);
  assert.ok(low > 0.5 * told[0] && low <= 1.1 * told[0], `${low} is near the quietest places, ${told}`);
  assert.ok(high >= 0.9 * told[2] && high < 2 * told[2], `${high} is near the loudest places, ${told}`);
  assert.ok(high > 3 * low, "both halves are told apart");
  await page.locator("#colour").selectOption("height");
  await page.locator(".legend", { hasText: "height" }).waitFor();
  await page.locator("#colour").selectOption("noise");
  await page.locator(".legend", { hasText: "noise" }).waitFor();
});

test("an organised cloud with points that are not there", async (t) => {
  const folder = temporaryFolder(t);
  const file = path.join(folder, "organised.pcd");
  const lines = Array.from({ length: 1200 }, (_, i) => (i % 7 === 0 ? "nan nan nan" : `${(i % 40) / 40} ${Math.floor(i / 40) / 40} ${((i * 5) % 3) / 300}`));
  writeFileSync(file, ["VERSION .7", "FIELDS x y z", "SIZE 4 4 4", "TYPE F F F", "COUNT 1 1 1", "WIDTH 40", "HEIGHT 30",
    "VIEWPOINT 0 0 0 1 0 0 0", "POINTS 1200", "DATA ascii", ...lines, ""].join("\n"));
  const { page } = await show(t, [file]);
  const kept = (await page.locator(".status .kept").textContent()).match(/\d+/g).map(Number);
  assert.equal(kept[0], 172); // every seventh of 1,200, and for each a reason
  assert.equal(kept.slice(1).reduce((sum, count) => sum + count, 0), kept[0]);
  for (const choice of ["displacement", "rms", "height"]) {
    await page.locator("#colour").selectOption(choice);
    const ends = await page.locator(".legend .ends span").allTextContents();
    assert.ok(ends.every((end) => !/NaN|–/.test(end)), `${choice}: ${ends}`);
  }
  assert.ok(difference(await blocks(page, await picture(page)), new Array(64 * 40 * 3).fill(16)) > 1, "nothing is seen");
});

test("of a large cloud a part is held; a held slider shows previews, and the whole once it is let go", models, async (t) => {
  const folder = temporaryFolder(t);
  const words = [noisyArmadillo(folder, 400000, kModels), "--points", 150000, "--save-folder", folder];
  const { page } = await show(t, words, "#view.up=y&k=24&iterations=3");
  assert.match(await page.locator(".file").textContent(), /400\D000 points, 150\D000 shown/);
  const before = await blocks(page, await picture(page));
  const hand = await grip(page, slider(page, "similarity_sigma"), 0.5);
  const kinds = new Set();
  for (let i = 0; i < 8 || (!kinds.has("preview") && i < 48); ++i) { // where the page is slower than the run, there are few
    const count = await updates(page);
    await hand.move(0.5 + 0.04 * (i % 8));
    await page.waitForFunction((n) => Number(document.body.dataset.updates) > n, count);
    kinds.add(await dataset(page, "last"));
  }
  assert.ok(kinds.has("preview"), "a slow run is previewed");
  await hand.release();
  await settled(page);
  assert.ok(difference(before, await blocks(page, await picture(page))) > 0.05);
  await page.locator("#save").click();
  await page.waitForFunction(() => document.body.dataset.saved);
  assert.equal(JSON.parse(run(["info", path.join(folder, "noisy_denoised.ply"), "--report", "-"])).points, 400000, "files hold all points");
});

test("a cloud without a result is shown as the original, and says why", async (t) => {
  const { url } = await view(t, [sheet(temporaryFolder(t), "plain.xyz", 30), "--port", 0]);
  const browser = await openBrowser();
  const checked = (page) => page.getByRole("radio", { checked: true }).first().textContent();

  await t.test("parameters of a link that fail give way to the defaults", async () => {
    const { page } = await openPage(t, browser, `${url}#along=ray&view.mode=after`);
    await page.locator(".toast.error", { hasText: "The parameters are the defaults" }).waitFor();
    await settled(page);
    assert.equal(await page.locator("#param-along").inputValue(), "normal");
    assert.equal(await checked(page), "Denoised");
  });

  await t.test("a first run that is stopped leaves the original", models, async (u) => {
    const { url: large } = await view(u, [noisyArmadillo(temporaryFolder(u), 100000, kModels), "--port", 0]);
    const { page, faults } = await openPage(u, browser, `${large}#k=100&iterations=100&view.mode=after`);
    await page.locator(".status progress").waitFor();
    await page.getByRole("button", { name: "Stop" }).click();
    await page.locator(".hint", { hasText: "There is no result" }).waitFor();
    assert.equal(await checked(page), "Original");
    assert.equal(await page.locator("#total").textContent(), "no result");
    await type(page, "iterations", "1");
    assert.equal(await checked(page), "Denoised");
    assert.ok(await page.locator(".hint").isHidden());
    assert.deepEqual(faults, []);
  });

  await t.test("the automatic value is told of what was automatic only", async () => {
    const { page } = await openPage(t, browser, url);
    await settled(page);
    const automatic = () => page.locator('#param-outliers option[value="auto"]').textContent();
    assert.equal(await automatic(), "auto (keep)");
    await page.locator("#param-outliers").selectOption("mark");
    await settled(page);
    assert.notEqual(await automatic(), "auto (mark)");
    await page.locator("#param-outliers").selectOption("auto");
    await settled(page);
    assert.equal(await automatic(), "auto (keep)");
  });
});

test("classes have names, lengths have units, and a screenshot tells what its colours mean", async (t) => {
  const folder = temporaryFolder(t);
  const rows = ["x,y,z,classification"];
  for (let i = 0; i < 3600; ++i) {
    const noise = 0.05 * (((i * 7919) % 101) / 101 - 0.5);
    rows.push(`${(i % 60) / 4},${Math.floor(i / 60) / 4},${(0.3 * Math.sin((i % 60) / 4) + noise).toFixed(4)},${i % 10 === 0 ? 6 : 2}`);
  }
  const csv = path.join(folder, "tile.csv"), e57 = path.join(folder, "tile.e57"); // which is in metres
  writeFileSync(csv, rows.join("\n"));
  run(["run", csv, e57, "--strength", 0, "-q"]);
  const { page } = await show(t, [e57, "--save-folder", folder]);

  await t.test("kinds", async () => {
    await page.locator("#colour").selectOption("attribute:classification");
    await page.locator(".legend li").first().waitFor();
    assert.deepEqual(await page.locator(".legend li").allTextContents(), ["2 ground · 3\u202f240", "6 building · 360"]);
    assert.ok(await page.locator(".legend canvas").isHidden());
  });

  await t.test("units", async () => {
    assert.match(await page.locator("#findings").textContent(), /spacing [\d.]+ mm, noise [\d.]+ mm; points moved [\d.]+ mm/);
    await page.locator("#colour").selectOption("displacement");
    for (const end of await page.locator(".legend .ends span").allTextContents()) assert.match(end, /^(0|-?[\d.]+ mm)$/);
  });

  await t.test("the file saved is called after the input", async () => {
    assert.equal(await page.locator("#output").inputValue(), "tile_denoised.e57");
    await page.locator("#save").click();
    await page.locator(".toast", { hasText: "tile_denoised.e57" }).waitFor();
  });

  await t.test("a screenshot has the legend", async () => {
    await page.locator("#colour").selectOption("height");
    await page.locator(".legend").waitFor();
    const download = page.waitForEvent("download");
    await page.getByRole("button", { name: "Screenshot" }).click();
    const file = await (await download).path();
    const url64 = `data:image/png;base64,${readFileSync(file).toString("base64")}`;
    const bar = await page.evaluate(async (source) => {
      const image = new Image();
      image.src = source;
      await image.decode();
      const drawn = document.createElement("canvas");
      [drawn.width, drawn.height] = [image.width, image.height];
      const context = drawn.getContext("2d");
      context.drawImage(image, 0, 0);
      const scale = image.width / document.querySelector(".stage canvas").clientWidth;
      const at = (x) => [...context.getImageData(Math.round(x * scale), Math.round(image.height - 44 * scale), 1, 1).data.slice(0, 3)];
      return [at(28), at(250)];
    }, url64);
    // the ends of the map: dark blue and yellow
    assert.ok(bar[0][2] > bar[0][1] && bar[0][0] < 90, String(bar));
    assert.ok(bar[1][0] > 200 && bar[1][1] > 180 && bar[1][2] < 160, String(bar));
  });

  await t.test("the point under the pointer says where it is, and two points how far they are apart", async () => {
    const box = await canvas(page).boundingBox();
    await page.mouse.move(box.x + box.width / 2, box.y + box.height / 2);
    await page.mouse.move(box.x + box.width / 2 + 2, box.y + box.height / 2);
    await page.locator(".readout", { hasText: /^height -?[\d.]+ (mm|m) · / }).waitFor();
    await page.keyboard.press("m");
    await page.locator(".hint", { hasText: "Click two points" }).waitFor();
    await page.mouse.click(box.x + 0.45 * box.width, box.y + box.height / 2);
    await page.locator(".hint", { hasText: "second" }).waitFor();
    await page.mouse.click(box.x + 0.55 * box.width, box.y + box.height / 2);
    await page.locator(".toast", { hasText: /^Distance in the original: [\d.]+ (mm|m)$/ }).waitFor();
  });

  await t.test("displacements are shown longer than they are", async () => {
    await page.locator("#colour").selectOption("plain");
    const before = await blocks(page, await picture(page), 640, 400);
    await slide(page, "#view-exaggerate", "10");
    await page.waitForFunction(() => location.hash.includes("view.exaggerate=10"));
    const after = await blocks(page, await picture(page), 640, 400);
    assert.ok(difference(before, after) > 0.1, `${difference(before, after)}`);
  });
});
