// SPDX-License-Identifier: Apache-2.0
// PNG files of 256 colours, which take two fifths of the space of all colours and look the same for shades of clay.
#pragma once

#include <string>
#include <vector>

namespace picture {

/// Writes red, green and blue of each pixel, row by row, with the palette that median cut finds (Heckbert 1982).
/// Replaces the file. Throws pointfair::Error.
void write_png(const std::string& path, const std::vector<unsigned char>& rgb, int width, int height);

}  // namespace picture
