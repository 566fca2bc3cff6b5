// SPDX-License-Identifier: Apache-2.0
// Attributes whose values are kinds and not amounts: what each kind is called, and its colour.

// LAS specification 1.4 R15, table 17.
const kClasses = ["never classified", "unassigned", "ground", "low vegetation", "medium vegetation", "high vegetation", "building",
  "low noise", "model key point", "water", "rail", "road surface", "overlap", "wire guard", "wire conductor", "transmission tower",
  "wire connector", "bridge deck", "high noise", "overhead structure", "ignored ground", "snow", "temporal exclusion"];
const kOutliers = ["none", "isolated", "off the surface", "mixed pixel"];

/** The names of the kinds that the attribute's values stand for, by value; null if they are amounts. */
export function kindsOf(attribute: string): string[] | null {
  if (/^classification(_\d+)?$/.test(attribute)) return kClasses;
  return /^outlier(_\d+)?$/.test(attribute) ? kOutliers : null;
}

export const kindName = (names: string[], value: number) => names[value] ?? (value < 64 ? "reserved" : "user-defined");

// Kinds that everyone has a colour for; the others go round a wheel in steps that keep neighbours apart.
const kKnown: Record<number, string> = { 0: "#8a9199", 1: "#b9bfc5", 2: "#a8763e", 3: "#9ccc65", 4: "#5fa845", 5: "#2e7d32", 6: "#d9674e",
  7: "#ff3d9a", 9: "#3f8fe0", 11: "#6f7682", 14: "#f2c84b", 17: "#b48ad6", 18: "#ff8a1f" };
const kOutlierColours = ["#8a9199", "#ff4d5e", "#ffa62b", "#4da3ff"];

/** A colour as #rrggbb, of the kind with this value. */
export function kindColour(names: string[], value: number): string {
  if (names === kOutliers) return kOutlierColours[value] ?? "#ffffff";
  return kKnown[value] ?? wheel((value * 137.5) % 360);
}

function wheel(hue: number): string {
  const channel = (n: number) => {
    const k = (n + hue / 30) % 12;
    return Math.round(255 * (0.6 - 0.28 * Math.max(-1, Math.min(k - 3, 9 - k, 1)))).toString(16).padStart(2, "0");
  };
  return `#${channel(0)}${channel(8)}${channel(4)}`;
}
