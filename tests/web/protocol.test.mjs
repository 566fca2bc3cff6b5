// SPDX-License-Identifier: Apache-2.0
// What C++ writes is what the page reads; and the page's own parts that need no browser.
import assert from "node:assert/strict";
import { spawnSync } from "node:child_process";
import { readdirSync, readFileSync } from "node:fs";
import path from "node:path";
import test from "node:test";
import { pathToFileURL } from "node:url";
import { modules, temporaryFolder } from "./program.mjs";

const kSources = process.env.POINTFAIR_WEB_SOURCES;

/** A module of the page, as JavaScript. */
async function pageModule(t, name) {
  const outfile = path.join(temporaryFolder(t), `${name}.mjs`);
  await modules("esbuild").build({ entryPoints: [path.join(kSources, `${name}.ts`)], outfile, bundle: true, format: "esm" });
  return import(pathToFileURL(outfile).href);
}

test("messages written by C++ are read in JavaScript", async (t) => {
  const { decode, decodeNormal } = await pageModule(t, "protocol");
  const folder = temporaryFolder(t);
  assert.equal(spawnSync(process.env.POINTFAIR_WRITE_MESSAGES, [folder]).status, 0);
  const names = readdirSync(folder).filter((name) => name.endsWith(".bin"));
  assert.ok(names.length >= 10);
  for (const name of names) {
    const bytes = readFileSync(path.join(folder, name));
    const frame = bytes.buffer.slice(bytes.byteOffset, bytes.byteOffset + bytes.byteLength);
    const expected = JSON.parse(readFileSync(path.join(folder, name.replace(".bin", ".json")), "utf8"));
    const { head, arrays } = decode(frame);
    delete head.arrays;
    assert.deepEqual(head, expected.head);
    if (name === "normals.bin") {
      expected.arrays.decoded.forEach((wanted, i) => {
        const found = decodeNormal(arrays.normals[2 * i], arrays.normals[2 * i + 1]) ?? [0, 0, 0];
        assert.ok(Math.hypot(...found.map((v, c) => v - wanted[c])) < 1e-6, `normal ${i}`);
      });
    } else {
      for (const [key, list] of Object.entries(expected.arrays)) assert.deepEqual([...arrays[key]], list, `${name} ${key}`);
    }
    for (let length = 0; length < frame.byteLength; ++length)
      assert.throws(() => decode(frame.slice(0, length)), `${name} cut to ${length}`);
  }
});

test("state survives the URL, and nonsense in it does not", async (t) => {
  const { readFragment, writeFragment, defaultView } = await pageModule(t, "state");
  const defaults = { params: { k: "auto", iterations: "auto" }, limits: { strength: "", box: "" } };
  const recipe = { params: { k: "24", iterations: "auto" }, limits: { strength: "0.5", box: "0,0,0,1,1,1" } };
  const view = { ...defaultView(), mode: "wipe", wipe: 0.25, colour: "attribute:a&b=c", camera: [1, 2, 3, 0, 0, -1.5] };
  const fragment = writeFragment("a b.ply", recipe, defaults, view);
  assert.deepEqual(readFragment(fragment, "a b.ply", defaults), { recipe, view, hasLook: true });
  const other = readFragment(fragment, "other.ply", defaults);
  assert.deepEqual(other.recipe, { params: recipe.params, limits: defaults.limits });
  assert.deepEqual(other.view.camera, []);
  for (const bad of ["", "#", "#%", "#view.mode=up&view.wipe=7&view.size=x&kk=3&limit.lid=1&view.camera=1,2", "#__proto__=1"])
    assert.deepEqual(readFragment(bad, "a b.ply", defaults), { recipe: defaults, view: defaultView(), hasLook: bad.includes("view.mode") }, bad);
});

test("a cloud stands on its ground, or as its format says", async (t) => {
  const { upAxis } = await pageModule(t, "upright");
  const box = (x, y, z) => Float32Array.from({ length: 3000 }, (_, i) => [x, y, z][i % 3] * ((Math.floor(i / 3) * 0.618) % 1));
  const none = [0, 0, 0];
  assert.equal(upAxis("a.las", none, box(9, 1, 9)), "z");
  assert.equal(upAxis("a.obj", none, box(9, 9, 1)), "y");
  assert.equal(upAxis("ground.ply", none, box(9, 1, 9)), "y");
  assert.equal(upAxis("ground.ply", none, box(9, 9, 1)), "z");
  assert.equal(upAxis("statue.ply", none, box(3, 9, 3)), "y");
  assert.equal(upAxis("statue.ply", none, box(3, 3, 9)), "z");
  assert.equal(upAxis("map.ply", [500000, 5400000, 0], box(9, 1, 9)), "z");
  assert.equal(upAxis("nothing.ply", none, new Float32Array()), "z");
});

test("a few large values do not bleach a map", async (t) => {
  const { quantileRange } = await pageModule(t, "colours");
  const value = (i) => (i % 100 === 99 ? 1000 : (i * 7919) % 1000 / 1000); // one of a hundred is far off
  for (const [kind, low, high] of [["amount", 0, 0.99], ["level", 0.02, 0.99], ["any", 0.01, 1]]) {
    const range = quantileRange(value, 100000, kind);
    assert.ok(Math.abs(range[0] - low) < 0.02 && Math.abs(range[1] - high) < 0.03, `${kind}: ${range}`);
  }
  assert.deepEqual(quantileRange(() => 7, 100, "level"), [7, 7]);
  assert.deepEqual(quantileRange((i) => (i === 99 ? 5 : 0), 100, "amount"), [0, 5]); // all but one stayed
  assert.deepEqual(quantileRange(() => NaN, 100, "amount"), [0, 1]);
});

test("history goes back and forth and forgets what was left", async (t) => {
  const { History } = await pageModule(t, "state");
  const recipe = (k) => ({ params: { k }, limits: {} });
  const history = new History(recipe("1"));
  assert.equal(history.undo(), null);
  history.keep(recipe("2"));
  history.keep(recipe("2"));
  history.keep(recipe("3"));
  assert.deepEqual(history.undo(), recipe("2"));
  assert.deepEqual(history.undo(), recipe("1"));
  assert.equal(history.canUndo, false);
  assert.deepEqual(history.redo(), recipe("2"));
  history.keep(recipe("4"));
  assert.equal(history.redo(), null);
  assert.deepEqual(history.undo(), recipe("2"));
});

test("a drawn outline keeps its shape with at most 64 corners", async (t) => {
  const { simplified, lassoText, parseLasso } = await pageModule(t, "region");
  const circle = Array.from({ length: 3000 }, (_, i) => [Math.cos(i / 480), Math.sin(i / 480)]);
  const polygon = simplified(circle);
  assert.ok(polygon.length >= 16 && polygon.length <= 64);
  for (const [x, y] of polygon) assert.ok(Math.abs(Math.hypot(x, y) - 1) < 0.02);
  const lasso = { camera: Array.from({ length: 12 }, (_, i) => i / 7), polygon };
  assert.deepEqual(parseLasso(lassoText(lasso)), lasso);
  assert.equal(parseLasso(""), null);
});

test("the local displacement of a point is the root mean square over its cell", async (t) => {
  const { localRms, binned, quantileRange } = await pageModule(t, "colours");
  const positions = Float32Array.from([0.1, 0.1, 0.1, 0.2, 0.2, 0.2, -5, 0, 0, NaN, 0, 0]);
  const rms = localRms(positions, (place) => [1, 9, 4, NaN][place], 1);
  assert.deepEqual([...rms.slice(0, 3)].map((v) => v.toFixed(5)), [Math.sqrt(5), Math.sqrt(5), 2].map((v) => v.toFixed(5)));
  const { counts } = binned((i) => i, 96, [0, 96]);
  assert.deepEqual(new Set(counts), new Set([2]));
  assert.deepEqual(quantileRange((i) => i, 101), [1, 99]);
});

test("detail is lowered until frames are quick, and rises again", async (t) => {
  const { Detail } = await pageModule(t, "detail");
  const count = 3_000_000;
  /** The milliseconds of the last of many frames on a machine that draws so many points a millisecond. */
  const after = (detail, rate) => {
    let time = 0;
    for (let frame = 0; frame < 200; ++frame) {
      const drawn = detail.moving(count);
      time = 5 * detail.fineness ** 2 + drawn / rate;
      detail.learnMoving(drawn, count, time);
    }
    return time;
  };
  const detail = new Detail();
  assert.ok(after(detail, 2000) <= 70, "a slow machine");
  assert.ok(detail.moving(count) > 60000 && detail.moving(count) < count && detail.fineness < 1);
  assert.ok(after(detail, 500000) <= 70, "a fast one");
  assert.deepEqual([detail.moving(count), detail.fineness], [count, 1]);
  after(detail, 1);
  assert.ok(detail.moving(count) >= 60000, "never so little that nothing is seen");
});

test("a cloud is completed in portions, each once, that become as large as a frame allows", async (t) => {
  const { Detail } = await pageModule(t, "detail");
  for (const [rate, most] of [[1000, 100000], [1000000, 3_000_000]]) {
    const detail = new Detail();
    let last = 0;
    for (let round = 0; round < 10; ++round) {
      for (let left = 3_000_000; left > 0; left -= last) {
        last = detail.completing(left);
        assert.ok(last > 0 && last <= left);
        detail.learnCompleting(last, last / rate);
      }
    }
    assert.ok(detail.completing(3_000_000) <= most && detail.completing(3_000_000) >= most / 3, `${detail.completing(3_000_000)}`);
  }
});

test("displacements are those that the server meant, whichever way they came", async (t) => {
  const { Motion } = await pageModule(t, "motion");
  const none = { places: new Uint32Array(), exceptions: new Float32Array() };
  const motion = new Motion(2);
  assert.deepEqual(motion.of(1), [0, 0, 0]);
  motion.take({ step: 0.5, along_normals: true }, { ...none, motion_normals: Int16Array.of(0, 0, -32768, -32768), displacements: Int16Array.of(-4, 7) });
  assert.deepEqual(motion.of(0), [-0, -0, -2]);
  assert.deepEqual(motion.of(1), [0, 0, 0]);
  motion.take({ step: 0.5, along_normals: true }, { displacements: Int16Array.of(3, 0), places: Uint32Array.of(1), exceptions: Float32Array.of(9, 8, 7) });
  assert.deepEqual([motion.of(0), motion.of(1)], [[0, 0, 1.5], [9, 8, 7]]);
  motion.take({ step: 0.25, along_normals: false }, { ...none, displacements: Int16Array.of(1, 2, 3, -4, -5, -6) });
  assert.deepEqual([motion.of(0), motion.of(1)], [[0.25, 0.5, 0.75], [-1, -1.25, -1.5]]);
});

test("faces are fans of triangles, edges are there once, and seams have one normal", async (t) => {
  const { triangles, edges, welded, vertexNormals } = await pageModule(t, "faces");
  const positions = Float32Array.from([0, 0, 0, 1, 0, 0, 1, 1, 0, 0, 1, 0, 1, 0, 0, NaN, 0, 0, 2, 0, 0]);
  const faces = { ends: Uint32Array.of(4, 7, 10), corners: Uint32Array.of(0, 1, 2, 3, 4, 6, 2, 0, 5, 1) };
  const { indices } = triangles(faces, positions);
  const grouped = triangles(faces, positions, 3, (face) => [2, 0, 1][face]);
  assert.deepEqual([[...grouped.indices], [...grouped.ends]], [[4, 6, 2, 0, 1, 2, 0, 2, 3], [3, 3, 9]], "one group after the other");
  assert.deepEqual([...indices], [0, 1, 2, 0, 2, 3, 4, 6, 2]); // none with a corner that has no place
  assert.equal(edges({ ends: faces.ends.subarray(0, 1), corners: faces.corners }, positions).length, 8, "a quad has no diagonal");
  const vertex = welded(positions);
  assert.equal(vertex[4], 1);
  const normals = vertexNormals(indices, vertex, positions);
  assert.deepEqual([...normals.subarray(4, 8)], [0, 0, 32767, 0]);
  assert.deepEqual(normals.subarray(4, 8), normals.subarray(16, 20));
});

test("a vertex is a point with one place in a picture, and there is each once", async (t) => {
  const { pictureVertices } = await pageModule(t, "faces");
  const count = 20;
  let state = 1;
  const random = (n) => (state = (state * 48271) % 2147483647) % n;
  const corners = Uint32Array.from({ length: 500 }, () => random(count - 1)); // the last point has no face
  const coordinates = Float32Array.from({ length: 1000 }, () => random(3) / 4);
  const { corners: vertices, twins, coordinates: placed } = pictureVertices(corners, coordinates, count);
  const key = (point, at, i) => `${point} ${at[2 * i]} ${at[2 * i + 1]}`;
  const wanted = new Set([...corners].map((point, corner) => key(point, coordinates, corner)));
  assert.ok(wanted.size > 100);
  vertices.forEach((vertex, corner) => {
    const point = vertex < count ? vertex : twins[vertex - count];
    assert.equal(key(point, placed, vertex), key(corners[corner], coordinates, corner));
  });
  assert.equal(new Set(vertices).size, wanted.size);
  assert.equal(twins.length, wanted.size - new Set(corners).size);
  assert.equal(pictureVertices(corners, new Float32Array(1000), count).twins.length, 0, "without a seam there are none");
});
