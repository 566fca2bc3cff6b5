// SPDX-License-Identifier: Apache-2.0
// The page without a server: files of several formats are dropped, denoised and saved by pointfair as WebAssembly, without a
// network, and the saved files are the program's, byte for byte. `make site` and `make test-site` build the page.
import assert from "node:assert/strict";
import { existsSync, readdirSync, readFileSync, writeFileSync } from "node:fs";
import http from "node:http";
import path from "node:path";
import { gzipSync } from "node:zlib";
import { assertColours, parts, texturedSheet } from "./textured.mjs";
import { dataset, entry, openBrowser, openPage, run, settled, sheet, temporaryFolder, test, type } from "./program.mjs";

const kPage = process.env.POINTFAIR_SERVERLESS;
const built = existsSync(path.join(kPage, "pointfair.wasm"))
  ? {} : { skip: `${kPage} is not there: make test-site builds it, with a compiler from PyPI` };
const kTypes = { html: "text/html", js: "text/javascript", css: "text/css", svg: "image/svg+xml", wasm: "application/wasm" };

/** Serves the page's files as any host of static files does; resolves with the URL. */
async function serve(t) {
  const server = http.createServer((request, response) => {
    const name = new URL(request.url, "http://x").pathname.replace(/\/$/, "/index.html");
    const file = path.join(kPage, name.replace("/app/", ""));
    if (!existsSync(file)) return response.writeHead(404).end();
    response.writeHead(200, { "Content-Type": kTypes[name.split(".").at(-1)], "Cache-Control": "no-store" }).end(readFileSync(file));
  });
  await new Promise((resolve) => server.listen(0, "127.0.0.1", resolve));
  t.after(() => server.closeAllConnections?.() ?? server.close());
  t.after(() => server.close());
  return { url: `http://127.0.0.1:${server.address().port}/app/`, server };
}

async function open(t) {
  const { url, server } = await serve(t);
  const opened = await openPage(t, await openBrowser(), url);
  await opened.page.getByRole("heading", { name: "Open a scan" }).waitFor();
  await opened.page.waitForFunction(() => document.body.dataset.offline === "true");
  return { ...opened, server };
}

/** Drops a file onto the page, with others that it names, and waits until it has its result. */
async function drop(page, file, comes = true, named = []) {
  const data = await page.evaluateHandle(parts, [...named, file].map((one) => [path.basename(one), readFileSync(one).toString("base64")]));
  await page.dispatchEvent("body", "drop", { dataTransfer: data });
  if (!comes) return;
  await page.waitForFunction((name) => document.body.dataset.cloud === name, path.basename(file));
  await settled(page);
}

/** The bytes that the page gives for a file of that name. */
async function save(page, name) {
  await page.locator("#output").fill(name);
  const coming = page.waitForEvent("download");
  await page.locator("#save").click();
  const download = await coming;
  assert.equal(download.suggestedFilename(), name);
  return readFileSync(await download.path());
}

test("what is dropped is denoised without a network, and saved as the program saves it", built, async (t) => {
  const folder = temporaryFolder(t);
  const xyz = sheet(folder, "sheet.xyz", 60);
  const files = ["ply", "las", "laz", "obj"].map((ending) => path.join(folder, `sheet.${ending}`));
  for (const file of files) run(["run", xyz, file, "--strength", 0, "-q"]);
  const { page, context } = await open(t);
  await context.setOffline(true);
  const asked = [];
  page.on("request", (request) => asked.push(new URL(request.url())));
  for (const file of files) {
    await drop(page, file);
    const denoised = `denoised${path.extname(file)}`;
    const [mine, theirs] = [await save(page, denoised), path.join(folder, denoised)];
    run(["run", file, theirs, "--device", "cpu", "-q"]);
    assert.ok(mine.equals(readFileSync(theirs)), `${file}: the same bytes`);
  }
  await type(page, "k", "16");
  const mine = await save(page, "k16.ply");
  run(["run", files[3], path.join(folder, "k16.ply"), "--k", 16, "--device", "cpu", "-q"]);
  assert.ok(mine.equals(readFileSync(path.join(folder, "k16.ply"))), "--k 16: the same bytes");
  // files of the page, which a service worker keeps
  assert.deepEqual(asked.filter((url) => url.protocol !== "blob:" && !existsSync(path.join(kPage, url.pathname.replace("/app/", "")))), []);
});

test("the page opens again without a network", built, async (t) => {
  const { page, faults, context, server } = await open(t);
  await context.setOffline(true);
  server.closeAllConnections();
  server.close();
  await page.reload();
  await page.getByRole("heading", { name: "Open a scan" }).waitFor();
  await drop(page, sheet(temporaryFolder(t), "later.xyz", 40));
  assert.equal(await dataset(page, "cloud"), "later.xyz");
  assert.deepEqual(faults.splice(0).filter((fault) => !fault.includes("ERR_")), []);
});

test("a run is stopped, and the cloud is there for the next one", built, async (t) => {
  const folder = temporaryFolder(t);
  const file = sheet(folder, "sheet.xyz", 300);
  const { page } = await open(t);
  await drop(page, file);
  await entry(page, "iterations").fill("30");
  await page.keyboard.press("Enter");
  await page.getByRole("button", { name: "Stop" }).click();
  await page.locator(".toast", { hasText: "Stopped" }).waitFor();
  assert.equal(await dataset(page, "busy"), "false");
  await type(page, "k", "12");
  const mine = await save(page, "out.xyz");
  run(["run", file, path.join(folder, "out.xyz"), "--k", 12, "--device", "cpu", "-q"]);
  assert.ok(mine.equals(readFileSync(path.join(folder, "out.xyz"))));
});

test("a slider that is pulled shows previews and ends with the whole result", built, async (t) => {
  const { page } = await open(t);
  await drop(page, sheet(temporaryFolder(t), "sheet.xyz", 200));
  const range = page.locator('[data-param="k"] input[type=range]');
  await range.scrollIntoViewIfNeeded();
  const box = await range.boundingBox();
  await page.mouse.move(box.x + 10, box.y + box.height / 2);
  await page.mouse.down();
  for (const share of [0.2, 0.3, 0.4, 0.5]) {
    await page.mouse.move(box.x + share * box.width, box.y + box.height / 2);
    await page.waitForTimeout(100);
  }
  await page.mouse.up();
  await settled(page);
  assert.equal(await dataset(page, "error"), undefined);
});

test("a mesh has its texture where the files that it names are dropped with it, and keeps it over runs", built, async (t) => {
  const folder = temporaryFolder(t);
  const file = texturedSheet(folder);
  const { page } = await open(t);
  await page.evaluate(() => (location.hash = "#cloud=sheet.obj&view.mode=before&view.shade=0&view.edl=0&view.camera=0,0,2.6,0,0,0&view.up=y"));
  await drop(page, file, true, ["picture.png", "sheet.mtl"].map((name) => path.join(folder, name)));
  await page.waitForFunction(() => document.body.dataset.pictures === "1");
  await assertColours(page, "dropped");
  await type(page, "iterations", "30");
  await assertColours(page, "after a run");
  await drop(page, file);
  await page.locator(".toast", { hasText: "sheet.mtl: is not here; open it together with the mesh that names it." }).waitFor();
});

test("what the page cannot take is refused in one line, and the cloud before stays", built, async (t) => {
  const folder = temporaryFolder(t);
  const [large, broken] = ["large.xyz", "broken.ply"].map((name) => path.join(folder, name));
  writeFileSync(large, Array.from({ length: 1000001 }, (_, i) => `${i % 1000} ${Math.floor(i / 1000)} 0`).join("\n"));
  writeFileSync(broken, "ply\nformat ascii 1.0\n");
  const { page } = await open(t);
  await drop(page, sheet(folder, "sheet.xyz", 40));
  for (const [file, words] of [[large, /large\.xyz has 1000001 points and this page takes up to 1000000: install pointfair/], [broken, /broken\.ply/]]) {
    await drop(page, file, false);
    await page.locator(".toast.error", { hasText: words }).waitFor();
  }
  await type(page, "k", "12");
  assert.equal(await dataset(page, "cloud"), "sheet.xyz");
});

test("the page may ask no other host, and is less than 3 MB compressed", built, async (t) => {
  const { page } = await open(t);
  const refused = await page.evaluate(() => new Promise((resolve) => {
    document.addEventListener("securitypolicyviolation", (event) => resolve(event.violatedDirective));
    void fetch("https://pointfair.invalid/").catch(() => undefined);
  }));
  assert.equal(refused, "connect-src");
  const files = readdirSync(kPage, { recursive: true, withFileTypes: true }).filter((entry) => entry.isFile());
  const bytes = files.reduce((sum, { path: folder, name }) => sum + gzipSync(readFileSync(path.join(folder, name))).length, 0);
  assert.ok(bytes < 3e6, `${bytes} bytes`);
});
