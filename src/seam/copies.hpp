// SPDX-License-Identifier: Apache-2.0
// Points that repeat a measurement of the cloud: exact copies, and copies that were rounded otherwise. Of those that
// lie together one is computed, and the others get its result, so that copies of a position stay together.
#pragma once

#include <cstdint>
#include <span>
#include <stop_token>
#include <vector>

#include "point/region.h"
#include "pointfair/cloud.hpp"
#include "seam/sampling.hpp"
#include "seam/settings.hpp"

namespace pointfair {

struct Copy {
  std::uint32_t point, first;  // in upload order; `first` is no copy
  Point place;                 // of the copy
  // Whether it would be one of the same point with all of the cloud loaded, too.
  bool is_sure = true;
};

// How far around a point what lies there decides whether it is a copy, and of which: of the firsts around it, within
// the rule's distance, each cube has to be known, which reaches as far as its diagonal.
inline double reach_of_decision(const CopyRule& rule) { return rule.within > 0 ? 1.9 * rule.within : 0; }

// The region without the border in which a point may be a copy of one that is not loaded.
point::Region without_border(point::Region region, const CopyRule& rule);

// All copies among the valid points, ascending; `loaded` has all points of the cloud in it. Of the points in a cube of
// half the distance, which are all within it of each other, the first stands for the others; of such firsts, each
// follows the first of those within the distance, which may follow another one. O(N log N), 36 bytes a point and 48 a
// copy.
// Throws Error(interrupted) once `stop` is triggered.
std::vector<Copy> copies_among(std::span<const Point> points, const CopyRule& rule, const point::Region& loaded,
                               const std::stop_token& stop = {});

// The same of points that are known to be copies, ascending, and lie where a point lies that is none. Of those that do
// not, one of each place is left out, which the others of the place follow. O(N log(copies)).
std::vector<Copy> copies_at_one_place(std::span<const Point> points, std::span<const std::uint32_t> known);

// The point that `point` is a copy of, or itself.
std::uint32_t first_of(std::span<const Copy> copies, std::uint32_t point);
// Whether that is sure.
bool is_sure(std::span<const Copy> copies, std::uint32_t point);

// Gives each copy what its first has.
template <class Value>
void follow(std::span<const Copy> copies, std::span<Value> values) {
  for (const Copy& copy : copies) values[copy.point] = values[copy.first];
}

// A cloud's sample where each place counts once: of the points that `firsts` and `places` name in place of its own,
// those at new places. `times`: how many points a place has on average.
CloudSample once_each(const CloudSample& sample, std::span<const std::uint32_t> firsts, std::span<const Point> places,
                      double times);

}  // namespace pointfair
