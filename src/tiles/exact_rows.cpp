// SPDX-License-Identifier: Apache-2.0
#include "tiles/exact_rows.hpp"

#include <algorithm>
#include <deque>
#include <utility>

#include "seam/exactness.hpp"
#include "seam/sampling.hpp"

namespace pointfair {

void ExactRows::fill(PointStore& store, TileWorker& worker, std::vector<std::size_t> some, double halo) const {
  struct Asked {
    std::vector<std::size_t> queries;
    double halo;
  };
  std::deque<Asked> left;
  for (left.push_back({std::move(some), halo}); !left.empty(); left.pop_front()) {
    const auto& [asked, its_halo] = left.front();
    if (asked.empty()) continue;
    Bounds bounds = kNoBounds;
    for (const std::size_t q : asked) include(bounds, queries[q]);
    worker.finish_upload();
    worker.loaded = region_around(store.bounds(), bounds, its_halo);
    if (!store.load(worker.loaded, worker)) {
      if (asked.size() == 1) {
        fill_from_nearest(store, worker, asked.front());
        continue;
      }
      const auto middle = asked.begin() + std::ptrdiff_t(asked.size() / 2);
      left.push_back({{asked.begin(), middle}, its_halo});
      left.push_back({{middle, asked.end()}, its_halo});
      continue;
    }
    worker.upload(IndexOrder::fastest, copies);
    const point::Region surely_known = without_border(worker.loaded, copies);
    left.push_back(
        {fill_exact(worker, asked,
                    [&](point::Vec3<float> here) { return point::squared_gap_to_outside(surely_known, here); }),
         2 * its_halo});
    worker.note_costs();
  }
}

// Of a point so far off that a box which holds its nearest ones holds too many.
void ExactRows::fill_from_nearest(PointStore& store, TileWorker& worker, std::size_t query) const {
  const double known = store.load_nearest(queries[query], worker) - reach_of_decision(copies);
  if (!(known > 0)) throw store.does_not_fit(query);
  worker.loaded = kEverywhere;
  worker.upload(IndexOrder::fastest, copies);
  const auto squared_gap = [&](point::Vec3<float>) { return float(std::min(known * known, 1e38)); };
  if (!fill_exact(worker, {query}, squared_gap).empty()) throw store.does_not_fit(query);
  worker.note_costs();
}

// Returns those of the queries whose rows are not exact. squared_gap(place): around it, all points are known so far.
template <class SquaredGap>
std::vector<std::size_t> ExactRows::fill_exact(const TileWorker& worker, const std::vector<std::size_t>& asked,
                                               const SquaredGap& squared_gap) const {
  std::vector<std::uint32_t> places;
  for (const std::size_t q : asked) places.push_back(find(worker, q));
  const std::vector<std::uint32_t> asked_for = places;
  for (std::uint32_t& place : places) place = first_of(worker.copies, place);
  const std::size_t row_size = std::size_t(k) + 1;
  std::vector<Point> found(places.size() * row_size);
  worker.backend->build_index(0, std::nullopt, {});
  worker.backend->sampling().sample_neighborhoods(places, k, found);
  std::vector<std::size_t> left;
  for (std::size_t r = 0; r < places.size(); ++r) {
    const Point* row = &found[r * row_size];
    const auto here = to_vec3(row[0]), last = to_vec3(row[k]);
    const bool full = is_indexed(row[k]);
    if (point::is_exact_list({k, kUnbounded, false, 0}, full ? k : 0, full ? point::squared_length(last - here) : 0.0f,
                             squared_gap(here)) &&
        is_sure(worker.copies, asked_for[r])) {
      std::copy_n(row, row_size, &out[asked[r] * row_size]);
    } else {
      left.push_back(asked[r]);
    }
  }
  return left;
}

}  // namespace pointfair
