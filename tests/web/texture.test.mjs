// SPDX-License-Identifier: Apache-2.0
// Pictures on the faces of a mesh: where they lie, before and after, and what is said where one is missing or must not be read.
import assert from "node:assert/strict";
import { mkdirSync, readFileSync, writeFileSync } from "node:fs";
import path from "node:path";
import { blocks, difference, picture } from "./looks.mjs";
import { assertColours, kColours, parts, quadrants, texturedGlb, texturedPly, texturedSheet } from "./textured.mjs";
import { dataset, openBrowser, openPage, settled, show, temporaryFolder, test, view } from "./program.mjs";

const kLook = "view.mode=before&view.shade=0&view.edl=0&view.camera=0,0,2.6,0,0,0&view.up=y";

async function open(t, file, look = kLook) {
  const opened = await show(t, [file], `#cloud=${path.basename(file)}&${look}`);
  await opened.page.waitForFunction(() => document.body.dataset.settled);
  return opened;
}

for (const [format, make] of [["OBJ", texturedSheet], ["PLY", texturedPly], ["GLB", texturedGlb]]) {
  test(`the picture of ${format} faces lies where the file says, before and after, on both sides of a seam`, async (t) => {
    const { page } = await open(t, make(temporaryFolder(t)));
    await page.waitForFunction(() => document.body.dataset.pictures === "1");
    assert.equal(await page.locator("#colour").inputValue(), "texture", "shown without asking");
    for (const side of ["Original", "Denoised"]) {
      await page.getByRole("radio", { name: side }).click();
      for (const way of ["Smooth", "Flat"]) {
        await page.getByRole("radio", { name: way }).click();
        await assertColours(page, `${side}, ${way}`);
      }
    }
    await page.locator("#colour").selectOption("height");
    assert.ok((await quadrants(page)).red < 0.1, "other colours replace it");
    await page.locator("#colour").selectOption("texture");
    await assertColours(page, "again");
  });
}

test("faces along a seam move as those without one", async (t) => {
  const folder = temporaryFolder(t);
  const textured = texturedSheet(folder), plain = path.join(folder, "plain.obj");
  writeFileSync(plain, readFileSync(textured, "utf8").replaceAll(/^(vt|mtllib|usemtl).*\n/gm, "").replaceAll(/\/\d+/g, ""));
  const look = "view.mode=after&view.exaggerate=10&view.colour=plain&view.shade=1&view.camera=1.8,0.6,1.6,0,0,0&view.up=y";
  const { page } = await open(t, textured, look);
  await page.locator("#colour").selectOption("texture");
  await page.waitForFunction(() => document.body.dataset.pictures === "1");
  await page.locator("#colour").selectOption("plain");
  const { page: other } = await open(t, plain, look);
  for (const way of ["Smooth", "Flat", "Wireframe"]) {
    const seen = [];
    for (const one of [page, other]) {
      await one.getByRole("radio", { name: way }).click();
      seen.push(await blocks(one, await picture(one), 320, 200));
    }
    assert.ok(difference(...seen) < 0.02, `${way}: ${difference(...seen)}`);
  }
  await page.getByRole("radio", { name: "Original" }).click();
  assert.ok(difference(await blocks(page, await picture(page), 320, 200), await blocks(other, await picture(other), 320, 200)) > 1, "the displacements show");
});

test("a picture that is missing, is no picture, or lies outside of the folder is named in one line, and faces are drawn plain", async (t) => {
  const outer = temporaryFolder(t);
  for (const [name, library, words] of [
    ["gone", "map_Kd gone.png", /gone\.png: is not in the mesh's folder; put it there\./],
    ["text", "map_Kd sheet.mtl", /sheet\.mtl: is no PNG, JPEG or WebP picture; convert it to one of these\./],
    ["broken", "map_Kd broken.png", /broken\.png: cannot be decoded; is it damaged\?/],
    ["above", "map_Kd ../secret.png", /\.\.\/secret\.png: is outside of the mesh's folder/],
    ["absolute", `map_Kd ${path.join(outer, "secret.png")}`, /secret\.png: is outside of the mesh's folder/],
    ["library", null, /sheet\.mtl: is not in the mesh's folder; put it there\./],
  ]) {
    await t.test(name, async (t) => {
      const folder = path.join(outer, name);
      mkdirSync(folder);
      const file = texturedSheet(folder, library === null ? null : `newmtl painted\n${library}\n`);
      writeFileSync(path.join(outer, "secret.png"), readFileSync(path.join(folder, "picture.png")));
      writeFileSync(path.join(folder, "broken.png"), readFileSync(path.join(folder, "picture.png")).subarray(0, 60));
      const { url } = await view(t, [file, "--port", 0]);
      const { page, faults } = await openPage(t, await openBrowser(), `${url}#cloud=sheet.obj&${kLook}`);
      await page.locator(".toast", { hasText: words }).waitFor();
      await settled(page);
      assert.equal(await dataset(page, "pictures"), "0");
      await page.evaluate(() => document.querySelectorAll(".toast").forEach((toast) => toast.remove()));
      const shares = await quadrants(page);
      for (const colour of Object.keys(kColours)) assert.ok(shares[colour] < 0.01, `${colour} ${JSON.stringify(shares)}`);
      assert.deepEqual(faults, []);
    });
  }
});

test("a mesh is opened in the page together with the files that it names", async (t) => {
  const folder = temporaryFolder(t);
  const file = texturedSheet(folder);
  const names = ["picture.png", "sheet.mtl", "sheet.obj"].map((name) => path.join(folder, name));
  const { url } = await view(t, ["--port", 0]);
  const { page } = await openPage(t, await openBrowser(), `${url}#cloud=sheet.obj&${kLook}`);
  const choosing = page.waitForEvent("filechooser");
  await page.locator("#choose").click();
  await (await choosing).setFiles(names);
  await settled(page);
  await page.waitForFunction(() => document.body.dataset.pictures === "1");
  await assertColours(page, "chosen");
  const dropped = await page.evaluateHandle(parts, [file].map((name) => [path.basename(name), readFileSync(name).toString("base64")]));
  await page.dispatchEvent("body", "drop", { dataTransfer: dropped });
  await page.locator(".toast", { hasText: "sheet.mtl: is not here; open it together with the mesh that names it." }).waitFor();
});
