// SPDX-License-Identifier: Apache-2.0
// End to end in a headless Chromium with a graphics card in software: what a user does, and what then is on the screen and
// on the disk.
import assert from "node:assert/strict";
import { execFileSync } from "node:child_process";
import { copyFileSync, existsSync, readFileSync, writeFileSync } from "node:fs";
import path from "node:path";
import { blocks, canvas, difference, picture } from "./looks.mjs";
import {
  copied, dataset, drawLasso, entry, kModels, kProgram, noisyArmadillo, pull, run, save, settled, show, slider, temporaryFolder, test,
  type, withModels,
} from "./program.mjs";

const models = withModels();
const kInstalls = existsSync(path.join(process.env.POINTFAIR_BUILD ?? ".", "cmake_install.cmake")) ? {} : { skip: "nothing is installed" };

const distance = (cloud) =>
  JSON.parse(run(["compare", cloud, path.join(kModels, "armadillo.off"), "--report", "-"])).mean;

test("a scan is loaded, denoised, compared, saved, and all of it comes back", models, async (t) => {
  const folder = temporaryFolder(t);
  // noisy enough that what moves is seen
  const scan = path.join(temporaryFolder(t), "building.ply");
  run(["noise", path.join(kModels, "building.ply"), scan, "--sigma", 0.05, "--seed", 1, "-q"]);
  const { page } = await show(t, [scan, "--save-folder", folder], "#view.mode=after");
  assert.equal(await dataset(page, "cloud"), "building.ply");

  await t.test("the picture follows the slider while it is pulled", async () => {
    await page.locator("#colour").selectOption("plain");
    await page.locator(".expert > summary").click();
    const before = await blocks(page, await picture(page), 640, 400);
    await pull(page, slider(page, "closeness_sigma"), 0.5, 0.6, 0.7, 0.75);
    await settled(page);
    const changed = difference(before, await blocks(page, await picture(page), 640, 400));
    t.diagnostic(`pixels changed by ${changed.toFixed(2)} of 255`);
    assert.ok(changed > 0.03); // 0 where nothing changes
    assert.match(await entry(page, "closeness_sigma").inputValue(), /^[\d.]+[sr]$/);
  });

  await t.test("the panel says what noise was estimated and how far points moved, and nothing of noise that is left", async () => {
    await page.waitForFunction(() => document.body.dataset.settled);
    const text = await page.locator("#findings").textContent();
    const figures = text.match(/^Estimated spacing ([\d.e-]+) units, noise ([\d.e-]+) units; points moved ([\d.e-]+) units on average, ([\d.e-]+) units at most$/);
    // the closeness sigma that was pulled to is the one parameter that is not automatic
    const sigma = await entry(page, "closeness_sigma").inputValue();
    const report = JSON.parse(run(["run", scan, path.join(folder, "told.ply"), "--closeness-sigma", sigma, "--report", "-", "-q"]));
    const told = [report.spacing, report.noise.before, report.displacement.mean, report.displacement.max];
    assert.deepEqual(figures.slice(1).map(Number), told.map((figure) => Number(figure.toPrecision(3))));
    assert.ok(told[2] > 0);
  });

  await t.test("the wipe, side by side, and a held key show the original", async () => {
    // points are compared, not the words over them
    await page.locator(".tag").evaluateAll((tags) => tags.forEach((tag) => (tag.style.visibility = "hidden")));
    const denoised = await blocks(page, await picture(page));
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
    t.diagnostic(`held ${difference(held, original)}, released ${difference(released, denoised)}, original ${difference(original, denoised)}`);
    assert.ok(difference(held, original) < 0.1);
    assert.ok(difference(released, denoised) < 0.1);
    const halves = (a, b) => {
      const part = (from) => a.filter((_, i) => Math.floor(i / 3) % 64 >= from && Math.floor(i / 3) % 64 < from + 30);
      const other = (from) => b.filter((_, i) => Math.floor(i / 3) % 64 >= from && Math.floor(i / 3) % 64 < from + 30);
      return [difference(part(0), other(0)), difference(part(34), other(34))];
    };
    t.diagnostic(`wipe ${halves(wiped, original)} ${halves(wiped, denoised)}`);
    assert.ok(halves(wiped, original)[0] < 0.02 && halves(wiped, denoised)[1] < 0.02);
    assert.ok(halves(wiped, original)[1] > 0.1 && halves(wiped, denoised)[0] > 0.1);
    assert.ok(difference(beside, denoised) > 1);
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
    await type(page, "closeness_sigma", "0.9s");
    await page.getByRole("button", { name: "soft", exact: true }).click();
    await settled(page);
    assert.equal(await entry(page, "closeness_sigma").inputValue(), kept);
  });

  await t.test("a run that fails is no result: it says why, and the parameters are as before", async () => {
    const [k, closeness] = [await entry(page, "k").inputValue(), await entry(page, "closeness_sigma").inputValue()];
    const hash = await page.evaluate(() => location.hash);
    await entry(page, "k").fill("many");
    await page.keyboard.press("Enter");
    await page.locator(".toast.error", { hasText: "--k cannot be 'many'" }).waitFor();
    await page.locator(".toast.error", { hasText: "The parameters are as before" }).waitFor();
    await canvas(page).focus();
    assert.equal(await entry(page, "k").inputValue(), k);
    assert.equal(await entry(page, "closeness_sigma").inputValue(), closeness);
    await page.waitForFunction((before) => location.hash === before, hash);
    assert.equal(await page.getByRole("radio", { name: "Denoised" }).getAttribute("aria-checked"), "true");
  });

  await t.test("a length that is refused leaves the one before and its unit", async () => {
    const unit = page.locator('[data-param="noise"] select.unit');
    const [noise, its] = [await entry(page, "noise").inputValue(), await unit.inputValue()];
    for (const [text, says] of [["5mm", "does not say how long its unit is"], ["wide", "cannot be 'wide'"]]) {
      await entry(page, "noise").fill(text);
      await page.keyboard.press("Enter");
      await page.locator(".toast.error", { hasText: says }).waitFor();
      await canvas(page).focus();
      assert.deepEqual([await entry(page, "noise").inputValue(), await unit.inputValue()], [noise, its], text);
    }
  });

  await t.test("a lasso and a box hold points still", async () => {
    await drawLasso(page, [0.35, 0.35], [0.65, 0.3], [0.7, 0.6], [0.5, 0.75], [0.32, 0.6]);
    await page.locator("#box").check();
    await page.getByLabel("box x from").press("ArrowRight");
    await settled(page);
    await page.waitForFunction(() => location.hash.includes("limit.lasso=") && location.hash.includes("limit.box="));
  });

  await t.test("what is saved is what the copied command writes, bit for bit", async () => {
    await settled(page); // the run with the lasso and the box has ended
    await save(page, "denoised.ply");
    const saved = readFileSync(path.join(folder, "denoised.ply"));
    const command = await copied(page, "Copy as command", "command");
    assert.match(command, /--lasso=.*|--box=/);
    const elsewhere = temporaryFolder(t);
    execFileSync("sh", ["-c", command], { cwd: elsewhere, env: { ...process.env, PATH: `${path.dirname(kProgram)}:${process.env.PATH}` }, stdio: "pipe" });
    assert.ok(saved.equals(readFileSync(path.join(elsewhere, "denoised.ply"))));
    assert.ok(!saved.equals(readFileSync(scan)));
  });

  await t.test("the copied program, built outside, writes the same bits", kInstalls, async () => {
    const program = await copied(page, "Copy as C++", "program");
    const outside = temporaryFolder(t);
    const cmake = (...words) => execFileSync("cmake", words, { stdio: "pipe" });
    for (const name of ["CMakeLists.txt", "fingerprint.cpp"])
      copyFileSync(path.join(process.env.POINTFAIR_SOURCE, "tests/outside", name), path.join(outside, name));
    writeFileSync(path.join(outside, "copied.cpp"), program);
    cmake("--install", process.env.POINTFAIR_BUILD, "--prefix", path.join(outside, "prefix"));
    cmake("-S", outside, "-B", path.join(outside, "build"), "-DCMAKE_BUILD_TYPE=Release", "-DPROGRAMS=copied.cpp",
      `-DCMAKE_PREFIX_PATH=${path.join(outside, "prefix")}`, `-DCMAKE_CXX_FLAGS=${process.env.POINTFAIR_CXX_FLAGS ?? ""}`);
    cmake("--build", path.join(outside, "build"), "--target", "copied");
    execFileSync(path.join(outside, "build/copied"), { cwd: outside, stdio: "pipe" });
    assert.ok(readFileSync(path.join(folder, "denoised.ply")).equals(readFileSync(path.join(outside, "denoised.ply"))));
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
    await page.waitForFunction(() => document.body.dataset.settled); // and with it the normals of the result
    const after = difference(before, await blocks(page, await picture(page)));
    assert.ok(after < 1.5, `the picture differs by ${after}`);
  });

});

test("100,000 points: the picture follows the slider, and what is saved is nearer to the truth", models, async (t) => {
  const folder = temporaryFolder(t);
  const noisy = noisyArmadillo(folder, 100000, kModels);
  const { page } = await show(t, [noisy, "--save-folder", folder], "#k=16&iterations=1&view.up=y");
  await pull(page, slider(page, "similarity_sigma"), 0.3, 0.4, 0.5, 0.6, 0.7, 0.8);
  await settled(page);
  for (const name of ["k", "iterations", "similarity_sigma"]) await page.locator(`[data-param="${name}"] button.auto`).click();
  await settled(page);
  await page.locator("#save").click();
  await page.waitForFunction(() => document.body.dataset.saved);
  const [before, after] = [distance(noisy), distance(path.join(folder, "noisy_denoised.ply"))];
  t.diagnostic(`mean distance to the mesh ${before} before, ${after} after`);
  assert.ok(after < 0.6 * before, `${before} to ${after}`);
});
