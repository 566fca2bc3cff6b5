// SPDX-License-Identifier: Apache-2.0
// PNG files of pictures with at most 256 colours.
#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <string>

namespace pointfair::cli {

using Rgb = std::array<std::uint8_t, 3>;

/// The bytes of a PNG of `width` times as many pixels as rows; a pixel is the number of its colour in `palette`. Runs
/// of one colour are packed, and other pixels take 8 to 9 bits (Deflate with fixed codes). O(pixels).
std::string png_of(std::span<const std::uint8_t> pixels, int width, std::span<const Rgb> palette);

/// As HTML and e-mail carry bytes.
std::string base64_of(std::string_view bytes);

}  // namespace pointfair::cli
