// SPDX-License-Identifier: Apache-2.0
// The page that --report writes, in a browser: everyone can read it, on a telephone and on paper, without a network.
import assert from "node:assert/strict";
import { spawnSync } from "node:child_process";
import { mkdirSync, readFileSync, statSync, writeFileSync } from "node:fs";
import path from "node:path";
import { pathToFileURL } from "node:url";
import { kProgram, modules, openBrowser, openPage, run, save, settled, show, temporaryFolder, test, type, view } from "./program.mjs";

const kAxe = readFileSync(modules.resolve("axe-core/axe.min.js"), "utf8");

/** What axe finds that is serious or worse, in words. */
async function seriousFindings(page) {
  await page.evaluate(kAxe);
  const { violations } = await page.evaluate(() => globalThis.axe.run());
  return violations.filter(({ impact }) => ["serious", "critical"].includes(impact))
    .map(({ id, help, nodes }) => `${id}: ${help}: ${nodes.map(({ html }) => html.slice(0, 120)).join(" | ")}`);
}

const waves = (count) => Array.from({ length: count }, (_, i) => {
  const [x, y] = [i % 100, Math.floor(i / 100)];
  return `${x / 10} ${y / 10} ${Math.sin(x / 9) * Math.cos(y / 8) + (((i * 7919) % 101) - 50) / 1000}`;
}).join("\n");

test("the report of a run is read by everyone, without a network", async (t) => {
  const folder = temporaryFolder(t);
  const [scan, out, report] = ["scan.xyz", "out.xyz", "report.html"].map((name) => path.join(folder, name));
  writeFileSync(scan, `${waves(10000)}\n5 5 6\n2 3 -4\n`);
  run(["run", scan, out, "--report", report, "-q"]);
  assert.ok(statSync(report).size < 3e6);
  const context = await (await openBrowser()).newContext({ viewport: { width: 1280, height: 900 } });
  t.after(() => context.close());
  const page = await context.newPage();
  const [asked, faults] = [[], []];
  page.on("request", (request) => request.url().startsWith("data:") || asked.push(request.url()));
  page.on("console", (message) => message.type() === "error" && faults.push(message.text()));
  page.on("pageerror", (error) => faults.push(String(error)));
  const url = pathToFileURL(report).href;
  await page.goto(url);
  assert.deepEqual(asked, [url]);
  assert.equal(await page.title(), "out.xyz");
  const sizes = await page.locator("img").evaluateAll((images) => images.map((image) => [image.complete, image.naturalWidth]));
  assert.deepEqual(sizes, Array(7).fill([true, 720]));
  assert.deepEqual(await seriousFindings(page), []);
  assert.deepEqual(faults, []);
  await page.setViewportSize({ width: 360, height: 640 });
  assert.ok(await page.evaluate(() => document.documentElement.scrollWidth) <= 360, "it does not fit a telephone");
  const pdf = await page.pdf({ format: "A4" });
  const pages = pdf.toString("latin1").match(/\/Type\s*\/Page\b/g).length;
  t.diagnostic(`${statSync(report).size} bytes, ${pages} pages on paper`);
  assert.ok(pages >= 2 && pages <= 8);
});

test("the viewer has no serious fault of accessibility", async (t) => {
  const scan = path.join(temporaryFolder(t), "scan.xyz");
  writeFileSync(scan, waves(3000));
  const { page } = await show(t, [scan]);
  await page.locator(".expert > summary").click();
  assert.deepEqual(await seriousFindings(page), []);
  await page.keyboard.press("?");
  await page.getByRole("dialog").waitFor();
  assert.deepEqual(await seriousFindings(page), []);
  const empty = await openPage(t, page.context().browser(), (await view(t, ["--port", 0])).url);
  await empty.page.getByRole("heading", { name: "Open a scan" }).waitFor();
  assert.deepEqual(await seriousFindings(empty.page), [], "without a file");
});

test("the viewer says what the program says of a result that may not be what it seems", async (t) => {
  const folder = temporaryFolder(t);
  const [scan, out] = ["sparse.xyz", "out.xyz"].map((name) => path.join(folder, name));
  const random = (i, seed) => ((i * 7919 + seed * 104729) * 9301 + 49297) % 233280 / 233.28; // 0 to 1000
  writeFileSync(scan, Array.from({ length: 3000 }, (_, i) => `${random(i, 1)} ${random(i * i, 2)} ${random(i * 31, 3) / 20000}`).join("\n"));
  const { stderr } = spawnSync(kProgram, ["run", scan, out], { encoding: "utf8" });
  const said = [...stderr.matchAll(/^note: (.*)$/gm)].map(([, note]) => note);
  assert.match(said.join(), /so far apart, noise and shape look the same/);

  const { page, url } = await show(t, [scan]);
  const notes = page.getByRole("status").filter({ hasText: "on this result" });
  assert.deepEqual(await notes.locator("li").allTextContents(), said);
  assert.deepEqual(await seriousFindings(page), []);
  await page.setViewportSize({ width: 360, height: 740 });
  assert.ok(await page.evaluate(() => document.documentElement.scrollWidth <= innerWidth), "nothing is wider than the screen");
  const title = page.locator(".notes summary");
  for (let i = 0; i < 50 && !(await title.evaluate((element) => element === document.activeElement)); ++i) await page.keyboard.press("Tab");
  await page.keyboard.press("Enter");
  assert.ok(await notes.locator("li").first().isHidden(), "the keyboard folds them");
  await type(page, "noise", "1"); // then the points are not far apart for it
  assert.equal(await page.locator(".notes").isVisible(), false);

  const phone = await openPage(t, page.context().browser(), url, { viewport: { width: 360, height: 740 } });
  await settled(phone.page);
  assert.ok(await phone.page.locator(".notes summary").isVisible());
  assert.ok(await phone.page.locator(".notes li").first().isHidden(), "where they would hide the picture, they are folded");
});

test("the viewer says what the program says of a mesh that it saves", async (t) => {
  const folder = temporaryFolder(t), results = path.join(folder, "results");
  mkdirSync(results);
  const scan = path.join(folder, "scan.obj"), side = 40;
  const vertices = Array.from({ length: side * side }, (_, i) =>
    `v ${i % side} ${Math.floor(i / side)} ${Math.sin((i % side) / 6) + ((i * 7919) % 101) / 202}`);
  const corner = (i) => `${i}//1`;
  const faces = Array.from({ length: (side - 1) ** 2 }, (_, i) => i + Math.floor(i / (side - 1)) + 1)
    .map((i) => `f ${[i, i + 1, i + side + 1, i + side].map(corner).join(" ")}`);
  writeFileSync(scan, ["mtllib scan.mtl", ...vertices, "vn 0 0 1", "usemtl skin", ...faces, ""].join("\n"));
  writeFileSync(path.join(folder, "scan.mtl"), "newmtl skin\n");
  const { page } = await show(t, [scan, "--save-folder", results]);
  for (const name of ["out.obj", "out.ply"]) {
    const { stderr } = spawnSync(kProgram, ["run", scan, path.join(results, `run_${name}`)], { encoding: "utf8" });
    const said = [...stderr.matchAll(/^note: (.*)$/gm)].map(([, note]) => note);
    assert.match(said.join(), /faces of the file are not followed/);
    assert.match(said.join(), name === "out.obj" ? /normals in the file are those from before.*beside the input only/ : /scan\.mtl/);
    await save(page, name);
    const toast = await page.locator(".toast", { hasText: name }).textContent();
    const shown = await page.locator(".notes li").allTextContents();
    for (const note of said) assert.ok(shown.includes(note) || toast.includes(`Note: ${note}`), `${note} of ${name}`);
  }
});
