// SPDX-License-Identifier: Apache-2.0
// Which axis of a cloud is up, where nobody has said so.

const kSample = 20000;
const kSpread = 0.98; // of the points along each axis
const kThin = 0.6; // of the next extent: what is thinner lies
const kTall = 1.1; // of the larger of the others: what is longer stands

/** Formats of surveys and sensors, whose z is up; and those whose y is, by their standard or as most programs write them. */
const kUpward: Record<string, "y" | "z"> = {
  las: "z", laz: "z", e57: "z", ptx: "z", pts: "z", pcd: "z", bin: "z", gltf: "y", glb: "y", obj: "y",
};

/**
 * By the format; by the coordinates, where they are those of a map; else by the shape: ground lies, so its thinnest extent is
 * up, and a statue stands, so its longest is. `positions` are relative to `origin`, x, y, z each.
 */
export function upAxis(name: string, origin: number[], positions: Float32Array): "y" | "z" {
  const known = kUpward[name.slice(name.lastIndexOf(".") + 1).toLowerCase()];
  if (known) return known;
  if (origin.some((offset) => offset !== 0)) return "z";
  const [x, y, z] = [0, 1, 2].map((axis) => extent(positions, axis));
  if (y < kThin * Math.min(x, z)) return "y";
  if (z < kThin * Math.min(x, y)) return "z";
  return y > kTall * Math.max(x, z) ? "y" : "z";
}

function extent(positions: Float32Array, axis: number): number {
  const stride = Math.max(1, Math.floor(positions.length / 3 / kSample));
  const values: number[] = [];
  for (let i = axis; i < positions.length; i += 3 * stride) if (Number.isFinite(positions[i])) values.push(positions[i]);
  values.sort((a, b) => a - b);
  const at = (share: number) => values[Math.floor(share * (values.length - 1))] ?? 0;
  return at((1 + kSpread) / 2) - at((1 - kSpread) / 2);
}
