// SPDX-License-Identifier: Apache-2.0
// The messages of the server, read as viewer/message.hpp writes them; and the types of what goes either way.

export type Numbers = Float32Array | Int16Array | Uint8Array | Uint32Array;

export interface Message {
  head: Head;
  arrays: Record<string, Numbers>;
}

const kTypes = { float32: Float32Array, int16: Int16Array, uint8: Uint8Array, uint32: Uint32Array } as const;
const kAlignment = 8;
const kLengthBytes = 4;

const aligned = (bytes: number) => Math.ceil(bytes / kAlignment) * kAlignment;

/** Reads a frame. The arrays are views of it. Throws if it is not one. */
export function decode(frame: ArrayBuffer): Message {
  const length = new DataView(frame).getUint32(0, true);
  const text = new TextDecoder("utf-8", { fatal: true }).decode(new Uint8Array(frame, kLengthBytes, length));
  const head = JSON.parse(text) as Head & { arrays: [string, keyof typeof kTypes, number][] };
  const arrays: Record<string, Numbers> = {};
  let at = kLengthBytes + length;
  for (const [name, type, count] of head.arrays) {
    const array = new kTypes[type](frame, at, count);
    arrays[name] = array;
    at += aligned(array.byteLength);
  }
  if (at !== frame.byteLength) throw new RangeError("the frame is longer than its arrays");
  return { head, arrays };
}

/** A direction as the server encodes a unit normal: two numbers of an octahedron's unfolding; null for none. */
export function decodeNormal(u16: number, v16: number): [number, number, number] | null {
  if (u16 === -32768) return null;
  let u = u16 / 32767;
  let v = v16 / 32767;
  const z = 1 - Math.abs(u) - Math.abs(v);
  if (z < 0) [u, v] = [(1 - Math.abs(v)) * (u < 0 ? -1 : 1), (1 - Math.abs(u)) * (v < 0 ? -1 : 1)];
  const length = Math.hypot(u, v, z);
  return [u / length, v / length, z / length];
}

export type Texts = Record<string, string>;

/** A row of the parameter table. */
export interface Param {
  name: string;
  flag: string;
  stage: string;
  kind: "int" | "length" | "switch" | "word" | "number";
  min: number;
  max: number;
  automatic: boolean;
  in_radii: boolean; // a length that may be a multiple of each point's radius
  values: string[];
  default: string;
  help: string;
  expert: boolean; // folded away unless asked for
  needs_faces: boolean; // says nothing of clouds without faces
}

export interface Hello {
  type: "hello";
  protocol: number;
  version: string;
  device: { kind: string; name: string; reason: string } | null;
  params: Param[];
  presets: { name: string; params: Texts }[];
  limits: string[];
  formats: { extensions: string[]; encodings: string[] };
  save_folder: string; // empty: files come with their message
  has_cloud: boolean; // one follows
}

export interface CloudHead {
  type: "cloud";
  name: string;
  path: string;
  points: number;
  finite: number;
  shown: number;
  origin: [number, number, number];
  min: [number, number, number];
  max: [number, number, number];
  diagonal: number;
  spacing: number;
  noise: number;
  step: number;
  metres_per_unit: number | null; // null: the file does not say
  colours: { name: string; kind: "texture" | "rgb" | "scalar" }[];
  faces: number; // of the file; those that are drawn come with the head
  settles: boolean;
}

export interface Result {
  type: "result";
  id: number;
  along_normals: boolean;
  step: number;
  used: Texts;
  moved: { mean: number; rms: number; max: number };
  unmoved: number;
  /** Why; the counts are all of `unmoved`. */
  reasons: Record<string, number>;
  pulled: number; // outliers that moved to the surface of their neighbours
  notes: string[]; // why the result may not be what it seems
  stages: { name: string; ms: number }[];
  total_ms: number;
  encode_ms: number;
  server_ms: number;
  peak_bytes: { host: number; device: number };
  command: string;
  cpp: string;
}

/** Points of a ball, and where they go; center relative to the cloud's origin. */
export interface Preview {
  type: "preview";
  id: number;
  center: [number, number, number];
  radius: number;
  more: boolean; // a larger part follows that is worth waiting for
  ms: number;
  server_ms: number;
  points: number;
}

/** The pictures of the faces, each with an array "picture0" and so on; "coordinates" of the corners and "face_pictures" say where they lie. */
export interface TextureHead {
  type: "texture";
  id: number;
  pictures: { name: string; type: string }[];
  notes: string[]; // why others are not there
}

export type Head =
  | Hello
  | CloudHead
  | Result
  | Preview
  | { type: "settled" }
  | { type: "colours"; id: number; name: string }
  | TextureHead
  | { type: "progress"; id: number; share: number; stage: string }
  | { type: "saved"; id: number; path: string; bytes: number; notes: string[]; command: string } // with an array "file" where there is no folder
  | { type: "cancelled"; id: number; ms: number }
  | { type: "taken" }
  | { type: "error"; id: number | null; message: string };

/** What is asked of a run: texts as the flags take them. */
export interface Recipe {
  params: Texts;
  limits: Texts;
}

export type Request =
  | ({ type: "run"; id: number; focus?: number[]; held: boolean; output: string; encoding: string } & Recipe)
  | ({ type: "save"; id: number; output: string; encoding: string; overwrite: boolean } & Recipe)
  | { type: "colours"; id: number; name: string }
  | { type: "texture"; id: number }
  | { type: "noise"; id: number } // answered by colours whose array is "noise"
  | { type: "outliers"; id: number } // by colours whose array is "outliers", reasons
  | { type: "cancel"; id: number };
