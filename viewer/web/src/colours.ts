// SPDX-License-Identifier: Apache-2.0
// Colour maps, and the histogram that their legend shows.

/** sRGB stops, evenly spaced. Sequential: dark blue to yellow, lightness rising evenly. Diverging: blue, grey, red. */
const kMaps = {
  sequential: ["#2a1b5e", "#37418f", "#2f6c9c", "#2b8f9a", "#3fb28b", "#7fce6b", "#c9df59", "#fbe86a"],
  diverging: ["#3a6fd8", "#6f9be6", "#a9c2ea", "#d9dce0", "#eeb79c", "#e07f63", "#c0392f"],
};
export type MapName = keyof typeof kMaps;

/** A map, or the colours of the values 0 to 255. */
export type Colours = MapName | { of: (value: number) => string };

const channels = (hex: string) => [1, 3, 5].map((at) => parseInt(hex.slice(at, at + 2), 16));

/** 256 texels of 4 bytes. */
export function mapTexels(name: Colours): Uint8Array {
  const texels = new Uint8Array(256 * 4).fill(255);
  if (typeof name !== "string") {
    for (let i = 0; i < 256; ++i) texels.set(channels(name.of(i)), 4 * i);
    return texels;
  }
  const stops = kMaps[name].map(channels);
  for (let i = 0; i < 256; ++i) {
    const at = (i / 255) * (stops.length - 1);
    const low = Math.min(Math.floor(at), stops.length - 2);
    for (let c = 0; c < 3; ++c)
      texels[4 * i + c] = Math.round(stops[low][c] + (at - low) * (stops[low + 1][c] - stops[low][c]));
  }
  return texels;
}

export const mapStops = (name: MapName): string[] => kMaps[name];

export const mapGradient = (name: MapName) => `linear-gradient(to right, ${kMaps[name].join(", ")})`;

export interface Spread {
  range: [number, number];
  counts: number[]; // of bins over the range; values beyond it are in the outer bins
}

const kBins = 48;
const kSamples = 20000;

/** Bins of a sample of the values. */
export function binned(value: (place: number) => number, count: number, range: [number, number]): Spread {
  const counts = new Array<number>(kBins).fill(0);
  const stride = Math.max(1, Math.floor(count / kSamples));
  const width = range[1] - range[0] || 1;
  for (let place = 0; place < count; place += stride) {
    const share = (value(place) - range[0]) / width;
    if (!Number.isNaN(share)) ++counts[Math.min(kBins - 1, Math.max(0, Math.floor(share * kBins)))];
  }
  return { range, counts };
}

export type Kind = "amount" | "level" | "any";

/**
 * The range from the 1 % to the 99 % quantile of a sample of the values; of an amount from 0 to the 98 % quantile; of a level from
 * the 2 % to the 98 % quantile.
 */
export function quantileRange(value: (place: number) => number, count: number, kind: Kind = "any"): [number, number] {
  const sample: number[] = [];
  const stride = Math.max(1, Math.floor(count / kSamples));
  for (let place = 0; place < count; place += stride) {
    const v = value(place);
    if (Number.isFinite(v)) sample.push(v);
  }
  if (!sample.length) return [0, 1];
  sample.sort((a, b) => a - b);
  const at = (share: number) => sample[Math.round(share * (sample.length - 1))];
  if (kind === "amount") return [0, at(0.98) || sample[sample.length - 1] || 1];
  if (kind === "level" && at(0.98) > at(0.02)) return [at(0.02), at(0.98)];
  return at(0.99) > at(0.01) ? [at(0.01), at(0.99)] : [sample[0], sample[sample.length - 1]];
}

/**
 * The root mean square of the displacements in each point's cell of a grid. `squared` is the squared length of a place's
 * displacement. O(N).
 */
export function localRms(positions: Float32Array, squared: (place: number) => number, cell: number): Float32Array {
  const count = positions.length / 3;
  const sums = new Map<number, [number, number]>();
  const keys = new Float64Array(count);
  for (let place = 0; place < count; ++place) {
    const [x, y, z] = [0, 1, 2].map((c) => Math.floor(positions[3 * place + c] / cell) & 0x1ffff);
    const key = (x * 0x20000 + y) * 0x20000 + z;
    keys[place] = key;
    const value = squared(place);
    if (!Number.isFinite(value)) continue;
    const sum = sums.get(key);
    if (sum) {
      sum[0] += value;
      ++sum[1];
    } else sums.set(key, [value, 1]);
  }
  return Float32Array.from(keys, (key) => {
    const sum = sums.get(key);
    return sum ? Math.sqrt(sum[0] / sum[1]) : NaN;
  });
}
