// SPDX-License-Identifier: Apache-2.0
// Points of a work folder in one file: sections, each of points that are read together. In the file: the header, the
// sections, some numbers, then the positions of all points, then their indices in the input. 16 bytes a point where
// indices count from a first one, else 20.
#pragma once

#include <algorithm>
#include <array>
#include <cstdint>
#include <filesystem>
#include <span>
#include <vector>

#include "pointfair/cloud.hpp"
#include "pointfair/outliers.hpp"
#include "scale/work_file.hpp"
#include "scale/zones.hpp"
#include "seam/backend.hpp"

namespace pointfair::scale {

struct Section {
  std::uint32_t key = 0;  ///< the leaf of its points, or the chunk of the input that they are of
  Zone zone{};            ///< of its points, which are relative to the zone's middle
  std::uint64_t count = 0;
  Point min{}, max{};        ///< of its points
  std::uint64_t copies = 0;  ///< so many of its last points are copies, which lie where others do, but for rounding
};

/// What a task counted, where it counts such.
struct TaskCounts {
  Counts points{};            ///< with outliers, where a file was written
  std::uint64_t ignored = 0;  ///< finite points
  std::uint64_t held = 0;     ///< by the limits, without outliers
  OutlierOutcome outcome{};
};

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

/// The numbers of points group after group, in their order within each. Points of no group are left out.
struct Grouped {
  Grouped(std::span<const std::uint32_t> group_of, std::size_t groups);
  static constexpr std::uint32_t kNone = ~std::uint32_t{0};
  std::uint64_t count(std::size_t group) const { return begins[group + 1] - begins[group]; }
  std::vector<std::uint64_t> begins;  ///< of the groups in the order, and past the last
  std::vector<std::uint32_t> order;
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
  /// The values of some points, by their numbers.
  template <class T, class ValueAt>
  void write(std::span<const std::uint32_t> numbers, const ValueAt& value_at) {
    constexpr std::size_t kSome = 1 << 16;
    std::vector<T> some;
    for (std::size_t begin = 0; begin < numbers.size(); begin += kSome) {
      some.clear();
      for (const std::uint32_t i : numbers.subspan(begin, std::min(kSome, numbers.size() - begin)))
        some.push_back(value_at(i));
      write(std::span(some));
    }
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
