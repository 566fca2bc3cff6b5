// SPDX-License-Identifier: Apache-2.0
// Draws a cloud from an orthographic camera, y up. As clay: each point is a disc in its tangent plane, discs near the
// front surface blend their normals, and the light is one lamp, a sky, and ambient occlusion measured in the depth
// image. As directions: each point is a spot in the colour of its normal.
#pragma once

#include <vector>

#include "pointfair/pointfair.hpp"

namespace picture {

struct Vec {
  float x = 0, y = 0, z = 0;
};

/// Points and normals of a cloud in world axes, and the length of a step between points.
struct Surface {
  std::vector<Vec> position, normal;
  float spacing = 0;
};

/// The cloud's finite points with the normals that a run with `params` ends with; points without one are left out.
Surface make_surface(const pointfair::Cloud& cloud, const pointfair::Params& params);

/// In pixels.
struct PanelSize {
  int width = 800, height = 900;
};

/// Angles in degrees; the focus in fractions of half the picture's height at zoom 1.
struct View {
  float azimuth = 0, elevation = 0, zoom = 1, focus_x = 0, focus_y = 0;
};

/// World to view: x right, y up, z toward the eye, the middle of the picture at 0, half its height 1.
struct Camera {
  Vec right, up, toward, center;
  float scale = 1, focus_x = 0, focus_y = 0;

  Vec turn(Vec direction) const;
  Vec view(Vec position) const;
};

/// At zoom 1 the cloud fills the panel.
Camera make_camera(const pointfair::Cloud& cloud, View view, PanelSize panel);

/// Red, green and blue of each pixel, row by row.
std::vector<unsigned char> draw_clay(const Surface& surface, const Camera& camera, PanelSize panel);

/// The same, with the radius of a spot in mean spacings.
std::vector<unsigned char> draw_directions(const Surface& surface, const Camera& camera, PanelSize panel,
                                           float spot_radius);

}  // namespace picture
