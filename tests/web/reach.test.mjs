// SPDX-License-Identifier: Apache-2.0
// The page for those without a pointer, with a phone, or with weak eyes.
import assert from "node:assert/strict";
import { appendFileSync, existsSync } from "node:fs";
import path from "node:path";
import { blocks, canvas, difference, faintTexts, picture, pixelsOfDistance } from "./looks.mjs";
import { dataset, entry, kModels, noisyArmadillo, settled, sheet, show, slider, temporaryFolder, test, withModels } from "./program.mjs";

const models = withModels();

const start = (t, options, state = "#view.mode=after", folder = temporaryFolder(t)) =>
  show(t, [noisyArmadillo(folder, 3000, kModels), "--save-folder", folder], state, options);

/** What has the focus: its name, its kind, and whether the focus shows. */
const focused = (page) => page.evaluate(() => {
  const element = document.activeElement;
  if (element === document.body) return null;
  const name = element.getAttribute("aria-label") || element.labels?.[0]?.textContent || element.textContent || element.title;
  return { name: name.trim(), tag: element.tagName, outline: getComputedStyle(element).outlineStyle };
});

async function tabTo(page, name) {
  for (let i = 0; i < 150; ++i) {
    await page.keyboard.press("Tab");
    if ((await focused(page))?.name === name) return;
  }
  assert.fail(`${name} cannot be reached`);
}

test("every control is reached with the tabulator, has a name, and shows that it has the focus", models, async (t) => {
  const { page } = await start(t, {});
  const reached = new Set();
  for (let i = 0; i < 150; ++i) {
    await page.keyboard.press("Tab");
    const focus = await focused(page);
    if (!focus) break;
    assert.ok(focus.name, `a ${focus.tag} without a name`);
    assert.notEqual(focus.outline, "none", focus.name);
    reached.add(focus.name);
  }
  const names = ["Denoised", "Open a file", "Fit", "Measure", "Screenshot", "Keyboard", "Settings", "Noise", "Neighbours", "Neighbours auto", "Iterations", "Method", "Strength", "Clip box",
    "Only points in view", "Colour by", "Point size", "Eye-dome lighting", "Save", "Copy as command", "Copy as C++", "Copy link"];
  for (const name of names) assert.ok(reached.has(name), `${name} cannot be reached`);
});

test("a cloud is denoised, compared and saved with the keyboard alone", models, async (t) => {
  const folder = temporaryFolder(t);
  const { page } = await start(t, {}, "#view.mode=after", folder);
  const keys = async (...names) => {
    for (const name of names) await page.keyboard.press(name);
  };
  await slider(page, "k").focus();
  await keys("ArrowRight");
  await settled(page);
  const first = Number(await entry(page, "k").inputValue());
  await keys("ArrowRight", "ArrowRight");
  await settled(page);
  assert.equal(Number(await entry(page, "k").inputValue()), first + 2, "a whole number moves by one");
  await keys("Control+z");
  await settled(page);
  assert.equal(Number(await entry(page, "k").inputValue()), first + 1);

  await canvas(page).focus();
  const before = await blocks(page, await picture(page));
  await canvas(page).focus();
  await keys("ArrowLeft", "ArrowLeft", "ArrowUp", "+", "Shift+ArrowRight");
  assert.ok(difference(before, await blocks(page, await picture(page))) > 1, "arrow keys turn the picture");
  await canvas(page).focus();
  await keys("f");
  const fitted = difference(before, await blocks(page, await picture(page)));
  assert.ok(fitted < 1, `the same as before the keys: ${fitted}`);

  await canvas(page).focus();
  await keys("m", "Enter", "ArrowLeft", "ArrowLeft", "ArrowLeft");
  await page.locator(".hint", { hasText: "second" }).waitFor();
  await page.waitForFunction(() => document.body.dataset.still === "true");
  await keys("Enter");
  await page.locator(".toast", { hasText: /^Distance in the original: [1-9][\d.]* units$/ }).waitFor();
  const pixelsOfLine = async () => {
    await page.waitForFunction(() => document.body.dataset.still === "true");
    return pixelsOfDistance(page, await picture(page));
  };
  const drawn = await pixelsOfLine();
  assert.ok(drawn > 60, `the distance is drawn: ${drawn} pixels`);
  await canvas(page).focus();
  await keys("Escape");
  await page.waitForTimeout(300);
  assert.ok((await pixelsOfLine()) < 10, "Escape takes the line away");
  await keys("f");

  await keys("2");
  await tabTo(page, "wipe");
  await keys("ArrowRight", "ArrowRight", "ArrowRight");
  assert.equal(await page.locator(".wipe").getAttribute("aria-valuenow"), "56");
  await tabTo(page, "File");
  await keys("Control+a");
  await page.keyboard.type("by_keys.ply");
  await tabTo(page, "Save");
  await keys("Enter");
  await page.waitForFunction(() => document.body.dataset.saved);
  assert.ok(existsSync(path.join(folder, "by_keys.ply")));
  await canvas(page).focus();
  await keys("?");
  await page.getByRole("dialog").waitFor();
  await keys("Escape");
  await page.getByRole("dialog").waitFor({ state: "hidden" });
});

test("texts have the contrast that WCAG AA asks for", models, async (t) => {
  const { page } = await start(t, {}, "#view.mode=wipe");
  for (const section of await page.locator("summary").all())
    if (!(await section.evaluate((element) => element.parentElement.open))) await section.click();
  await page.locator("#box").check();
  await page.locator("#colour").selectOption("displacement");
  await page.locator("#save").click(); // a message appears
  await page.locator(".toast").first().waitFor();
  assert.deepEqual(await page.evaluate(faintTexts), []);
  await page.keyboard.press("?");
  assert.deepEqual(await page.evaluate(faintTexts), []);
});

test("labels are whole, also of parameters that are seldom needed", async (t) => {
  const { page } = await show(t, [sheet(temporaryFolder(t), "scan.xyz", 60)]);
  await page.locator(".expert > summary").click();
  for (const width of [1280, 360]) {
    await page.setViewportSize({ width, height: 800 });
    const cut = await page.locator(".panel label").evaluateAll((labels) => labels
      .filter((label) => label.checkVisibility() && label.scrollWidth > label.clientWidth).map((label) => label.textContent));
    assert.deepEqual(cut, [], `at ${width} pixels`);
  }
});

test("a length is offered in the units that its parameter takes, and one that is refused leaves its unit", async (t) => {
  const { page } = await show(t, [sheet(temporaryFolder(t), "scan.xyz", 60)]);
  await page.locator(".expert > summary").click();
  const units = (name) => page.locator(`[data-param="${name}"] .unit`);
  const offered = async (name) => (await units(name).locator("option:enabled").allTextContents()).sort();
  const all = ["% of size", "file units", "spacings"];
  for (const name of ["noise", "radius", "similarity_sigma"]) assert.deepEqual(await offered(name), all, name);
  for (const name of ["closeness_sigma", "normal_sigma"]) assert.deepEqual(await offered(name), [...all, "radii"].sort(), name);
  await entry(page, "similarity_sigma").fill("0.6r");
  await page.keyboard.press("Enter");
  await page.locator(".toast.error", { hasText: "cannot be '0.6r'" }).waitFor();
  assert.equal(await units("similarity_sigma").inputValue(), "s");
  await page.locator('[data-param="similarity_sigma"] .auto').click();
  await settled(page);
  assert.match(await entry(page, "similarity_sigma").inputValue(), /^[\d.]+s$/);
});

test("a full status line keeps what counts in sight, and says the rest under the pointer", async (t) => {
  const folder = temporaryFolder(t);
  const scattered = Array.from({ length: 200 }, (_, i) => `${(i * 7919) % 997} ${(i * 104729) % 991} ${100 + ((i * 1299709) % 983)}`);
  const file = sheet(folder, "scan.xyz", 60, 0.3, true);
  appendFileSync(file, `\n${scattered.join("\n")}\nnan nan nan\n`);
  const { page } = await show(t, [file]);
  for (const width of [1280, 1000, 800]) {
    await page.setViewportSize({ width, height: 700 });
    const beyond = await page.locator("#total, #rate, .kept > span:first-child, .status .device").evaluateAll((parts) => parts
      .filter((part) => part.getBoundingClientRect().right > innerWidth || part.clientWidth === 0 && part.getBoundingClientRect().width < 40)
      .map((part) => part.textContent));
    assert.deepEqual(beyond, [], `at ${width} pixels`);
    assert.ok((await page.locator(".status").boundingBox()).height < 50, "it is one line");
  }
  const whole = await page.locator(".status .kept").textContent();
  assert.match(whole, /kept in place: .*, /);
  assert.equal(await page.locator(".status .kept").getAttribute("title"), whole);
  assert.match(await page.locator(".status .device").getAttribute("title"), /^(cpu|cuda) · .+: ./);
});

test("on a small screen messages leave the line of the notes free, and the status counts what was pulled in", async (t) => {
  const folder = temporaryFolder(t);
  const file = sheet(folder, "scan.xyz", 60, 0.02, true);
  appendFileSync(file, `\n${Array.from({ length: 900 }, (_, i) => `${(i * 7919) % 61} ${(i * 104729) % 59} ${5 + ((i * 1299709) % 37)}`).join("\n")}\n`);
  const { page } = await show(t, [file, "--save-folder", folder], "#outliers=move", { viewport: { width: 360, height: 640 } });
  await settled(page);
  assert.match(await page.locator(".status .kept").textContent(), /^\d+ outliers pulled in/);
  const notes = await page.locator(".notes summary").boundingBox();
  for (let i = 0; i < 3; ++i) await page.evaluate(() => document.querySelector("#save").click());
  await page.waitForFunction(() => document.querySelectorAll(".toast").length > 1);
  const visible = await page.locator(".toast:visible").all();
  assert.equal(visible.length, 1, "the last message alone");
  assert.ok((await visible[0].boundingBox()).y >= notes.y + notes.height, "below the line of the notes");
});

for (const [width, height] of [[390, 844], [320, 568]]) {
  test(`on a phone of ${width} x ${height} nothing is cut off, and fingers turn and wipe`, models, async (t) => {
    const { page } = await start(t, { viewport: { width, height }, hasTouch: true, isMobile: true }, "#view.mode=wipe&view.colour=displacement");
    await page.locator("summary", { hasText: "Snapshots" }).click();
    await page.getByLabel("Name of the snapshot").fill("a name that somebody typed at length and then some");
    await page.getByRole("button", { name: "Keep", exact: true }).click();
    await page.locator("#box").check();
    await settled(page);
    assert.ok(await page.evaluate(() => document.documentElement.scrollWidth <= innerWidth), "nothing is wider than the screen");
    const beyond = await page.evaluate(() => [...document.querySelectorAll("header *, .panel *, .stage > :not(canvas)")].filter((element) => {
      if (!element.checkVisibility() || element.closest("details:not([open])")) return false;
      const box = element.getBoundingClientRect();
      return box.width > 0 && (box.left < -0.5 || box.right > innerWidth + 0.5);
    }).map((element) => element.className || element.tagName));
    assert.deepEqual(beyond, [], "what sticks out at the sides");
    const stage = await canvas(page).boundingBox();
    assert.ok(stage.height > 0.3 * height, `the picture is ${stage.height} high`);
    const before = await page.evaluate(() => location.hash);
    const client = await page.context().newCDPSession(page);
    const touch = (type, x, y) => client.send("Input.dispatchTouchEvent", { type, touchPoints: type === "touchEnd" ? [] : [{ x, y }] });
    await touch("touchStart", stage.x + 0.25 * stage.width, stage.y + 0.5 * stage.height);
    for (let i = 0; i <= 10; ++i) await touch("touchMove", stage.x + (0.25 - 0.01 * i) * stage.width, stage.y + 0.5 * stage.height);
    await touch("touchEnd");
    await page.waitForFunction((old) => location.hash !== old && location.hash.includes("view.camera"), before);
    const updates = Number(await dataset(page, "updates"));
    await page.locator('[data-param="radius"] input[type=range]').scrollIntoViewIfNeeded();
    const knob = await page.locator('[data-param="radius"] input[type=range]').boundingBox();
    await page.touchscreen.tap(knob.x + 0.3 * knob.width, knob.y + knob.height / 2);
    await page.waitForFunction((n) => Number(document.body.dataset.updates) > n, updates);
  });
}
