// SPDX-License-Identifier: Apache-2.0
// A LAZ tile in the page: shown, denoised by class, saved as the program would write it.
import assert from "node:assert/strict";
import { readFileSync, writeFileSync } from "node:fs";
import path from "node:path";
import { copied, dataset, run, save, settled, show, temporaryFolder, test } from "./program.mjs";

/** A waving ground of 3,600 points with a class each, at coordinates as surveys have them. */
function tile(folder) {
  const rows = ["x,y,z,classification"];
  for (let i = 0; i < 3600; ++i) {
    const [x, y] = [(i % 60) * 0.25, Math.floor(i / 60) * 0.25];
    const noise = 0.04 * (((i * 7919) % 101) / 101 - 0.5);
    rows.push(`${(500000 + x).toFixed(3)},${(5400000 + y).toFixed(3)},${(100 + 0.3 * Math.sin(x) + noise).toFixed(3)},${[2, 6, 7][i % 3]}`);
  }
  const csv = path.join(folder, "tile.csv");
  writeFileSync(csv, rows.join("\n") + "\n");
  run(["run", csv, path.join(folder, "tile.laz"), "--strength", 0, "-q"]);
  return path.join(folder, "tile.laz");
}

test("a LAZ tile is denoised by class and saved as the program writes it", async (t) => {
  const folder = temporaryFolder(t);
  const laz = tile(folder);
  const { page } = await show(t, [laz, "--save-folder", folder]);
  assert.equal(await dataset(page, "cloud"), "tile.laz");
  await page.locator("#colour").selectOption("attribute:classification");
  for (const [name, text] of [["where", "classification=2"], ["ignore", "classification=7"]]) {
    await page.locator(`#${name}`).fill(text);
    await page.locator(`#${name}`).press("Enter");
    await settled(page);
  }
  await save(page, "denoised.laz");
  run(["run", laz, path.join(folder, "expected.laz"), "--where", "classification=2", "--ignore", "classification=7", "-q"]);
  const [saved, expected] = ["denoised.laz", "expected.laz"].map((name) => readFileSync(path.join(folder, name)));
  assert.ok(saved.equals(expected));
  assert.ok(!saved.equals(readFileSync(laz)));
  assert.match(await copied(page, "Copy as command", "command"), /--where=classification=2 --ignore=classification=7/);

  await t.test("what the tile does not have is said", async () => {
    await page.locator("#where").fill("height=1");
    await page.locator("#where").press("Enter");
    await page.locator(".toast.error", { hasText: "no attribute 'height'" }).waitFor();
  });
});
