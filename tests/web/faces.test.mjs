// SPDX-License-Identifier: Apache-2.0
// A mesh in the page: drawn in every way, before and after, and followed as the program follows it.
import assert from "node:assert/strict";
import { execFileSync } from "node:child_process";
import { readFileSync, writeFileSync } from "node:fs";
import path from "node:path";
import { blocks, difference, picture } from "./looks.mjs";
import { copied, dataset, kProgram, save, settled, sheet, show, temporaryFolder, test } from "./program.mjs";

/** A waving sheet of quads with noise. */
function quads(folder) {
  const n = 50;
  const lines = [];
  for (let i = 0; i < n * n; ++i)
    lines.push(`v ${(i % n) / 10} ${0.4 * Math.sin((i % n) / 8) + 0.08 * (((i * 7919) % 101) / 101 - 0.5)} ${Math.floor(i / n) / 10}`);
  for (let i = 0; i + n < n * n; ++i) if (i % n < n - 1) lines.push(`f ${i + 1} ${i + 2} ${i + n + 2} ${i + n + 1}`);
  const file = path.join(folder, "sheet.obj");
  writeFileSync(file, lines.join("\n") + "\n");
  return file;
}

test("faces are drawn in every way, before and after, and followed", async (t) => {
  const folder = temporaryFolder(t);
  const { page } = await show(t, [quads(folder), "--save-folder", folder], "#view.mode=after");
  await page.waitForFunction(() => document.body.dataset.settled);
  assert.match(await page.locator(".file").textContent(), /2\D500 points, 2\D401 faces/);

  await t.test("ways to draw, of both sides", async () => {
    const seen = [];
    for (const side of ["Denoised", "Original"]) {
      await page.getByRole("radio", { name: side }).click();
      for (const way of ["Smooth", "Flat", "Wireframe", "Points"]) {
        await page.getByRole("radio", { name: way }).click();
        const now = await blocks(page, await picture(page), 320, 200);
        for (const [other, its] of seen) assert.ok(difference(now, its) > 0.03, `${side} ${way} looks like ${other}: ${difference(now, its)}`);
        seen.push([`${side} ${way}`, now]);
      }
    }
    await page.getByRole("radio", { name: "Denoised" }).click();
    await page.getByRole("radio", { name: "Smooth" }).click();
  });

  await t.test("edges are followed, by the copied command too", async () => {
    await page.locator(".expert > summary").click();
    await page.locator("#param-connectivity").selectOption("mesh");
    await settled(page);
    assert.equal(await dataset(page, "error"), undefined);
    await save(page, "followed.obj");
    const command = await copied(page, "Copy as command", "command");
    assert.match(command, /--connectivity=mesh/);
    const elsewhere = temporaryFolder(t);
    execFileSync("sh", ["-c", command], { cwd: elsewhere, env: { ...process.env, PATH: `${path.dirname(kProgram)}:${process.env.PATH}` }, stdio: "pipe" });
    assert.ok(readFileSync(path.join(folder, "followed.obj")).equals(readFileSync(path.join(elsewhere, "followed.obj"))));
  });
});

test("a cloud without faces has no parameters of meshes", async (t) => {
  const { page } = await show(t, [sheet(temporaryFolder(t), "plain.xyz", 30)]);
  await page.locator(".expert > summary").click();
  assert.ok(await page.locator('[data-param="method"]').isVisible());
  for (const name of ["connectivity", "rings", "keep_boundary", "tangential"])
    assert.ok(await page.locator(`[data-param="${name}"]`).isHidden(), name);
  assert.ok(await page.getByRole("radio", { name: "Wireframe" }).isHidden());
});
