// SPDX-License-Identifier: Apache-2.0
#include "cuda/chain.cuh"

namespace pointfair::cuda {
namespace {

constexpr int kLeastPool = 16;                  // candidates that a constrained neighbourhood starts with
constexpr std::size_t kLargeCloud = 3'000'000;  // points; its random accesses miss the cache
constexpr float kNoLimit = __builtin_inff();

void stop_if_asked(const std::stop_token& stop) {
  if (stop.stop_requested()) throw Error(ErrorKind::interrupted, "interrupted");
}

}  // namespace

Chain::Chain(Context& context)
    : context_(context),
      index_(context),
      lists_(context),
      normals_(context),
      mean_distance_(context),
      faired_(context),
      place_of_(context) {}

void Chain::build_index(const Point* points, std::size_t count, std::stop_token stop) {
  stop_if_asked(stop);
  input_ = points;
  areas_measured_ = places_known_ = false;
  index_.build(points, count);
}

void Chain::find_neighbors(const NeighborSettings& settings, std::stop_token stop) {
  stop_if_asked(stop);
  neighbors_ = settings;
  areas_measured_ = false;
  check(cudaMemsetAsync(&index_.state()->short_neighborhoods, 0, sizeof(CloudState::short_neighborhoods),
                        context_.stream()),
        "preparing the search");
  if (settings.k == 0) return lists_.release();
  const std::size_t places = index_.leaves() * kLeafSize;
  const float squared_limit = settings.radius > 0 ? settings.radius * settings.radius : kNoLimit;
  DeviceArray<Index> retries(context_);
  retries.resize(places + index_.leaves());
  const Retries room{retries.data() + places, retries.data()};
  lists_.resize(places * settings.k);
  if (!settings.constraint)
    return find_nearest(context_, index_.tree(), index_.state(), {settings.k, squared_limit}, lists_.data(), room);

  const int pool = std::min(std::max(kLeastPool, 2 * settings.k), kLargestList);
  DeviceArray<Index> candidates(context_);
  candidates.resize(places * pool);
  const Lists pools{pool, candidates.data()};
  find_nearest(context_, index_.tree(), index_.state(), {pool, squared_limit}, candidates.data(), room);
  stop_if_asked(stop);
  grow_neighborhoods(context_, index_.tree(), index_.state(), {settings.k, squared_limit}, settings.reach, pools,
                     lists_.data(), retries.data());
  if (settings.radius > 0) return;
  mean_distance_.resize(places);
  measure_mean_distances(context_, index_.tree(), pools, mean_distance_.data());
  areas_measured_ = true;
}

// The mean distances are to the nearest of all points, whatever the lists are limited to. Only some runs need them.
void Chain::measure_areas() {
  if (areas_measured_) return;
  const std::size_t places = index_.leaves() * kLeafSize;
  mean_distance_.resize(places);
  const bool listed = neighbors_.k >= point::kAreaNeighbors && neighbors_.radius == 0 && !neighbors_.constraint;
  if (listed) {
    measure_mean_distances(context_, index_.tree(), lists(), mean_distance_.data());
  } else {
    DeviceArray<Index> nearest(context_), retries(context_);
    nearest.resize(places * point::kAreaNeighbors);
    retries.resize(places + index_.leaves());
    find_nearest(context_, index_.tree(), index_.state(), {point::kAreaNeighbors, kNoLimit}, nearest.data(),
                 {retries.data() + places, retries.data()});
    measure_mean_distances(context_, index_.tree(), {point::kAreaNeighbors, nearest.data()}, mean_distance_.data());
  }
  areas_measured_ = true;
}

Normals Chain::normals() const {
  const std::size_t places = index_.leaves() * kLeafSize;
  return {normals_.data(), normals_.data() + places, normals_.data() + 2 * places};
}

void Chain::estimate_normals(const NormalSettings& settings, std::stop_token stop) {
  stop_if_asked(stop);
  normals_.resize(3 * index_.leaves() * kLeafSize);
  cuda::estimate_normals(context_, index_.tree(), index_.state(), neighborhoods(),
                         point::normal_weights(settings.weighted, settings.sigma), normals());
}

void Chain::fair(const FairingSettings& settings, std::stop_token stop) {
  stop_if_asked(stop);
  const int power = settings.area_weight == AreaWeight::squared  ? 2
                    : settings.area_weight == AreaWeight::length ? 1
                                                                 : 0;
  if (power > 0) measure_areas();
  faired_.resize(index_.points());
  DeviceArray<float4> sorted(context_);
  if (index_.points() >= kLargeCloud) {
    sorted.resize(index_.leaves() * kLeafSize);
    find_places();
  }
  cuda::fair(context_, index_.tree(), neighborhoods(), normals(), {mean_distance_.data(), power},
             point::bilateral_weights(settings.closeness_sigma, settings.similarity_sigma), input_, index_.points(),
             {faired_.data(), sorted.data(), place_of_.data()});
}

void Chain::find_places() {
  if (places_known_) return;
  place_of_.resize(index_.points());
  cuda::find_places(context_, index_.tree(), index_.points(), place_of_.data());
  places_known_ = true;
}

void Chain::restore_normals(Point* out) { restore_order(context_, index_.tree(), normals(), index_.points(), out); }

void Chain::sample_neighborhoods(const Index* queries, std::size_t count, int k, Point* rows) {
  sample_nearest(context_, index_.tree(), input_, queries, count, k, rows);
}

CloudState Chain::state() const {
  CloudState state{};
  if (index_.state() == nullptr) return state;
  check(cudaMemcpyAsync(&state, index_.state(), sizeof(state), cudaMemcpyDeviceToHost, context_.stream()),
        "reading counts");
  context_.finish();
  return state;
}

}  // namespace pointfair::cuda
