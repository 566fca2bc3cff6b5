// SPDX-License-Identifier: Apache-2.0
// What can be done: stop a run, save in every format, hold points still, bring a link, and lose the page to another.
import assert from "node:assert/strict";
import { readFileSync } from "node:fs";
import path from "node:path";
import {
  copied, drawLasso, entry, kModels, noisyArmadillo, openBrowser, openPage, run, save, settled, sheet, show, slide, temporaryFolder, test, type,
  updates, view, withModels,
} from "./program.mjs";

const models = withModels();

const report = (file) => JSON.parse(run(["info", file, "--report", "-"]));

test("the result is saved in every format that is offered", models, async (t) => {
  const folder = temporaryFolder(t);
  const { page } = await show(t, [noisyArmadillo(folder, 2000, kModels), "--save-folder", folder]);
  const hint = await page.locator("#output").getAttribute("title");
  const extensions = hint.match(/(\.\w+)+/g).map((word) => word.slice(1));
  assert.deepEqual(extensions, ["ply", "pcd", "las", "laz", "xyz", "txt", "csv", "pts", "off", "obj", "e57", "ptx", "stl", "npy", "copc.laz"]);
  const encodings = await page.locator("#encoding option").evaluateAll((options) => options.map((option) => option.value).filter(Boolean));
  assert.deepEqual(encodings, ["ascii", "binary", "binary-big-endian", "binary-compressed"]);
  const names = [...extensions.filter((extension) => extension !== "stl").map((extension) => [`denoised.${extension}`, ""]), ["a.ply", "ascii"], ["b.ply", "binary"],
    ["c.ply", "binary-big-endian"], ["a.pcd", "ascii"], ["b.pcd", "binary"], ["c.pcd", "binary-compressed"]];
  for (const [name, encoding] of names) {
    await save(page, name, encoding);
    const [saved, first] = [report(path.join(folder, name)), report(path.join(folder, "denoised.ply"))];
    assert.equal(saved.points, 2000, name);
    for (const end of ["min", "max"])
      saved.bounds[end].forEach((v, i) => assert.ok(Math.abs(v - first.bounds[end][i]) < 1e-3 * Math.abs(first.diagonal ?? 100), name));
  }
  await page.locator("#output").fill("denoised.ply");
  await page.locator("#encoding").selectOption("");
  await page.locator("#save").click();
  await page.locator(".toast.error", { hasText: "exists already" }).waitFor();
  await page.locator("#overwrite").check();
  await page.locator("#save").click();
  await page.locator(".toast", { hasText: /Saved .*denoised\.ply/ }).waitFor();
});

/** The lines of a text cloud. */
const lines = (file) => readFileSync(file, "utf8").trim().split("\n");

test("only what the box and the lasso hold moves, and by the strength's share", models, async (t) => {
  const folder = temporaryFolder(t);
  run(["noise", path.join(kModels, "armadillo.off"), path.join(folder, "scan.xyz"), "--points", 4000, "--sigma", "0.3%", "--seed", 1, "-q"]);
  const { page } = await show(t, [path.join(folder, "scan.xyz"), "--save-folder", folder], "#view.up=y");
  await save(page, "all.xyz");
  await slide(page, "#strength", "0.5");
  await settled(page);
  await save(page, "half.xyz");
  await page.locator("#box").check();
  const low = page.getByLabel("box x from");
  for (let i = 0; i < 40; ++i) await low.press("ArrowRight");
  await settled(page);
  await save(page, "box.xyz");
  await drawLasso(page, [0.3, 0.05], [0.7, 0.05], [0.7, 0.5], [0.3, 0.5]); // the upper half of the picture
  await settled(page);
  await save(page, "lasso.xyz");

  const [scan, all, half, boxed, lassoed] = ["scan", "all", "half", "box", "lasso"].map((name) => lines(path.join(folder, `${name}.xyz`)));
  const limit = await page.evaluate(() => Number(new URLSearchParams(location.hash.slice(1)).get("limit.box").split(",")[0]));
  const counts = { all: 0, half: 0, box: 0, lasso: 0 };
  scan.forEach((line, i) => {
    const at = (text) => text.split(" ").map(Number);
    const [p, q, r] = [line, all[i], half[i]].map(at);
    counts.all += all[i] !== line;
    counts.half += half[i] !== line;
    p.forEach((v, c) => assert.ok(Math.abs(v + (q[c] - v) / 2 - r[c]) < 1e-3 * Math.abs(q[c] - v) + 1e-4, `point ${i} goes half the way`));
    counts.box += boxed[i] !== line;
    if (p[0] < limit) assert.equal(boxed[i], line, "outside the box nothing moves");
    else assert.equal(boxed[i], half[i], "inside it moves as without a box");
    counts.lasso += lassoed[i] !== line;
    if (lassoed[i] !== line) assert.equal(lassoed[i], boxed[i], "what the lasso holds moves as without it");
  });
  t.diagnostic(JSON.stringify(counts));
  assert.ok(counts.all > 3500 && counts.box > 100 && counts.box < 0.95 * counts.half);
  assert.ok(counts.lasso > 50 && counts.lasso < 0.9 * counts.box);
  await page.getByRole("button", { name: "Clear lasso" }).click();
  const face = page.getByLabel("coordinate of the box, x from");
  assert.ok(Math.abs(Number(await face.inputValue()) - limit) < 1e-6 * Math.abs(limit) + 1e-9, "the face that was moved says where it is");
  const typed = Number((limit + 0.01).toPrecision(6));
  await face.fill(String(typed));
  await slide(page, "#strength", "0.6");
  await settled(page);
  assert.equal(await face.inputValue(), String(typed), "no answer replaces what is being typed");
  await face.press("Enter");
  await page.waitForFunction((x) => Number(new URLSearchParams(location.hash.slice(1)).get("limit.box").split(",")[0]) === x, typed);
  await face.fill("abc");
  await face.press("Enter");
  await page.waitForFunction((x) => Number(document.querySelector('[aria-label="coordinate of the box, x from"]').value) === x, typed);
  await page.locator("#box").uncheck();
  await page.waitForFunction(() => !location.hash.includes("limit.box") && !location.hash.includes("limit.lasso"));
});

test("a long run says how far it is, is stopped, and the next is sound", models, async (t) => {
  const { page } = await show(t, [noisyArmadillo(temporaryFolder(t), 100000, kModels)], "#k=100&iterations=1");
  await entry(page, "iterations").fill("100");
  await page.keyboard.press("Enter");
  await page.locator(".status progress").waitFor();
  await page.getByRole("button", { name: "Stop" }).click();
  await page.locator(".toast", { hasText: "Stopped" }).waitFor();
  await page.locator(".status progress").waitFor({ state: "hidden" });
  await page.waitForFunction((name) => document.querySelector(`[data-param="${name}"] input.entry`).value === "1", "iterations"); // as the shown result
  await type(page, "iterations", "2");
  assert.deepEqual(await page.locator(".stages i").evaluateAll((stages) => stages.map((stage) => stage.textContent.split(" ")[0]).includes("fairing")), true);
  assert.match(await page.locator("#total").textContent(), /[\d.]+ ms run, [\d.]+ ms answer/);
  assert.match(await page.locator("#rate").textContent(), /M points\/s/);
  assert.match(await page.locator(".status .device").textContent(), /^(cpu|cuda) · ./);
});

test("the command and the program name the file that was typed just now", async (t) => {
  const { page } = await show(t, [sheet(temporaryFolder(t), "scan.xyz", 60)]);
  await page.locator("#output").fill("first.ply");
  assert.match(await copied(page, "Copy as command", "command"), /first\.ply/);
  await page.locator("#output").fill("second.ply");
  await page.locator("#encoding").selectOption("ascii");
  const program = await copied(page, "Copy as C++", "program");
  assert.match(program, /second\.ply/);
  assert.match(program, /ascii/);
});

const headOf = (frame) => JSON.parse(frame.subarray(4, 4 + frame.readUInt32LE(0)).toString());

test("a result that comes when newer parameters have been asked for is known by its own", models, async (t) => {
  const { url } = await view(t, [noisyArmadillo(temporaryFolder(t), 3000, kModels), "--port", 0]);
  const held = []; // results of the second run on
  const hold = (socket) => {
    const server = socket.connectToServer();
    server.onMessage((frame) => {
      const head = headOf(frame);
      if (head.type !== "result" || head.id === 1) return socket.send(frame);
      held.push(() => socket.send(frame));
    });
  };
  const { page } = await openPage(t, await openBrowser(), url, {}, (before) => before.routeWebSocket(/session/, hold));
  await settled(page);
  for (const [i, k] of ["30", "40"].entries()) {
    await entry(page, "k").fill(k);
    await page.keyboard.press("Enter");
    for (let wait = 0; held.length <= i && wait < 2400; ++wait) await page.waitForTimeout(50);
  }
  assert.equal(held.length, 2);
  const before = await updates(page);
  held[0]();
  await page.waitForFunction((n) => Number(document.body.dataset.updates) > n, before);
  await page.getByRole("button", { name: "Copy as command" }).click();
  await page.locator(".toast", { hasText: "The run has not finished yet" }).waitFor();
  held[1]();
  await settled(page);
  assert.match(await copied(page, "Copy as command", "command"), /--k=40\b/);
});

test("a run is on its way until it ends, whatever else fails meanwhile", models, async (t) => {
  const folder = temporaryFolder(t);
  const { url } = await view(t, [noisyArmadillo(folder, 3000, kModels), "--save-folder", folder, "--port", 0]);
  let release; // the result of the second run
  let asked = 0; // runs
  const hold = (socket) => {
    const server = socket.connectToServer();
    socket.onMessage((text) => {
      asked += JSON.parse(text).type === "run";
      server.send(text);
    });
    server.onMessage((frame) => {
      const head = headOf(frame);
      if (head.type === "result" && head.id > 1) release = () => socket.send(frame);
      else socket.send(frame);
    });
  };
  const { page } = await openPage(t, await openBrowser(), url, {}, (before) => before.routeWebSocket(/session/, hold));
  await settled(page);
  await page.locator("#output").fill("no_such_folder/a.ply"); // which the command of the second run names
  for (let wait = 0; !release && wait < 2400; ++wait) await page.waitForTimeout(50);
  await page.locator("#save").click();
  await page.locator(".toast.error").waitFor();
  await page.getByRole("button", { name: "Copy as command" }).click();
  await page.waitForTimeout(500);
  assert.equal(asked, 2, "a run that is on its way is not asked for again");
  release();
  await page.locator(".toast", { hasText: "The command" }).waitFor();
});

test("a link brings the state to another page, which takes the cloud over; without a server the page says so", models, async (t) => {
  const { page, child, faults } = await show(t, [noisyArmadillo(temporaryFolder(t), 3000, kModels)]);
  await type(page, "k", "20");
  const other = await openPage(t, page.context().browser(), await copied(page, "Copy link", "link"));
  await settled(other.page);
  assert.equal(await entry(other.page, "k").inputValue(), "20");
  await page.locator(".hint", { hasText: "Another page has taken over this cloud" }).waitFor();
  assert.deepEqual(faults, []);
  child.kill("SIGTERM");
  await other.page.locator(".hint", { hasText: "The connection is lost" }).waitFor();
  faults.length = 0; // which the browser says too
});
