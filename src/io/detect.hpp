// SPDX-License-Identifier: Apache-2.0
// Which format a file has.
#pragma once

#include <optional>
#include <string_view>

#include "pointfair/io.hpp"

namespace pointfair::io {

/// What the name of a file that is read may end in, and of one that is written, in words.
inline constexpr const char* kKnownExtensions =
    ".ply, .pcd, .las, .laz, .e57, .ptx, .stl, .npy, .glb, .xyz, .txt, .csv, .pts, .off or .obj";
inline constexpr const char* kWrittenExtensions =
    ".ply, .pcd, .las, .laz, .e57, .ptx, .stl, .npy, .xyz, .txt, .csv, .pts, .off or .obj";

/// The format that the content shows by itself: ply, pcd, off or obj; nothing for plain numbers.
std::optional<Format> format_of_content(std::string_view bytes);

/// Whether the first line that is no comment begins with a number.
bool looks_like_numbers(std::string_view bytes);

}  // namespace pointfair::io
