// SPDX-License-Identifier: Apache-2.0
#include "png_file.hpp"

#include <png.h>

#include <algorithm>
#include <array>
#include <cstdint>

#include "pointfair/cloud.hpp"

namespace picture {
namespace {

constexpr int kColors = 256;
constexpr int kBits = 6;  // per channel, of what is told apart

using Color = std::array<std::uint8_t, 3>;

struct Bin {
  Color color{};
  std::uint64_t count = 0;
};

std::size_t bin_of(const unsigned char* rgb) {
  std::size_t bin = 0;
  for (int c = 0; c < 3; ++c) bin = bin << kBits | rgb[c] >> (8 - kBits);
  return bin;
}

// The bins that occur, with how many pixels are in each.
std::vector<Bin> histogram(const std::vector<unsigned char>& rgb) {
  std::vector<std::uint64_t> counts(std::size_t(1) << (3 * kBits));
  for (std::size_t i = 0; i < rgb.size(); i += 3) ++counts[bin_of(&rgb[i])];
  std::vector<Bin> bins;
  for (std::size_t bin = 0; bin < counts.size(); ++bin) {
    if (counts[bin] == 0) continue;
    Bin entry;
    for (int c = 0; c < 3; ++c) {
      const std::size_t level = bin >> (kBits * (2 - c)) & ((1 << kBits) - 1);
      entry.color[c] = std::uint8_t(level << (8 - kBits) | 1 << (7 - kBits));
    }
    entry.count = counts[bin];
    bins.push_back(entry);
  }
  return bins;
}

// Bins [first, last) that share one colour of the palette.
struct Box {
  std::size_t first, last;
  int axis = 0;          // on which its colours differ most
  std::uint64_t extent;  // by so much, times its pixels
};

Box make_box(const std::vector<Bin>& bins, std::size_t first, std::size_t last) {
  Box box{first, last, 0, 0};
  std::uint64_t pixels = 0;
  for (std::size_t i = first; i < last; ++i) pixels += bins[i].count;
  for (int c = 0; c < 3; ++c) {
    const auto less = [&](const Bin& a, const Bin& b) { return a.color[c] < b.color[c]; };
    const auto [low, high] = std::minmax_element(bins.begin() + long(first), bins.begin() + long(last), less);
    const std::uint64_t extent = std::uint64_t(high->color[c] - low->color[c]) * pixels;
    if (extent > box.extent) box.axis = c, box.extent = extent;
  }
  return box;
}

// Sorts the box's bins on its axis and returns where half of its pixels end, with a bin left on either side.
std::size_t median(std::vector<Bin>& bins, const Box& box) {
  std::stable_sort(bins.begin() + long(box.first), bins.begin() + long(box.last),
                   [&](const Bin& a, const Bin& b) { return a.color[box.axis] < b.color[box.axis]; });
  std::uint64_t pixels = 0, passed = 0;
  for (std::size_t i = box.first; i < box.last; ++i) pixels += bins[i].count;
  std::size_t middle = box.first;
  while (middle < box.last - 1 && 2 * passed < pixels) passed += bins[middle++].count;
  return std::max(middle, box.first + 1);
}

std::vector<Box> median_cut(std::vector<Bin>& bins) {
  std::vector<Box> boxes = {make_box(bins, 0, bins.size())};
  while (boxes.size() < kColors) {
    const auto widest =
        std::max_element(boxes.begin(), boxes.end(), [](const Box& a, const Box& b) { return a.extent < b.extent; });
    if (widest->extent == 0) break;
    const Box box = *widest;
    const std::size_t middle = median(bins, box);
    *widest = make_box(bins, box.first, middle);
    boxes.push_back(make_box(bins, middle, box.last));
  }
  return boxes;
}

Color mean_color(const std::vector<Bin>& bins, const Box& box) {
  std::array<std::uint64_t, 3> sum{};
  std::uint64_t pixels = 0;
  for (std::size_t i = box.first; i < box.last; ++i) {
    for (int c = 0; c < 3; ++c) sum[c] += bins[i].count * bins[i].color[c];
    pixels += bins[i].count;
  }
  return {std::uint8_t(sum[0] / pixels), std::uint8_t(sum[1] / pixels), std::uint8_t(sum[2] / pixels)};
}

}  // namespace

void write_png(const std::string& path, const std::vector<unsigned char>& rgb, int width, int height) {
  std::vector<Bin> bins = histogram(rgb);
  const std::vector<Box> boxes = median_cut(bins);
  std::vector<unsigned char> palette;
  std::vector<unsigned char> index_of_bin(std::size_t(1) << (3 * kBits));
  for (std::size_t b = 0; b < boxes.size(); ++b) {
    const Color color = mean_color(bins, boxes[b]);
    palette.insert(palette.end(), color.begin(), color.end());
    for (std::size_t i = boxes[b].first; i < boxes[b].last; ++i)
      index_of_bin[bin_of(bins[i].color.data())] = static_cast<unsigned char>(b);
  }
  std::vector<unsigned char> indices;
  indices.reserve(rgb.size() / 3);
  for (std::size_t i = 0; i < rgb.size(); i += 3) indices.push_back(index_of_bin[bin_of(&rgb[i])]);
  png_image image{};
  image.version = PNG_IMAGE_VERSION;
  image.width = png_uint_32(width);
  image.height = png_uint_32(height);
  image.format = PNG_FORMAT_RGB_COLORMAP;
  image.colormap_entries = png_uint_32(boxes.size());
  if (!png_image_write_to_file(&image, path.c_str(), 0, indices.data(), 0, palette.data()))
    throw pointfair::Error(pointfair::ErrorKind::file, path + ": " + image.message);
}

}  // namespace picture
