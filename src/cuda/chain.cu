// SPDX-License-Identifier: Apache-2.0
#include "cuda/chain.cuh"
#include "cuda/stages/implicit.cuh"
#include "cuda/stages/methods.cuh"
#include "seam/stop.hpp"

namespace pointfair::cuda {
namespace {

constexpr std::size_t kLargeCloud = 3'000'000;  // points; random writes to all of it miss the cache

}  // namespace

Chain::Chain(Context& context, CollectedRoom& room, MeshOnCard& mesh, StopLine& stop_line, unsigned first_call)
    : context_(context),
      room_(room),
      mesh_(mesh),
      stop_line_(stop_line),
      first_call_(first_call),
      index_(context),
      overlap_(context, index_),
      lists_(context),
      normals_(context),
      mean_distance_(context),
      places_(context),
      noise_levels_(context),
      reach_levels_(context),
      squared_level_(context),
      further_share_(context),
      squared_radius_(context),
      squared_growth_(context),
      collector_(context, room),
      rings_(context),
      mesh_tables_(context),
      sorted_edges_(context),
      held_(context),
      foreseen_(context),
      faired_(context) {}

// Between the kernels of long stages, and between further iterations: the host stays one of them ahead of the card, so
// that a stop is heard in time and the card never waits.
void Chain::pace(const std::stop_token& stop) {
  throw_if_stopped(stop);
  if (!stop.stop_possible()) return;
  check(cudaEventSynchronize(paced_.get()), "computing");
  paced_.record(context_.stream());
  throw_if_stopped(stop);
}

void Chain::begin_stage(Stage stage, const std::stop_token& stop) {
  throw_if_stopped(stop);
  if (stage != Stage::neighbors) forget_foreseen();  // neighbourhoods were there already
  stop_ = stop_line_.listen(stop, first_call_ + unsigned(stage));
  if (index_.points() < kLargeCloud) return throw_if_stopped(stop);
  pace(stop);
}

void Chain::build_index(const Point* points, std::size_t count, const std::optional<Frame>& frame,
                        const Arrival* arrival, std::stop_token stop) {
  begin_index(points, stop);
  if (Overlapped::suits(arrival, frame)) {
    overlap_.build(points, count, *arrival);
  } else {
    if (arrival != nullptr) context_.wait_for(arrival->all());
    index_.build(points, count, frame);
  }
  counts_clear_ = true;
}

void Chain::build_index(const Point* points, const CloudBatch& batch, std::stop_token stop) {
  begin_index(points, stop);
  index_.build(points, batch);
  counts_clear_ = true;
}

void Chain::begin_index(const Point* points, const std::stop_token& stop) {
  if (is_further()) pace(stop);  // iterations of short kernels that hear no stop
  throw_if_stopped(stop);
  join();
  input_ = points;
  areas_measured_ = normals_wait_ = false;
  forget_foreseen();
  collector_.release();
  rings_.release();
  room_.empty();  // sorting takes memory
}

point::Sensors Chain::sensors(const std::shared_ptr<const SensorPlaces>& places) {
  point::Sensors sensors = sensors_of(places.get());
  if (sensors.each == nullptr) return sensors;
  if (places != sensors_) {
    sensors_.reset();  // if memory is short
    places_.upload(places->places, "uploading the places of sensors");
    sensors_ = places;
  }
  sensors.each = &places_.data()->x;
  return sensors;
}

void Chain::clear(std::size_t first, std::size_t end) {
  check(cudaMemsetAsync(reinterpret_cast<std::byte*>(index_.state()) + first, 0, end - first, context_.stream()),
        "clearing counts");
}

// Before normals are estimated, which then count anew.
void Chain::clear_unmoved() {
  if (!unmoved_clear_) clear(offsetof(CloudState, too_few_neighbors), offsetof(CloudState, short_neighborhoods));
  unmoved_clear_ = false;
}

Normals Chain::normals() const {
  const std::size_t places = index_.leaves() * kLeafSize;
  return {normals_.data(), normals_.data() + places, normals_.data() + 2 * places};
}

void Chain::estimate_normals(const NormalSettings& settings, std::stop_token stop) {
  begin_stage(Stage::normals, stop);
  restore_neighborhoods(stop);
  normal_settings_ = settings;
  normals_.resize(3 * index_.leaves() * kLeafSize);
  normals_wait_ = true;
  if (neighbors_.k == 0 || along_mesh() || settings.filter_rounds > 0) run_waiting_normals(stop);
}

void Chain::run_waiting_normals(const std::stop_token& stop) {
  join();
  if (!normals_wait_) return;
  clear_unmoved();
  if (neighbors_.k > 0 && !along_mesh()) {
    cuda::estimate_normals(context_, index_.tree(), index_.state(), lists(),
                           point::normal_weights(normal_settings_.sigma), normals());
  } else {
    estimate_wide_normals(context_, index_.tree(), index_.state(), surroundings(stop_), normal_settings_, normals());
  }
  filter_normals(stop);
  normals_wait_ = false;
}

void Chain::filter_normals(const std::stop_token& stop) {
  const std::size_t places = index_.leaves() * kLeafSize;
  DeviceArray<float> filtered(context_);
  if (radii_grow()) squared_growth_.resize(places);
  for (int round = 0; round < normal_settings_.filter_rounds; ++round) {
    pace(stop);
    filtered.resize(3 * places);
    const bool is_last = round + 1 == normal_settings_.filter_rounds;
    cuda::filter_normals(context_, index_.tree(), surroundings(stop_), normal_settings_, normals(), further_shares(),
                         {filtered.data(), filtered.data() + places, filtered.data() + 2 * places},
                         is_last && radii_grow() ? squared_growth_.data() : nullptr);
    normals_.swap(filtered);
  }
}

void Chain::fair(const FairingSettings& settings, std::stop_token stop) {
  begin_stage(Stage::fairing, stop);
  restore_neighborhoods(stop);
  fairing_settings_ = settings;
  solver_ = {};
  held_.release();
  const int power = area_power(settings.area_weight);
  if (power > 0) {
    join();
    measure_areas();
  }
  const AreaWeights areas{mean_distance_.data(), power};
  faired_.resize(index_.points());
  const auto weights = point::bilateral_weights(settings.closeness_sigma, settings.similarity_sigma);
  const bool plain = settings.method == Method::bilateral && neighbors_.k > 0 && !along_mesh() && !settings.symmetric &&
                     settings.strength == 1 && settings.noise == 0 && settings.outlier_distance == 0 &&
                     !settings.along_ray;
  const bool by_parts = overlap_.can_fair();
  if (by_parts && plain && normals_wait_ && power == 0) return fair_by_parts(weights);
  join();
  DeviceArray<Point> staged(context_);
  DeviceArray<Index> originals(context_);
  const bool is_batch = index_.tree().leaves_of_cloud > 0;  // whose clouds' points go to places near each other
  if (index_.points() >= kLargeCloud && !is_batch) {
    staged.resize(index_.points());
    originals.resize(2 * index_.points());
  }
  const FairedPoints faired{faired_.data(), input_,           index_.points(),
                            staged.data(),  originals.data(), originals.data() + originals.size() / 2};
  if (settings.method == Method::implicit) {
    run_waiting_normals(stop);
    solver_ = fair_implicitly(context_, index_.tree(), lists(), settings, faired, stop);
    return;
  }
  if (settings.method != Method::bilateral) {
    fair_by_method(settings, areas, faired, stop);
    return keep_boundary(settings);
  }
  if (!plain) {
    run_waiting_normals(stop);
    fair_widely(context_, index_.tree(), grown_surroundings(stop_), normals(), areas, settings,
                sensors(settings.sensors), {squared_levels(), settings.is_further ? further_shares() : nullptr},
                faired);
    keep_boundary(settings);
  } else if (normals_wait_) {
    clear_unmoved();
    normals_wait_ = false;
    estimate_normals_and_fair(context_, index_.tree(), index_.state(), index_.all_leaves(), lists(),
                              point::normal_weights(normal_settings_.sigma), normals(), areas, weights, faired);
  } else {
    cuda::fair(context_, index_.tree(), lists(), normals(), areas, weights, faired);
  }
}

void Chain::keep_boundary(const FairingSettings& settings) {
  if (!settings.kept_boundary) return;
  held_.resize(1);
  held_.clear("keeping the boundary");
  cuda::keep_boundary(context_, index_.tree(), mesh_.of(settings.kept_boundary), normals(), faired_.data(),
                      held_.data());
}

std::uint64_t Chain::held_of_boundary() { return held_.size() == 0 ? 0 : held_.first("reading counts"); }

// Normals, too. In spatial order a part's points go to places near each other, so nothing is staged.
void Chain::fair_by_parts(point::BilateralWeights weights) {
  clear_unmoved();
  const FairedPoints faired{faired_.data(), input_, index_.points(), nullptr, nullptr, nullptr};
  overlap_.fair([&](LeafRange leaves) {
    estimate_normals_and_fair(context_, index_.tree(), index_.state(), leaves, lists(),
                              point::normal_weights(normal_settings_.sigma), normals(), {}, weights, faired);
  });
  normals_wait_ = false;
}

void Chain::fair_by_method(const FairingSettings& settings, AreaWeights areas, const FairedPoints& faired,
                           const std::stop_token& stop) {
  run_waiting_normals(stop);
  const std::size_t places = index_.leaves() * kLeafSize;
  DeviceArray<float> displacements(context_);
  displacements.resize(3 * places);
  cuda::fair_by_method(
      context_, index_.tree(), surroundings(stop_), normals(), areas, method_rule(settings), sensors(settings.sensors),
      {displacements.data(), displacements.data() + places, displacements.data() + 2 * places}, faired);
}

void Chain::restore_normals(Point* out) {
  run_waiting_normals();
  restore_order(context_, index_.tree(), normals(), index_.points(), out);
}

void Chain::find_outcomes(const point::Region& loaded, unsigned char* out) {
  run_waiting_normals();
  if (along_mesh()) restore_neighborhoods({});  // a further iteration may have their memory
  const bool reads_areas = fairing_settings_.area_weight != AreaWeight::none;
  const NearestQuery query = nearest_query();
  cuda::find_outcomes(context_, index_.tree(), grown_surroundings(), normals(),
                      {loaded,
                       {query.k, query.squared_limit, neighbors_.constraint, neighbors_.reach},
                       reach_levels_.of(neighbors_.reach_levels),
                       reads_areas ? mean_distance_.data() : nullptr,
                       normal_settings_.filter_rounds,
                       reads_normals_of_neighbors(fairing_settings_),
                       fairing_settings_.method != Method::bilateral,
                       along_mesh()},
                      index_.points(), out);
}

void Chain::sample_neighborhoods(const RowRequest& request) {
  join();
  find_rows(context_, index_.tree(), input_, request);
}

void Chain::take_samples(const SampleArrays& samples) {
  join();
  cuda::take_samples(context_, index_.tree(), input_, samples);
}

void Chain::fetch_state(CloudState* pinned) {
  run_waiting_normals();
  *pinned = {};
  if (index_.state() == nullptr) return;
  check(cudaMemcpyAsync(pinned, index_.state(), sizeof(*pinned), cudaMemcpyDeviceToHost, context_.stream()),
        "reading counts");
}

CloudState Chain::state() {
  CloudState state{};
  fetch_state(&state);
  context_.finish();
  return state;
}

}  // namespace pointfair::cuda
