// SPDX-License-Identifier: Apache-2.0
// The results of every stage of one iteration on the card. Normals over lists wait until it is known what comes next:
// fairing runs with them as one kernel, and once a result is asked for they run alone. Where the index is in parts, the
// paper's stages over lists follow each other part by part (part_flow.cuh); all else waits for all parts.
// Memory, bytes a point: index 17, lists 4 k, normals 12, faired positions 12; mean distances 4 once an area weight is
// asked for; radii instead of lists 4, 4 more where the noise is followed and 4 where the reach differs, and what the
// collector takes, up to kLargestCollection, from a room that chains share; along a mesh about 44, and what its lists
// or parts take; while neighbours are found, 4, and with the constraint 4 more for each of k candidates; while a large
// cloud is faired, 20, and what the method implicit takes.
#pragma once

#include <limits>
#include <memory>

#include "cuda/index/cloud_batch.cuh"
#include "cuda/node_levels.cuh"
#include "cuda/overlap/overlap.cuh"
#include "cuda/runtime/stop.cuh"
#include "cuda/sampling/samples.cuh"
#include "cuda/search/search.cuh"
#include "cuda/stages/list_stages.cuh"
#include "cuda/stages/mesh_neighbors.cuh"
#include "cuda/stages/outcomes.cuh"
#include "cuda/stages/wide_stages.cuh"
#include "seam/backend.hpp"
#include "seam/rules.hpp"

namespace pointfair::cuda {

class Chain {
 public:
  // Stage calls listen to `stop_line` under the numbers of their stages, `first_call` added. Chains that share `room`
  // read neighbourhoods one after the other.
  Chain(Context& context, CollectedRoom& room, MeshOnCard& mesh, StopLine& stop_line, unsigned first_call);
  Chain(const Chain&) = delete;
  Chain& operator=(const Chain&) = delete;

  // `points` on the card, in upload order; they stay there as long as the chain is used.
  void build_index(const Point* points, std::size_t count, const std::optional<Frame>& frame, const Arrival* arrival,
                   std::stop_token stop);
  // Of many clouds at once; stages over lists without the constraint then serve them all.
  void build_index(const Point* points, const CloudBatch& batch, std::stop_token stop);
  // `arriving`: parts of the cloud may not be on the card yet.
  void find_neighbors(const NeighborSettings& settings, bool arriving, std::stop_token stop);
  void estimate_normals(const NormalSettings& settings, std::stop_token stop);
  void fair(const FairingSettings& settings, std::stop_token stop);

  std::uint64_t held_of_boundary();                              // waits for all work
  const SolverReport& solver_report() const { return solver_; }  // of the last fair() by Method::implicit

  bool normals_wait() const { return normals_wait_; }
  // Work that the context's stream gets from now on waits for all parts.
  void join() { overlap_.join(); }
  // Starts normals that still wait for fairing; what comes after waits for all parts.
  void run_waiting_normals(const std::stop_token& stop = {});
  // Lends memory that later stages fill again.
  void set_neighborhoods_aside() {
    run_waiting_normals();
    collector_.set_aside();
  }
  // The parts of faired(). Work behind the last part is done in the order of the context's stream.
  std::vector<FairedPart> faired_parts() const { return overlap_.faired_parts(); }
  // The stream of the stage started last.
  cudaStream_t stream() const { return overlap_.stream(); }

  // Start the work and return before it is done.
  void restore_normals(Point* out);
  void find_outcomes(const point::Region& loaded, unsigned char* out);  // on the card
  void sample_neighborhoods(const RowRequest& request);
  void take_samples(const SampleArrays& samples);
  // The search that find_neighbors() begins with where it measures radii by as many nearest points or fewer. Not at all
  // where memory is short, or the cloud large.
  void foresee_nearest(int count);
  // The tree that samples of many clouds are taken by.
  Tree sampled_tree() {
    join();
    return index_.tree();
  }
  const Point* input() const { return input_; }

  DeviceArray<Point>& faired() { return faired_; }  // in upload order; by parts, or after join()
  // The field of the noise with its nodes on the card; null: 1 everywhere.
  point::NodeField noise_field(const std::shared_ptr<const NoiseLevels>& levels) { return noise_levels_.of(levels); }
  // Where the sensor stood, in memory of the card; null: unknown.
  point::Sensors sensors(const std::shared_ptr<const SensorPlaces>& places);
  CloudState state();                    // runs waiting normals, and waits for all work
  void fetch_state(CloudState* pinned);  // runs waiting normals, and only starts the copy
  std::size_t points() const { return index_.points(); }

 private:
  void begin_index(const Point* points, const std::stop_token& stop);
  void begin_stage(Stage stage, const std::stop_token& stop);
  void pace(const std::stop_token& stop);
  void grow_constrained(const std::stop_token& stop);
  NearestQuery nearest_query() const;
  Retries make_room(DeviceArray<Index>& retries) const;
  void measure_areas();
  void clear(std::size_t first, std::size_t end);  // bytes of the state
  void clear_unmoved();
  Lists lists() const {
    if (neighbors_.mesh && neighbors_.k > 0) return {neighbors_.k, rings_.entries(), rings_.of_leaves()};
    return {neighbors_.k, lists_.data()};
  }
  bool along_mesh() const { return neighbors_.mesh != nullptr; }
  void collect();
  void keep_boundary(const FairingSettings& settings);
  void measure_levels();
  const float* squared_levels() const {
    return neighbors_.levels || index_.tree().settings != nullptr ? squared_level_.data() : nullptr;
  }
  bool shares_further() const {
    return neighbors_.k == 0 && (neighbors_.reach_levels || index_.tree().settings != nullptr);
  }
  const float* further_shares() const { return shares_further() ? further_share_.data() : nullptr; }
  void measure_radii(const std::stop_token& stop);
  void forget_foreseen() {
    foreseen_count_ = 0;
    foreseen_.release();
  }
  void find_all_nearest(int count, DeviceArray<Index>& nearest, const Stop& stop);
  void restore_neighborhoods(const std::stop_token& stop);
  void filter_normals(const std::stop_token& stop);
  void fair_by_parts(point::BilateralWeights weights);
  void fair_by_method(const FairingSettings& settings, AreaWeights areas, const FairedPoints& faired,
                      const std::stop_token& stop);
  float squared_base() const { return pointfair::squared_base(neighbors_.radius); }
  point::Radii radii() const {
    return {squared_radius_.data(),
            squared_base(),
            neighbors_.min_neighbors,
            neighbors_.radius_follows || index_.tree().settings != nullptr ? squared_levels() : nullptr,
            nullptr,
            squared_widest(neighbors_)};
  }
  Surroundings surroundings(const Stop& stop = {}) const {
    return {lists(), radii(), collector_.collected(), stop, along_mesh() && neighbors_.k == 0};
  }
  bool radii_grow() const { return pointfair::radii_grow(neighbors_, normal_settings_); }
  Surroundings grown_surroundings(const Stop& stop = {}) const;  // of the bilateral step
  Normals normals() const;
  bool is_further() const { return first_call_ > 0; }
  Context& context_;
  CollectedRoom& room_;
  MeshOnCard& mesh_;
  StopLine& stop_line_;
  const unsigned first_call_;
  Stop stop_;    // of the last stage call
  Event paced_;  // what was started before the last pace()
  const Point* input_ = nullptr;
  DeviceIndex index_;
  Overlapped overlap_;  // of the index
  NeighborSettings neighbors_;
  NormalSettings normal_settings_;
  FairingSettings fairing_settings_;
  bool normals_wait_ = false;
  bool counts_clear_ = false;   // all that follow the index, as it leaves them
  bool unmoved_clear_ = false;  // those of normals
  DeviceArray<Index> lists_;
  DeviceArray<float> normals_, mean_distance_;
  NodeLevelsOnCard noise_levels_, reach_levels_;
  std::shared_ptr<const SensorPlaces> sensors_;  // whose places are in, if there is one for each point
  DeviceArray<Point> places_;
  DeviceArray<float> squared_level_;   // of the noise, where something follows it
  DeviceArray<float> further_share_;   // of the levels of reach, where there are any
  DeviceArray<float> squared_radius_;  // without lists, as is
  DeviceArray<float> squared_growth_;  // of those, where those of flat places grow
  NeighborCollector collector_;
  RingLists rings_;  // in place of lists, along a mesh
  MeshTables mesh_tables_;
  SortedEdges sorted_edges_;
  DeviceArray<unsigned long long> held_;  // of the boundary, where it keeps its place
  bool areas_measured_ = false;
  DeviceArray<Index> foreseen_;  // the nearest points of each, so many
  int foreseen_count_ = 0;
  DeviceArray<Point> faired_;
  SolverReport solver_;
};

}  // namespace pointfair::cuda
