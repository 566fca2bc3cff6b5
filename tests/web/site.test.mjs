// SPDX-License-Identifier: Apache-2.0
// The site of `make docs` on a telephone: no page scrolls sideways, neither of the documents nor of the reference of C++.
import assert from "node:assert/strict";
import { existsSync, readdirSync } from "node:fs";
import path from "node:path";
import { pathToFileURL } from "node:url";
import { openBrowser, test } from "./program.mjs";

const kSite = path.join(process.env.POINTFAIR_SOURCE ?? ".", "build/docs/site");
const built = existsSync(path.join(kSite, "cpp/index.html")) ? {} : { skip: `${kSite} is not there: make docs builds it` };

test("no page of the site scrolls sideways on a telephone", built, async (t) => {
  const context = await (await openBrowser()).newContext({ viewport: { width: 360, height: 740 } });
  t.after(() => context.close());
  const page = await context.newPage();
  const names = readdirSync(kSite, { recursive: true }).filter((name) => name.endsWith(".html") && !name.startsWith("app"));
  const wide = [];
  for (const name of names) {
    await page.goto(pathToFileURL(path.join(kSite, name)).href);
    const width = await page.evaluate(() => document.documentElement.scrollWidth);
    if (width > 360) wide.push(`${name}: ${width}`);
  }
  t.diagnostic(`${names.length} pages`);
  assert.deepEqual(wide, []);
});
