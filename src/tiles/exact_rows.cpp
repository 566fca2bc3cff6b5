// SPDX-License-Identifier: Apache-2.0
#include "tiles/exact_rows.hpp"

#include <algorithm>

#include "seam/cloud_sample.hpp"
#include "seam/sampling.hpp"

namespace pointfair {

std::vector<std::size_t> sample_exact_rows(Backend& backend, const point::Region& loaded,
                                           std::span<const std::uint32_t> places, std::span<const std::size_t> rows,
                                           int k, std::span<Point> out) {
  backend.build_index(0, std::nullopt, {});
  const std::size_t row_size = std::size_t(k) + 1;
  std::vector<Point> found(places.size() * row_size);
  backend.sampling().sample_neighborhoods(places, k, found);
  std::vector<std::size_t> left;
  for (std::size_t r = 0; r < places.size(); ++r) {
    const Point* row = &found[r * row_size];
    const auto here = to_vec3(row[0]), last = to_vec3(row[k]);
    const bool full = is_indexed(row[k]);
    if (point::is_exact_list({k, kUnbounded, false, 0}, full ? k : 0, full ? point::squared_length(last - here) : 0.0f,
                             point::squared_gap_to_outside(loaded, here))) {
      std::copy_n(row, row_size, &out[rows[r] * row_size]);
    } else {
      left.push_back(rows[r]);
    }
  }
  return left;
}

}  // namespace pointfair
