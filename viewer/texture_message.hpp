// SPDX-License-Identifier: Apache-2.0
// The pictures of a mesh as the page gets them.
#pragma once

#include <cstddef>

#include "companions.hpp"
#include "message.hpp"
#include "order.hpp"
#include "pointfair/pointfair.hpp"

namespace pointfair::viewer {

/// The pictures that can be had, with a note for each other one, and where they lie on the faces that drawn_faces()
/// gives: "coordinates" of the corners, "face_pictures" with an index of "pictures" or kNoPicture, and "picture0" and
/// so on with their files. O(corners), and the files.
Bytes texture_message(const Json& id, const Cloud& cloud, const Texture& texture, const Companions& companions,
                      const Order& order, std::size_t shown);

}  // namespace pointfair::viewer
