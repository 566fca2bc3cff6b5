// SPDX-License-Identifier: Apache-2.0
// What a cloud's file is written with beside its own bytes.
#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include "io/scalar.hpp"
#include "pointfair/cloud.hpp"
#include "pointfair/positions.hpp"

namespace pointfair::io {

struct Column;
using AddedAttributes = std::vector<const Attribute*>;

/// Calls visit(value, type) for each of their values at a point, as memory holds it.
template <class Visit>
void for_each_value(const AddedAttributes& added, std::uint64_t point, const Visit& visit) {
  for (const Attribute* attribute : added) {
    const std::size_t size = size_of(native(attribute->type));
    const char* from = reinterpret_cast<const char*>(attribute->data.data()) + point * attribute->components * size;
    for (std::uint32_t c = 0; c < attribute->components; ++c, from += size) visit(from, native(attribute->type));
  }
}
/// Their bytes at a point.
std::size_t bytes_of(const AddedAttributes& added);

/// New values for a column of the file.
struct Replacement {
  std::size_t column = 0;  ///< in the source's columns()
  const Attribute* values = nullptr;

  double value(std::uint64_t point, std::uint32_t component) const {
    return value_at(*values, static_cast<std::size_t>(point), component);
  }
};

/// Where the points of a cloud are now that is not in memory.
class MovedPoints {
 public:
  virtual ~MovedPoints() = default;
  /// What a point of the file is relative to, before and now; `of_file`: what the file was read with.
  virtual Position origin_at(const Position&, const Position& of_file) const { return of_file; }
  /// Of the points from `first` on, which lie at `own` in the file. Many threads may ask at once.
  virtual void take(std::uint64_t first, std::span<const Position> own, std::span<const Point> before,
                    std::span<Point> now) const = 0;
};

class PlacedSource;

struct Edits {
  const Cloud& cloud;                    ///< where its points are now
  AddedAttributes added;                 ///< attributes that the file does not have
  std::vector<Replacement> replaced;     ///< and such that it has
  std::optional<double> las_scale;       ///< of the coordinates of a LAS file
  const MovedPoints* moved = nullptr;    ///< if given, it tells where the points are, and the cloud only its origin
  const PlacedSource* placed = nullptr;  ///< if given, the cloud's points were moved from its positions, not the file's
  std::span<const std::uint8_t> removed{};  ///< not 0 for each point of the file that is left out; empty: none is

  bool changes_attributes() const { return !added.empty() || !replaced.empty(); }
};

/// The attributes of `cloud.added` as edits of its source. Throws ErrorKind::usage if one has not the shape of the
/// file's own of its name, or two have one name.
Edits make_edits(const Cloud& cloud, std::optional<double> las_scale);

/// Throws ErrorKind::usage if the column is a part of a byte that this value does not fit into.
void check_fits(const Column& column, double value);
/// The same for all values of the replacement.
void check_fits(const Replacement& replacement, const Source& source);

}  // namespace pointfair::io
