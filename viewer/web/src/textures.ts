// SPDX-License-Identifier: Apache-2.0
// The pictures of faces: from files to what the graphics card takes.

import * as THREE from "three";
import type { Numbers, TextureHead } from "./protocol";

const kMostPixels = 1 << 26; // of all pictures; 4 bytes each on the card, and a third more for their smaller copies
const kSharpness = 4; // samples along a face that is seen from its side

/** Those that cannot be decoded are null, with a note. A picture of more than its share of pixels becomes smaller. */
export async function decodePictures({ pictures }: TextureHead, arrays: Record<string, Numbers>, mostOfSide: number):
    Promise<{ textures: (THREE.Texture | null)[]; notes: string[] }> {
  const textures: (THREE.Texture | null)[] = [];
  const notes: string[] = [];
  for (const [i, { name, type }] of pictures.entries()) {
    const file = new Blob([arrays[`picture${i}`] as Uint8Array<ArrayBuffer>], { type });
    try {
      textures.push(textureOf(await fitting(file, kMostPixels / pictures.length, mostOfSide)));
    } catch {
      notes.push(`${name}: cannot be decoded; is it damaged? Export it again`);
      textures.push(null);
    }
  }
  return { textures, notes };
}

async function fitting(file: Blob, mostPixels: number, mostOfSide: number): Promise<ImageBitmap> {
  const plain: ImageBitmapOptions = { premultiplyAlpha: "none", colorSpaceConversion: "none" };
  const image = await createImageBitmap(file, plain);
  const { width, height } = image;
  const scale = Math.min(1, mostOfSide / Math.max(width, height), Math.sqrt(mostPixels / (width * height)));
  if (scale === 1) return image;
  const side = (length: number) => Math.max(1, Math.floor(scale * length));
  const smaller = await createImageBitmap(image, { ...plain, resizeWidth: side(width), resizeHeight: side(height), resizeQuality: "high" });
  image.close();
  return smaller;
}

function textureOf(image: ImageBitmap): THREE.Texture {
  const texture = new THREE.Texture(image);
  texture.wrapS = texture.wrapT = THREE.RepeatWrapping;
  texture.flipY = false; // bitmaps are taken as they are
  texture.anisotropy = kSharpness;
  texture.needsUpdate = true;
  texture.addEventListener("dispose", () => image.close());
  return texture;
}
