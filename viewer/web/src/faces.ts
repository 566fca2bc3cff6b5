// SPDX-License-Identifier: Apache-2.0
// The faces of a cloud as triangles and edges of its places, and the normals that smooth shading takes.

const kOne = 32767; // of a normal's component
const kFloats = 3; // of a position

/** Faces over places: face f has the corners [ends[f - 1], ends[f]), the first from 0. */
export interface Polygons {
  ends: Uint32Array;
  corners: Uint32Array;
}

const isFinite3 = (positions: Float32Array, place: number) =>
  Number.isFinite(positions[3 * place] + positions[3 * place + 1] + positions[3 * place + 2]);

/** Calls `use` with the first and last corner of each face that has a place for all corners, and with its number. */
function eachFace({ ends, corners }: Polygons, positions: Float32Array, use: (first: number, end: number, face: number) => void): void {
  let first = 0;
  ends.forEach((end, face) => {
    let whole = true;
    for (let c = first; c < end; ++c) whole &&= isFinite3(positions, corners[c]);
    if (whole) use(first, end, face);
    first = end;
  });
}

/** Polygons as fans; three corners a triangle. Those of a group follow each other: group g has [ends[g - 1], ends[g]). */
export function triangles(faces: Polygons, positions: Float32Array, groups = 1, groupOf: (face: number) => number = () => 0):
    { indices: Uint32Array; ends: Uint32Array } {
  const { corners } = faces;
  const next = new Uint32Array(groups + 1); // where the next corner of each group goes, once those before are counted
  eachFace(faces, positions, (first, end, face) => (next[groupOf(face) + 1] += 3 * Math.max(0, end - first - 2)));
  for (let g = 0; g < groups; ++g) next[g + 1] += next[g];
  const indices = new Uint32Array(next[groups]);
  eachFace(faces, positions, (first, end, face) => {
    const g = groupOf(face);
    for (let c = first + 1; c + 1 < end; ++c) {
      indices[next[g]++] = corners[first];
      indices[next[g]++] = corners[c];
      indices[next[g]++] = corners[c + 1];
    }
  });
  return { indices, ends: next.subarray(0, groups) };
}

/** Vertices that have one place in a picture each: first the places, then twins of those that lie on a seam. */
export interface PictureVertices {
  corners: Uint32Array; // of the faces
  twins: Uint32Array; // of which place each one is
  coordinates: Float32Array; // two a vertex
}

/** `coordinates`: two for each corner of faces over `count` places. O(corners). */
export function pictureVertices(corners: Uint32Array, coordinates: Float32Array, count: number): PictureVertices {
  const twins: number[] = [];
  const its: number[] = []; // corners that say where each twin lies
  const first = new Int32Array(count).fill(-1); // the corner that says where a place lies
  const next = new Map<number, number>(); // the further twin of a vertex
  const same = (a: number, b: number) => coordinates[2 * a] === coordinates[2 * b] && coordinates[2 * a + 1] === coordinates[2 * b + 1];
  const vertices = corners.map((place, corner) => {
    if (first[place] < 0) first[place] = corner;
    let vertex = place;
    while (!same(vertex < count ? first[vertex] : its[vertex - count], corner)) {
      const further = next.get(vertex);
      if (further === undefined) {
        next.set(vertex, count + twins.length);
        twins.push(place);
        its.push(corner);
        return count + twins.length - 1;
      }
      vertex = further;
    }
    return vertex;
  });
  const placed = new Float32Array(2 * (count + twins.length));
  const put = (vertex: number, corner: number) => placed.set(coordinates.subarray(2 * corner, 2 * corner + 2), 2 * vertex);
  first.forEach((corner, place) => corner >= 0 && put(place, corner));
  its.forEach((corner, twin) => put(count + twin, corner));
  return { corners: vertices, twins: Uint32Array.from(twins), coordinates: placed };
}

/** Each edge once; two places an edge. */
export function edges(faces: Polygons, positions: Float32Array): Uint32Array {
  const { corners } = faces;
  const count = positions.length / kFloats;
  const keys = new Float64Array(corners.length);
  let at = 0;
  eachFace(faces, positions, (first, end) => {
    for (let c = first; c < end; ++c) {
      const [a, b] = [corners[c], corners[c + 1 < end ? c + 1 : first]];
      keys[at++] = Math.min(a, b) * count + Math.max(a, b);
    }
  });
  const sorted = keys.subarray(0, at).sort();
  const result: Uint32Array = new Uint32Array(2 * at);
  let used = 0;
  sorted.forEach((key, i) => {
    if (i > 0 && key === sorted[i - 1]) return;
    result[used++] = Math.floor(key / count);
    result[used++] = key % count;
  });
  return result.slice(0, used);
}

/** For each place the first one that lies where it does: those along a seam are one vertex. O(N). */
export function welded(positions: Float32Array): Uint32Array {
  const bits = new Uint32Array(positions.buffer, positions.byteOffset, positions.length);
  const count = positions.length / kFloats;
  let size = 2;
  while (size < 2 * count) size *= 2;
  const table = new Int32Array(size).fill(-1);
  const vertex = new Uint32Array(count);
  const same = (a: number, b: number) => [0, 1, 2].every((c) => bits[3 * a + c] === bits[3 * b + c]);
  for (let place = 0; place < count; ++place) {
    const hash = Math.imul(bits[3 * place], 73856093) ^ Math.imul(bits[3 * place + 1], 19349663) ^ Math.imul(bits[3 * place + 2], 83492791);
    let slot = (hash ^ (hash >>> 15)) & (size - 1);
    while (table[slot] >= 0 && !same(table[slot], place)) slot = (slot + 1) & (size - 1);
    if (table[slot] < 0) table[slot] = place;
    vertex[place] = table[slot];
  }
  return vertex;
}

/** Unit normals of the places, weighted by the area of the triangles, as four 16-bit numbers each. */
export function vertexNormals(indices: Uint32Array, vertex: Uint32Array, positions: Float32Array): Int16Array {
  const sums = new Float32Array(positions.length);
  for (let t = 0; t < indices.length; t += 3) {
    const [a, b, c] = [3 * indices[t], 3 * indices[t + 1], 3 * indices[t + 2]];
    const ux = positions[b] - positions[a], uy = positions[b + 1] - positions[a + 1], uz = positions[b + 2] - positions[a + 2];
    const vx = positions[c] - positions[a], vy = positions[c + 1] - positions[a + 1], vz = positions[c + 2] - positions[a + 2];
    const nx = uy * vz - uz * vy, ny = uz * vx - ux * vz, nz = ux * vy - uy * vx;
    for (let k = 0; k < 3; ++k) {
      const at = 3 * vertex[indices[t + k]];
      sums[at] += nx;
      sums[at + 1] += ny;
      sums[at + 2] += nz;
    }
  }
  const normals = new Int16Array((4 * positions.length) / 3);
  for (let place = 0; 3 * place < positions.length; ++place) {
    const at = 3 * vertex[place];
    const scale = kOne / (Math.hypot(sums[at], sums[at + 1], sums[at + 2]) || 1);
    for (let c = 0; c < 3; ++c) normals[4 * place + c] = Math.round(sums[at + c] * scale);
  }
  return normals;
}
