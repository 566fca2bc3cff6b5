// SPDX-License-Identifier: Apache-2.0
// What parameters are called where nobody types flags.

const kWords: Record<string, string> = {
  noise: "Noise", k: "Neighbours", radius: "Radius", min_neighbors: "Fewest neighbours", constraint: "Do not cross gaps",
  connectivity: "Neighbours by", rings: "Rings", keep_boundary: "Keep the border", tangential: "Even out",
  rho: "Gap: sampling", delta: "Gap: noise", normal_sigma: "Width for normals", normal_filter: "Filter normals",
  crease_angle: "Angle of edges", flat_scale: "Wider where flat", method: "Method", along: "Move along",
  closeness_sigma: "Closeness sigma", similarity_sigma: "Similarity sigma", area_weight: "Weight by area", offset: "Heights over",
  relaxation: "Share of each step", implicit_weights: "Weight of edges", implicit_lambda: "Lambda", outliers: "Outliers", outlier_distance: "Outliers: distance", outlier_radius: "Outliers: radius",
  iterations: "Iterations", displacement_limit: "Longest move",
};

/** In words; a parameter that this page does not know has its name. */
export const wordsFor = (name: string): string => kWords[name] ?? name.replaceAll("_", " ");
