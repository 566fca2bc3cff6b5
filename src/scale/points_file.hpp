// SPDX-License-Identifier: Apache-2.0
// Points of a work folder in one file: sections, each of points that are read together. In the file: the header, the
// sections, some numbers, then the positions of all points, then their indices in the input. 16 bytes a point where
// indices count from a first one, else 20.
#pragma once

#include <array>
#include <cstdint>
#include <filesystem>
#include <span>
#include <vector>

#include "pointfair/cloud.hpp"
#include "scale/work_file.hpp"
#include "scale/zones.hpp"
#include "seam/sampling.hpp"

namespace pointfair::scale {

struct Section {
  std::uint32_t key = 0;  ///< the leaf of its points, or the chunk of the input that they are of
  Zone zone{};            ///< of its points, which are relative to the zone's middle
  std::uint64_t count = 0;
  Point min{}, max{};  ///< of its points
};

/// What a task counted; what each number is, its task says.
using TaskCounts = std::array<std::uint64_t, 4>;

/// What a file begins with.
struct PointsHeader {
  std::array<char, 8> magic{'p', 'f', 'p', 'o', 'i', 'n', 't', 's'};
  std::uint64_t sections = 0, numbers = 0, points = 0;
  std::uint64_t index_bytes = 4;  ///< 4: indices are differences from first_index
  std::uint64_t first_index = 0;
  TaskCounts counts{};
  std::uint64_t positions_at() const { return sizeof(PointsHeader) + sections * sizeof(Section) + numbers * 8; }
  std::uint64_t indices_at() const { return positions_at() + points * sizeof(Point); }
  std::uint64_t size() const { return indices_at() + points * index_bytes; }
};

/// Writes a file from its beginning to its end.
class PointsWriter {
 public:
  PointsWriter(const std::filesystem::path& path, PointsHeader header, const std::vector<Section>& sections,
               const std::vector<double>& numbers);
  /// First all positions, then all indices, in any number of calls.
  template <class T>
  void write(std::span<T> values) {
    file_.write(values);
  }
  /// The step's end mark brings the names of its files to the disk.
  void finish() { file_.finish(false); }

 private:
  NewFile file_;
};

class PointsFile {
 public:
  explicit PointsFile(const std::filesystem::path& path);

  const PointsHeader& header() const { return header_; }
  std::vector<Section> sections() const;
  std::vector<double> numbers() const;
  void positions(std::uint64_t first, std::span<Point> out) const;
  /// In the whole input.
  void indices(std::uint64_t first, std::span<std::uint64_t> out) const;
  /// As differences from the first one. Only where index_bytes is 4.
  void short_indices(std::uint64_t first, std::span<std::uint32_t> out) const;

 private:
  StoredFile file_;
  PointsHeader header_;
};

}  // namespace pointfair::scale
