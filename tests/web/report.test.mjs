// SPDX-License-Identifier: Apache-2.0
// The page that --report writes, in a browser: everyone can read it, on a telephone and on paper, without a network.
import assert from "node:assert/strict";
import { readFileSync, statSync, writeFileSync } from "node:fs";
import path from "node:path";
import test from "node:test";
import { pathToFileURL } from "node:url";
import { modules, openBrowser, run, settled, temporaryFolder, view, openPage } from "./program.mjs";

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
  const context = await (await openBrowser(t)).newContext({ viewport: { width: 1280, height: 900 } });
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
  const { url } = await view(t, [scan, "--port", 0]);
  const { page, faults } = await openPage(t, await openBrowser(t), url);
  await settled(page);
  await page.locator(".expert > summary").click();
  assert.deepEqual(await seriousFindings(page), []);
  await page.keyboard.press("?");
  await page.getByRole("dialog").waitFor();
  assert.deepEqual(await seriousFindings(page), []);
  assert.deepEqual(faults, []);
  const empty = await openPage(t, page.context().browser(), (await view(t, ["--port", 0])).url);
  await empty.page.getByRole("heading", { name: "Open a scan" }).waitFor();
  assert.deepEqual(await seriousFindings(empty.page), [], "without a file");
});
