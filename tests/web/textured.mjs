// SPDX-License-Identifier: Apache-2.0
// A small sheet with a picture, whose left and right halves lie apart in the picture: a seam runs down the middle.
import assert from "node:assert/strict";
import { writeFileSync } from "node:fs";
import path from "node:path";
import { deflateSync } from "node:zlib";
import { picture } from "./looks.mjs";

const kAcross = 16; // points of each half's side, the middle ones are both halves'
/** Of the quarters of the picture: upper left, upper right, lower left, lower right. */
export const kColours = { red: [200, 30, 30], green: [20, 160, 40], blue: [30, 40, 210], yellow: [230, 210, 20] };

// As PNG has it: Node 18 has none of its own.
function crc32(bytes) {
  let crc = ~0;
  for (const byte of bytes) {
    crc ^= byte;
    for (let bit = 0; bit < 8; ++bit) crc = (crc >>> 1) ^ (crc & 1 ? 0xedb88320 : 0);
  }
  return ~crc >>> 0;
}

/** A PNG of 256 x 256 pixels. */
export function png(side = 256) {
  const colours = Object.values(kColours);
  const rows = Buffer.alloc(side * (1 + 3 * side));
  for (let y = 0; y < side; ++y)
    for (let x = 0; x < side; ++x) rows.set(colours[2 * Number(y >= side / 2) + Number(x >= side / 2)], y * (1 + 3 * side) + 1 + 3 * x);
  const chunk = (name, data) => {
    const body = Buffer.concat([Buffer.from(name), data]);
    const ends = Buffer.alloc(8);
    ends.writeUInt32BE(data.length, 0);
    ends.writeUInt32BE(crc32(body), 4);
    return Buffer.concat([ends.subarray(0, 4), body, ends.subarray(4)]);
  };
  const head = Buffer.alloc(13);
  head.writeUInt32BE(side, 0);
  head.writeUInt32BE(side, 4);
  head.set([8, 2], 8); // bits, RGB
  return Buffer.concat([Buffer.from("\x89PNG\r\n\x1a\n", "latin1"), chunk("IHDR", head), chunk("IDAT", deflateSync(rows)), chunk("IEND", Buffer.alloc(0))]);
}

/** The sheet: points, and faces whose corners are a point with where it lies in the picture. The right half stands on its head. */
function sheet() {
  const wide = 2 * kAcross - 1;
  const points = Array.from({ length: wide * kAcross }, (_, i) => {
    const [x, y] = [i % wide, Math.floor(i / wide)];
    return [x / (kAcross - 1) - 1, y / (kAcross - 1) - 0.5, 0.03 * (((i * 7919) % 101) / 101 - 0.5)];
  });
  const faces = [];
  for (let y = 0; y + 1 < kAcross; ++y)
    for (let x = 0; x + 1 < wide; ++x) {
      const right = x >= kAcross - 1;
      const corner = (cx, cy) => {
        const across = (right ? cx - (kAcross - 1) : cx) / (kAcross - 1), up = cy / (kAcross - 1);
        return { point: cy * wide + cx, at: right ? [0.55 + 0.4 * across, 1 - up] : [0.05 + 0.4 * across, up] };
      };
      faces.push([corner(x, y), corner(x + 1, y), corner(x + 1, y + 1), corner(x, y + 1)]);
    }
  return { points, faces };
}

/** sheet.obj with sheet.mtl (null: without one) and picture.png in the folder; the path of the first. */
export function texturedSheet(folder, library = "newmtl painted\nmap_Kd picture.png\n") {
  const { points, faces } = sheet();
  const known = new Map();
  const lines = ["mtllib sheet.mtl", ...points.map((p) => `v ${p.join(" ")}`)];
  const index = (at) => {
    if (!known.has(String(at))) lines.push(`vt ${known.set(String(at), known.size + 1) && at.join(" ")}`);
    return known.get(String(at));
  };
  const rows = faces.map((face) => `f ${face.map(({ point, at }) => `${point + 1}/${index(at)}`).join(" ")}`);
  const file = path.join(folder, "sheet.obj");
  writeFileSync(file, [...lines, "usemtl painted", ...rows, ""].join("\n"));
  if (library !== null) writeFileSync(path.join(folder, "sheet.mtl"), library);
  writeFileSync(path.join(folder, "picture.png"), png());
  return file;
}

/** The same as PLY, with texture coordinates of corners. */
export function texturedPly(folder) {
  const { points, faces } = sheet();
  const file = path.join(folder, "sheet.ply");
  writeFileSync(path.join(folder, "picture.png"), png());
  writeFileSync(file, ["ply", "format ascii 1.0", "comment TextureFile picture.png", `element vertex ${points.length}`, "property float x",
    "property float y", "property float z", `element face ${faces.length}`, "property list uchar int vertex_indices",
    "property list uchar float texcoord", "end_header", ...points.map((p) => p.join(" ")),
    ...faces.map((face) => `4 ${face.map(({ point }) => point).join(" ")} 8 ${face.flatMap(({ at }) => at).join(" ")}`), ""].join("\n"));
  return file;
}

/** The same as GLB, which holds its picture; points of the seam are there twice, and v counts downwards. */
export function texturedGlb(folder) {
  const { points, faces } = sheet();
  const known = new Map();
  const [positions, coordinates, indices] = [[], [], []];
  const vertex = ({ point, at }) => {
    const key = `${point} ${at}`;
    if (!known.has(key)) {
      known.set(key, known.size);
      positions.push(...points[point]);
      coordinates.push(at[0], 1 - at[1]);
    }
    return known.get(key);
  };
  for (const face of faces) {
    const [a, b, c, d] = face.map(vertex);
    indices.push(a, b, c, a, c, d);
  }
  const views = [new Float32Array(positions), new Float32Array(coordinates), new Uint32Array(indices), new Uint8Array(png())]
    .map((array) => Buffer.from(array.buffer, array.byteOffset, array.byteLength));
  let byteOffset = 0;
  const bufferViews = views.map(({ length: byteLength }) => {
    const one = { buffer: 0, byteOffset, byteLength };
    byteOffset += byteLength;
    return one;
  });
  const count = positions.length / 3;
  const json = JSON.stringify({
    asset: { version: "2.0" }, scene: 0, scenes: [{ nodes: [0] }], nodes: [{ mesh: 0 }], buffers: [{ byteLength: byteOffset }], bufferViews,
    accessors: [{ bufferView: 0, componentType: 5126, count, type: "VEC3" }, { bufferView: 1, componentType: 5126, count, type: "VEC2" },
      { bufferView: 2, componentType: 5125, count: indices.length, type: "SCALAR" }],
    images: [{ bufferView: 3, mimeType: "image/png" }], textures: [{ source: 0 }],
    materials: [{ pbrMetallicRoughness: { baseColorTexture: { index: 0 } } }],
    meshes: [{ primitives: [{ attributes: { POSITION: 0, TEXCOORD_0: 1 }, indices: 2, material: 0 }] }],
  });
  const padded = (data, fill) => Buffer.concat([data, Buffer.alloc((4 - (data.length % 4)) % 4, fill)]);
  const chunks = [[padded(Buffer.from(json), 0x20), "JSON"], [padded(Buffer.concat(views), 0), "BIN\0"]].map(([data, name]) => {
    const size = Buffer.alloc(4);
    size.writeUInt32LE(data.length);
    return Buffer.concat([size, Buffer.from(name, "latin1"), data]);
  });
  const head = Buffer.alloc(12);
  head.write("glTF");
  head.writeUInt32LE(2, 4);
  head.writeUInt32LE(12 + chunks[0].length + chunks[1].length, 8);
  const file = path.join(folder, "sheet.glb");
  writeFileSync(file, Buffer.concat([head, ...chunks]));
  return file;
}

/**
 * Which share of each quarter of the sheet on the screen has the colour that belongs there: red above blue at the left, yellow above
 * green at the right. Left out are the rows in the middle, where the picture itself goes over from one to the other.
 */
export async function quadrants(page) {
  const show = (visibility) => page.evaluate((value) => // what lies over the picture
    document.querySelectorAll(".stage > :not(canvas)").forEach((element) => (element.style.visibility = value)), visibility);
  await show("hidden");
  const screenshot = await picture(page);
  await show("");
  return page.evaluate(async ([base64, colours]) => {
    const { width, height, data } = await globalThis.pixelsOf(base64);
    const at = (x, y) => data.subarray(4 * (y * width + x), 4 * (y * width + x) + 3);
    const isBack = ([r, g, b]) => r < 40 && g < 40 && b < 50; // the page's dark background
    const margin = 6;
    let [left, right, top, bottom] = [width, -1, height, -1];
    for (let y = margin; y < height - margin; ++y) // the edge of the screenshot is the page's
      for (let x = margin; x < width - margin; ++x) {
        if (isBack(at(x, y))) continue;
        [left, right] = [Math.min(left, x), Math.max(right, x)];
        [top, bottom] = [Math.min(top, y), Math.max(bottom, y)];
      }
    const [counts, hits] = [{}, {}];
    for (let y = top + margin; y <= bottom - margin; ++y) // and that of the sheet is ragged
      for (let x = left + margin; x <= right - margin; ++x) {
        const [across, up] = [(x - left) / (right - left) - 0.5, 0.5 - (y - top) / (bottom - top)];
        if (Math.abs(up) < 0.02 || Math.abs(across) < 0.003) continue;
        const name = across < 0 ? (up > 0 ? "red" : "blue") : up > 0 ? "yellow" : "green";
        counts[name] = (counts[name] ?? 0) + 1;
        const its = at(x, y);
        hits[name] = (hits[name] ?? 0) + Number(colours[name].every((v, c) => Math.abs(v - its[c]) <= 6));
      }
    return Object.fromEntries(Object.entries(counts).map(([name, count]) => [name, hits[name] / count]));
  }, [screenshot.toString("base64"), kColours]);
}

/** All of a sheet's quarters have the colours that its picture has there, up to the seam. */
export async function assertColours(page, what) {
  const shares = await quadrants(page);
  for (const [quarter, share] of Object.entries(shares)) assert.ok(share > 0.995, `${what}: ${quarter} ${JSON.stringify(shares)}`);
}

/** In the page: files as a drop has them, [name, content in base64] each. */
export function parts(files) {
  const transfer = new DataTransfer();
  for (const [name, bytes] of files) transfer.items.add(new File([Uint8Array.from(atob(bytes), (c) => c.charCodeAt(0))], name));
  return transfer;
}
