// SPDX-License-Identifier: Apache-2.0
// The neighbourhoods of a chain: lists, or radii and what lies within them.
#include <utility>

#include "cuda/chain.cuh"
#include "seam/stop.hpp"

namespace pointfair::cuda {
namespace {

constexpr float kNoLimit = __builtin_inff();
constexpr std::size_t kLargestCollection = 1024;  // bytes a point
constexpr std::size_t kMostForeseen = 1 << 22;    // points: beyond, more neighbours than needed cost more than it saves

}  // namespace

void Chain::find_neighbors(const NeighborSettings& settings, bool arriving, std::stop_token stop) {
  const bool by_parts = !settings.mesh && overlap_.can_search(settings);
  if (!by_parts) join();
  begin_stage(Stage::neighbors, stop);
  neighbors_ = settings;
  areas_measured_ = false;
  // one launch for all counts of this stage and the next
  if (!std::exchange(counts_clear_, false)) clear(offsetof(CloudState, leaf_retries), sizeof(CloudState));
  unmoved_clear_ = true;
  normals_wait_ = false;
  measure_levels();
  collector_.release();
  rings_.release();
  if (settings.k == 0) {
    room_.empty();
    measure_radii(stop);
    collect();
    return throw_if_stopped(stop);  // it has waited
  }
  forget_foreseen();
  if (settings.mesh) {
    lists_.release();
    rings_.find(mesh_tables_, index_.tree(), sorted_edges_.find(index_.tree(), mesh_.of(settings.mesh)), settings.rings,
                nearest_query().squared_limit, stop_);
    return throw_if_stopped(stop);
  }
  lists_.resize(index_.leaves() * kLeafSize * settings.k);
  if (settings.constraint) return grow_constrained(stop);
  if (by_parts) return overlap_.search(nearest_query(), lists_.data(), arriving, stop);
  DeviceArray<Index> retries(context_);
  find_nearest(context_, index_.tree(), index_.state(), nearest_query(), lists_.data(), make_room(retries), stop_);
}

void Chain::restore_neighborhoods(const std::stop_token& stop) {
  if (!collector_.is_aside()) return;
  collect();
  if (stop.stop_requested()) collector_.set_aside();  // some may be missing
  throw_if_stopped(stop);
}

// What lies within the radii, in the memory that chains share.
void Chain::collect() {
  if (!along_mesh()) return collector_.collect(index_.tree(), radii(), index_.points() * kLargestCollection, stop_);
  const SortedEdgesView edges = sorted_edges_.find(index_.tree(), mesh_.of(neighbors_.mesh));
  const bool has_room = collector_.collect(index_.tree(), ~std::size_t{0}, [&](const PartsRoom& room) {
    find_balls(context_, mesh_tables_, index_.tree(), edges, radii(), neighbors_.mesh_growth, room, stop_);
  });
  if (!has_room) throw Error(ErrorKind::memory, "no memory of the card is left for neighbourhoods along the mesh");
}

void Chain::measure_radii(const std::stop_token& stop) {
  lists_.release();
  const std::size_t places = index_.leaves() * kLeafSize;
  squared_radius_.resize(places);
  if (shares_further()) {
    further_share_.resize(places);
  } else {
    further_share_.release();
  }
  const int min_neighbors = neighbors_.min_neighbors;
  DeviceArray<Index> nearest(context_);
  int found = min_neighbors;
  if (min_neighbors > 0 && foreseen_count_ >= min_neighbors) {
    found = foreseen_count_;
    nearest.swap(foreseen_);
  } else if (min_neighbors > 0) {
    find_all_nearest(min_neighbors, nearest, stop_);
    pace(stop);
  }
  forget_foreseen();
  cuda::measure_radii(context_, index_.tree(), {found, nearest.data()}, radii(),
                      reach_levels_.of(neighbors_.reach_levels), squared_radius_.data(),
                      shares_further() ? further_share_.data() : nullptr);
}

void Chain::find_all_nearest(int count, DeviceArray<Index>& nearest, const Stop& stop) {
  DeviceArray<Index> retries(context_);
  nearest.resize(index_.leaves() * kLeafSize * count);
  find_nearest(context_, index_.tree(), index_.state(), {count, kNoLimit}, nearest.data(), make_room(retries), stop);
}

// It hears no stop: a later run may use what it finds. What stages have counted may still be asked for.
void Chain::foresee_nearest(int count) {
  if (index_.points() > kMostForeseen) return;
  join();
  if (!std::exchange(counts_clear_, false))
    clear(offsetof(CloudState, leaf_retries), offsetof(CloudState, too_few_neighbors));
  try {
    find_all_nearest(count, foreseen_, {});
    foreseen_count_ = count;
  } catch (const Error& error) {
    if (error.kind() != ErrorKind::memory) throw;
    forget_foreseen();
  }
}

void Chain::measure_levels() {
  if (!neighbors_.levels && index_.tree().settings == nullptr) return squared_level_.release();
  squared_level_.resize(index_.leaves() * kLeafSize);
  cuda::measure_levels(context_, index_.tree(), noise_levels_.of(neighbors_.levels), squared_level_.data());
}

void Chain::grow_constrained(const std::stop_token& stop) {
  // Most neighbourhoods are the nearest points themselves, and show that they are from these alone.
  const int pool = std::min(std::max(point::kAreaNeighbors, neighbors_.k), kLargestList);
  const NearestQuery query = nearest_query();
  DeviceArray<Index> retries(context_), candidates(context_);
  const Retries room = make_room(retries);
  candidates.resize(index_.leaves() * kLeafSize * pool);
  const Lists pools{pool, candidates.data()};
  find_nearest(context_, index_.tree(), index_.state(), {pool, query.squared_limit}, candidates.data(), room, stop_);
  pace(stop);
  areas_measured_ = neighbors_.radius == 0;  // with a radius the candidates are not the nearest of all
  if (areas_measured_) mean_distance_.resize(index_.leaves() * kLeafSize);
  grow_neighborhoods(context_, index_.tree(), index_.state(), query, neighbors_.reach, pools, lists_.data(),
                     room.queries, areas_measured_ ? mean_distance_.data() : nullptr, stop_);
}

NearestQuery Chain::nearest_query() const {
  return {neighbors_.k, neighbors_.radius > 0 ? neighbors_.radius * neighbors_.radius : kNoLimit};
}

Retries Chain::make_room(DeviceArray<Index>& retries) const {
  const std::size_t places = index_.leaves() * kLeafSize;
  constexpr std::size_t kOfLeaf = sizeof(HardLeaf) / sizeof(Index);
  retries.resize(kOfLeaf * index_.leaves() + places);
  return {reinterpret_cast<HardLeaf*>(retries.data()), retries.data() + kOfLeaf * index_.leaves()};
}

// The mean distances are to the nearest of all points, whatever the lists are limited to. Only some runs need them.
void Chain::measure_areas() {
  if (areas_measured_) return;
  const std::size_t places = index_.leaves() * kLeafSize;
  mean_distance_.resize(places);
  const bool listed =
      neighbors_.k >= point::kAreaNeighbors && neighbors_.radius == 0 && !neighbors_.constraint && !along_mesh();
  if (listed) {
    measure_mean_distances(context_, index_.tree(), lists(), mean_distance_.data());
  } else {
    DeviceArray<Index> nearest(context_), retries(context_);
    nearest.resize(places * point::kAreaNeighbors);
    clear(offsetof(CloudState, leaf_retries), offsetof(CloudState, too_few_neighbors));
    find_nearest(context_, index_.tree(), index_.state(), {point::kAreaNeighbors, kNoLimit}, nearest.data(),
                 make_room(retries), stop_);
    measure_mean_distances(context_, index_.tree(), {point::kAreaNeighbors, nearest.data()}, mean_distance_.data());
  }
  areas_measured_ = true;
}

Surroundings Chain::grown_surroundings(const Stop& stop) const {
  Surroundings result = surroundings(stop);
  if (radii_grow()) result.radii.squared_growth = squared_growth_.data();
  return result;
}

}  // namespace pointfair::cuda
