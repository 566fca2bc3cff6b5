// SPDX-License-Identifier: Apache-2.0
// The box and the lasso as the flags write them. The same rules as src/options/apply_limits.cpp, for showing what they hold.

export interface Box {
  min: number[];
  max: number[];
}

export interface Lasso {
  camera: number[]; // 3 x 4, rows; from file coordinates to (x, y, w)
  polygon: [number, number][];
}

const kMaxCorners = 64;

export const boxText = (box: Box) => [...box.min, ...box.max].join(",");

export function parseBox(text: string): Box | null {
  const n = text.split(",").map(Number);
  return text && n.length === 6 && n.every(Number.isFinite) ? { min: n.slice(0, 3), max: n.slice(3) } : null;
}

export const lassoText = (lasso: Lasso) => `${lasso.camera.join(",")}:${lasso.polygon.flat().join(",")}`;

export function parseLasso(text: string): Lasso | null {
  const [camera, corners] = text.split(":").map((part) => part.split(",").map(Number));
  if (camera?.length !== 12 || !corners || corners.length < 6) return null;
  const polygon: [number, number][] = [];
  for (let i = 0; i + 1 < corners.length; i += 2) polygon.push([corners[i], corners[i + 1]]);
  return { camera, polygon };
}

/** The x, y and w rows of a column-major 4 x 4 matrix that maps offsets from `origin`, for file coordinates. */
export function fileCamera(elements: ArrayLike<number>, origin: number[]): number[] {
  return [0, 1, 3].flatMap((row) => {
    const m = [0, 1, 2, 3].map((column) => elements[4 * column + row]);
    return [m[0], m[1], m[2], m[3] - m[0] * origin[0] - m[1] * origin[1] - m[2] * origin[2]];
  });
}

/** A drawn outline with at most 64 corners (Douglas and Peucker 1973), rounded to what a screen can show. */
export function simplified(outline: [number, number][]): [number, number][] {
  let corners = outline;
  for (let tolerance = 0.002; corners.length > kMaxCorners || tolerance === 0.002; tolerance *= 1.5)
    corners = thinned(outline, tolerance);
  return corners.map(([x, y]) => [Number(x.toFixed(4)), Number(y.toFixed(4))]);
}

function thinned(line: [number, number][], tolerance: number): [number, number][] {
  if (line.length < 3) return line;
  const [a, b] = [line[0], line[line.length - 1]];
  const length = Math.hypot(b[0] - a[0], b[1] - a[1]);
  let worst = 0;
  let at = 0;
  for (let i = 1; i + 1 < line.length; ++i) {
    const [x, y] = [line[i][0] - a[0], line[i][1] - a[1]];
    const off = length > 1e-9 ? Math.abs(x * (b[1] - a[1]) - y * (b[0] - a[0])) / length : Math.hypot(x, y);
    if (off > worst) [worst, at] = [off, i];
  }
  if (worst <= tolerance) return [a, b];
  return [...thinned(line.slice(0, at + 1), tolerance).slice(0, -1), ...thinned(line.slice(at), tolerance)];
}

/** 1 for each place whose position may move, else 0. */
export function insideMask(
  positions: Float32Array,
  origin: number[],
  box: Box | null,
  lasso: Lasso | null,
): Uint8Array {
  const mask = new Uint8Array(positions.length / 3).fill(1);
  const p = [0, 0, 0];
  for (let place = 0; place < mask.length; ++place) {
    for (let c = 0; c < 3; ++c) p[c] = positions[3 * place + c] + origin[c];
    if (box && !p.every((v, c) => v >= box.min[c] && v <= box.max[c])) mask[place] = 0;
    else if (lasso && !inLasso(lasso, p)) mask[place] = 0;
  }
  return mask;
}

function inLasso({ camera: m, polygon }: Lasso, [x, y, z]: number[]): boolean {
  const row = (r: number) => m[4 * r] * x + m[4 * r + 1] * y + m[4 * r + 2] * z + m[4 * r + 3];
  const w = row(2);
  if (!(w > 0)) return false;
  const [px, py] = [row(0) / w, row(1) / w];
  let inside = false;
  for (let i = 0, j = polygon.length - 1; i < polygon.length; j = i++) {
    const [a, b] = [polygon[i], polygon[j]];
    if (a[1] > py !== b[1] > py && px < ((b[0] - a[0]) * (py - a[1])) / (b[1] - a[1]) + a[0]) inside = !inside;
  }
  return inside;
}
