// SPDX-License-Identifier: Apache-2.0
// node bench/viewer_page.mjs [--points N] [--models FOLDER] [--seconds S]: times the page in a headless Chromium with a
// graphics card in software and prints one JSON object: when the whole result was first there, how often the picture
// changed while a slider was pulled and while the camera was turned, when it was whole again, and the memory that both sides then held.
// POINTFAIR_BIN is the program, POINTFAIR_WEB the folder that its page was built in.
import { execFileSync } from "node:child_process";
import { readdirSync, readFileSync } from "node:fs";
import os from "node:os";
import path from "node:path";
import { fileURLToPath } from "node:url";
import {
  dataset, grip, launchBrowser, noisyArmadillo, openPage, settled, slider, temporaryFolder, updates, view,
} from "../tests/web/program.mjs";

const kSource = path.join(path.dirname(fileURLToPath(import.meta.url)), "..");
const kMoves = 30; // a second, of the pointer

function options() {
  const given = { points: "100000", models: path.join(kSource, "build/demo"), seconds: "4" };
  for (let i = 2; i + 1 < process.argv.length; i += 2) {
    const name = process.argv[i].replace(/^--/, "");
    if (!(name in given)) throw new Error(`unknown flag ${process.argv[i]}`);
    given[name] = process.argv[i + 1];
  }
  return { points: Number(given.points), models: given.models, seconds: Number(given.seconds) };
}

/** Megabytes that a process holds now, and at most so far. */
function held(process) {
  const status = readFileSync(`/proc/${process}/status`, "utf8");
  const of = (key) => Math.round(Number(status.match(new RegExp(`${key}:\\s+(\\d+)`))[1]) / 1024);
  return { now: of("VmRSS"), most: of("VmHWM") };
}

/** The process that is the graphics card, among those that this one started. */
function cardProcess() {
  const parents = new Map();
  const cards = [];
  for (const name of readdirSync("/proc").filter((entry) => /^\d+$/.test(entry))) {
    try {
      parents.set(name, readFileSync(`/proc/${name}/stat`, "utf8").replace(/^.*\) /, "").split(" ")[1]);
      if (readFileSync(`/proc/${name}/cmdline`, "utf8").includes("--type=gpu-process")) cards.push(name);
    } catch {
      // it has ended meanwhile
    }
  }
  const isOurs = (name) => name === String(process.pid) || (parents.has(name) && isOurs(parents.get(name)));
  return cards.find(isOurs);
}

/** Megabytes of the page's objects and of its arrays. */
async function heap(page) {
  const client = await page.context().newCDPSession(page);
  await client.send("HeapProfiler.collectGarbage");
  const { usedSize, backingStorageSize = NaN } = await client.send("Runtime.getHeapUsage");
  return { objects: Math.round(usedSize / 2 ** 20), arrays: Math.round(backingStorageSize / 2 ** 20) };
}

/** Changes of the picture a second while the pointer goes to and fro. */
async function pulled(page, seconds) {
  const hand = await grip(page, slider(page, "similarity_sigma"), 0.5);
  const before = await updates(page);
  const begin = performance.now();
  for (let i = 0; performance.now() - begin < 1000 * seconds; ++i) {
    await hand.move(0.5 + 0.3 * Math.sin(i / 12));
    await page.waitForTimeout(1000 / kMoves);
  }
  const rate = ((await updates(page)) - before) / ((performance.now() - begin) / 1000);
  await hand.release();
  return rate;
}

/** Pictures a second while the camera turns. */
async function turned(page, seconds) {
  const box = await page.locator(".stage > canvas").boundingBox();
  const frames = async () => Number(await dataset(page, "frames"));
  await page.mouse.move(box.x + box.width / 2, box.y + box.height / 2);
  await page.mouse.down();
  const before = await frames();
  const begin = performance.now();
  for (let i = 0; performance.now() - begin < 1000 * seconds; ++i) {
    await page.mouse.move(box.x + box.width * (0.5 + 0.3 * Math.sin(i / 20)), box.y + box.height * (0.5 + 0.1 * Math.sin(i / 31)));
    await page.waitForTimeout(1000 / kMoves);
  }
  const rate = ((await frames()) - before) / ((performance.now() - begin) / 1000);
  await page.mouse.up();
  return rate;
}

async function measure(scope, { points, models, seconds }) {
  execFileSync("python3", [path.join(kSource, "scripts/models.py"), models], { stdio: ["ignore", "ignore", "inherit"] });
  const noisy = noisyArmadillo(temporaryFolder(scope), points, models);
  const browser = await launchBrowser();
  scope.after(() => browser.close());
  const started = performance.now();
  const { url, child } = await view(scope, [noisy, "--port", 0]);
  const opened = performance.now();
  const { page, faults } = await openPage(scope, browser, `${url}#k=16&iterations=1&view.up=y`);
  await settled(page);
  const ready = performance.now();
  const slider_rate = await pulled(page, seconds);
  await settled(page);
  const camera_rate = await turned(page, seconds);
  const let_go = performance.now();
  await page.waitForFunction(() => document.body.dataset.still === "true");
  const whole = performance.now();
  const result = {
    points, shown: await page.locator(".file .count").textContent(), cores: os.cpus().length, load: os.loadavg()[0],
    server_ms: opened - started, page_ms: ready - opened, last_answer_ms: Number(await dataset(page, "serverMs")),
    updates_a_second: slider_rate, frames_a_second: camera_rate, whole_again_ms: whole - let_go,
    megabytes: { server: held(child.pid), page: await heap(page), card: held(cardProcess()) },
  };
  if (faults.length) throw new Error(faults.join("; "));
  return result;
}

const ends = [];
try {
  console.log(JSON.stringify(await measure({ after: (end) => ends.unshift(end) }, options()), null, 2));
} finally {
  for (const end of ends) await end();
}
