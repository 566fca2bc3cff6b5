// SPDX-License-Identifier: Apache-2.0
// The CPU backend: the seam's calls over two chains, on its own number of threads.
#include "seam/backend.hpp"

#include <tbb/task_arena.h>

#include <algorithm>
#include <atomic>
#include <fstream>
#include <limits>
#include <thread>
#include <unordered_map>
#include <vector>

#include "cpu/chain.h"
#include "cpu/parallel.h"
#include "cpu/single_search.h"
#include "platform/many_threads.hpp"
#include "platform/process.hpp"
#include "point/outliers.h"
#include "seam/cloud_sample.hpp"
#include "seam/exactness.hpp"
#include "seam/noise_levels.hpp"
#include "seam/outlier_tally.hpp"

namespace pointfair {
namespace cpu {
namespace {

constexpr std::size_t kCopyBlock = 1 << 15;
constexpr float kNan = std::numeric_limits<float>::quiet_NaN(), kInfinity = std::numeric_limits<float>::infinity();

unsigned available_threads() { return std::max(1u, std::thread::hardware_concurrency()); }

void prefetch(std::span<Point> points, std::span<const Index> originals, std::size_t sorted) {
  const std::size_t ahead = sorted + kPrefetchedAhead;
  if (ahead < originals.size() && originals[ahead] < points.size()) __builtin_prefetch(&points[originals[ahead]], 1);
}

class CpuBackend final : public Backend, public Sampling, public Exactness {
 public:
  explicit CpuBackend(unsigned threads)
      : threads_(threads == 0 ? available_threads() : threads), arena_(int(threads_)) {
    platform::allow_many_threads();
  }

  DeviceInfo device() const override {
    return {Device::cpu,
            platform::processor_name() + ", " + std::to_string(threads_) +
                (threads_ == 1 ? " thread, " : " threads, ") + kernels_.name,
            "requested"};
  }

  void upload(std::span<const Point> points, IndexOrder) override {
    meter_.reset_peak();
    further_ = Chain(meter_);
    further_iteration_ = 0;
    lost_.clear();
    located_.clear();
    if (upload_is_indexed_) first_.swap_faired(uploaded_);
    upload_is_indexed_ = false;
    copies_.clear();
    points_ = points.size();
    make_room_for_upload();
    for_copies(points.size(), [&](std::size_t first, std::size_t last) {
      std::copy(points.begin() + first, points.begin() + last, uploaded_.data() + first);
    });
  }

  void set_aside(std::vector<Copy> copies) override {
    further_ = Chain(meter_);
    further_iteration_ = 0;
    lost_.clear();
    located_.clear();
    if (upload_is_indexed_) restore_upload();
    for (const Copy& copy : copies_) uploaded_[copy.point] = copy.place;
    copies_ = std::move(copies);
    for (const Copy& copy : copies_) uploaded_[copy.point] = {kNan, kNan, kNan};
  }

  void build_index(int iteration, const std::optional<Frame>& frame, std::stop_token stop) override {
    arena_.execute([&] {
      if (iteration == 0) {
        build_first_index(frame, stop);
      } else {
        build_further_index(iteration, frame, stop);
      }
    });
  }
  void find_neighbors(int iteration, const NeighborSettings& settings, std::stop_token stop) override {
    arena_.execute([&] { chain(iteration).find_neighbors(settings, kernels_, stop); });
  }
  void estimate_normals(int iteration, const NormalSettings& settings, std::stop_token stop) override {
    arena_.execute([&] { chain(iteration).estimate_normals(settings, kernels_, stop); });
  }
  void fair(int iteration, const FairingSettings& settings, std::stop_token stop) override {
    arena_.execute([&] { chain(iteration).fair(settings, kernels_, stop); });
    solved_.resize(std::size_t(iteration) + 1);
    solved_.back() = chain(iteration).solver_report();
  }

  OutlierCounts download(int iteration, std::span<Point> points, const DisplacementLimits& limits,
                         std::span<std::uint8_t> outliers) override {
    const Chain& from = chain(iteration);
    const bool may_miss_some = iteration > 0;  // those that an iteration before turned into NaN
    for (const Lost& lost : lost_)
      if (lost.before <= iteration) points[lost.point.original] = lost.point.position;
    const std::span<const Point> faired = from.faired();
    const std::span<const Index> originals = from.index().originals();
    for_copies(faired.size(), [&](std::size_t first, std::size_t last) {
      for (std::size_t i = first; i < last; ++i) {
        prefetch(points, originals, i);
        points[originals[i]] = faired[i];
      }
    });
    for (const InvalidPoint& p : first_.index().invalid()) points[p.original] = p.position;
    follow<Point>(copies_, points);
    std::ranges::fill(outliers, std::uint8_t(0));
    if (limits.farthest > 0) return hold_back(points, limits, outliers);
    return may_miss_some ? hold_back(points, limits.or_endless(), outliers) : OutlierCounts{};
  }

  void download_normals(int iteration, std::span<Point> normals, std::stop_token) override {
    const Chain& from = chain(iteration);
    const VectorsView vectors = from.normals();
    const std::span<const Index> originals = from.index().originals();
    fill(normals, Point{0, 0, 0});
    for_copies(from.faired().size(), [&](std::size_t first, std::size_t last) {
      for (std::size_t i = first; i < last; ++i) {
        prefetch(normals, originals, i);
        normals[originals[i]] = {vectors.x[i], vectors.y[i], vectors.z[i]};
      }
    });
    follow<Point>(copies_, normals);
  }
  void download_input(std::span<Point> points) override {
    if (!upload_is_indexed_) {
      for_copies(points.size(), [&](std::size_t first, std::size_t last) {
        std::copy(uploaded_.data() + first, uploaded_.data() + last, points.begin() + std::ptrdiff_t(first));
      });
    } else {
      from_index(points);
    }
    for (const Copy& copy : copies_) points[copy.point] = copy.place;
  }

  Counts counts(int iteration) override {
    Counts counts = chain(iteration).counts();
    counts.unmoved.non_finite = first_.counts().unmoved.non_finite - copies_.size();
    add_copies(copies_, points_, counts, [&](std::span<unsigned char> outcomes) {
      arena_.execute([&] { chain(iteration).outcomes(kEverywhere, kernels_, outcomes); });
    });
    return counts;
  }
  Costs take_costs() override { return {{}, meter_.peak, 0, 1}; }

  SolverReport solver_report(int iteration) override { return sum_of(solved_, iteration); }

  bool holds_whole() const override { return true; }
  bool reads_faces() const override { return true; }
  Sampling& sampling() override { return *this; }
  Exactness* exactness() override { return this; }

  CloudSample sample_cloud(std::size_t count) override {
    const ForEach for_each = on_host();
    if (!upload_is_indexed_) {
      const auto uploaded = [this](std::size_t i) { return std::pair(uploaded_[i], std::uint32_t(i)); };
      return sample_points(points_, uploaded, count, for_each);
    }
    const IndexView index = first_.index().view();
    const auto sorted = [&index](std::size_t i) {
      return std::pair(Point{index.x[i], index.y[i], index.z[i]}, index.original[i]);
    };
    return sample_points(index.points, sorted, count, for_each);
  }

  void sample_neighborhoods(std::span<const std::uint32_t> queries, int k, std::span<Point> out) override {
    std::ranges::fill(out, Point{kNan, kNan, kNan});
    arena_.execute([&] {
      locate(queries);
      const IndexView index = first_.index().view();
      for_blocks(queries.size(), 4, {}, [&](std::size_t first, std::size_t last, std::size_t) {
        SingleSearch search(kernels_);
        std::vector<Index> list(std::size_t(k), 0);
        for (std::size_t q = first; q < last; ++q) {
          const Index at_query = located_.at(queries[q]);
          if (at_query == point::kNoNeighbor) continue;
          search.find(index, at_query, k, kInfinity, list.data());
          Point* row = out.data() + q * (std::size_t(k) + 1);
          *row++ = {index.x[at_query], index.y[at_query], index.z[at_query]};
          for (const Index at : list)
            if (at != point::kNoNeighbor) *row++ = {index.x[at], index.y[at], index.z[at]};
        }
      });
    });
  }

  void for_each_on_host(std::size_t count, const std::function<void(std::size_t)>& body) override {
    arena_.execute([&] { Sampling::for_each_on_host(count, body); });
  }

  void outcomes(const point::Region& loaded, std::span<unsigned char> out) override {
    arena_.execute([&] { first_.outcomes(loaded, kernels_, out); });
    follow(copies_, out);
  }

 private:
  Chain& chain(int iteration) {
    if (iteration == 0) return first_;
    if (iteration != further_iteration_)
      throw Error(ErrorKind::failed, "the results of iteration " + std::to_string(iteration) + " are not held");
    return further_;
  }

  void build_first_index(const std::optional<Frame>& frame, const std::stop_token& stop) {
    located_.clear();
    if (upload_is_indexed_) restore_upload();
    first_.build_index({uploaded_.data(), std::size_t(points_)}, {}, frame, space_, kernels_, stop);
    first_.swap_faired(uploaded_);
    upload_is_indexed_ = true;
  }

  // As many as faired positions.
  void make_room_for_upload() { uploaded_.resize((std::size_t(points_) + kLeafSize - 1) / kLeafSize * kLeafSize); }

  // An index that is built anew takes its points from the old one, which holds them all. The chain may give other
  // memory than it got, which has room for the valid points alone.
  void restore_upload() {
    first_.swap_faired(uploaded_);
    make_room_for_upload();
    upload_is_indexed_ = false;
    from_index({uploaded_.data(), std::size_t(points_)});
  }
  // In upload order.
  void from_index(std::span<Point> points) {
    const IndexView index = first_.index().view();
    for_copies(index.points, [&](std::size_t first, std::size_t last) {
      for (std::size_t i = first; i < last; ++i) points[index.original[i]] = {index.x[i], index.y[i], index.z[i]};
    });
    for (const InvalidPoint& p : first_.index().invalid()) points[p.original] = p.position;
  }

  void build_further_index(int iteration, const std::optional<Frame>& frame, const std::stop_token& stop) {
    if (iteration == 1) {
      further_iteration_ = 1;
      further_.release_small_results();
      further_.build_index(first_.faired(), first_.index().originals(), frame, space_, kernels_, stop);
    } else {
      if (iteration != further_iteration_) take_input_of(iteration);
      further_.release_small_results();
      further_.build_index({input_.data(), input_.size()}, {input_originals_.data(), input_originals_.size()}, frame,
                           space_, kernels_, stop);
    }
    space_.release();
    std::erase_if(lost_, [&](const Lost& lost) { return lost.before >= iteration; });
    for (const InvalidPoint& p : further_.index().invalid()) lost_.push_back({iteration, p});
  }
  // The further chain gives its faired points, and takes the next iteration.
  void take_input_of(int iteration) {
    Chain& before = chain(iteration - 1);
    const std::span<const Index> originals = before.index().originals().first(before.faired().size());
    input_originals_.resize(originals.size());
    std::ranges::copy(originals, input_originals_.data());
    before.swap_faired(input_);
    input_.resize(originals.size());  // without the padding
    further_iteration_ = iteration;
  }

  template <class Body>
  void for_copies(std::size_t count, const Body& body) {
    arena_.execute([&] {
      for_blocks(count, kCopyBlock, {}, [&](std::size_t first, std::size_t last, std::size_t) { body(first, last); });
    });
  }
  void fill(std::span<Point> points, Point value) {
    for_copies(points.size(), [&](std::size_t first, std::size_t last) {
      std::fill(points.begin() + first, points.begin() + last, value);
    });
  }

  OutlierCounts hold_back(std::span<Point> points, const DisplacementLimits& limits, std::span<std::uint8_t> outliers) {
    const IndexView index = first_.index().view();
    const point::NodeField field = field_of(limits.levels.get());
    OutlierTally tally;
    const auto hold_back_one = [&](Index original, point::Vec3<float> from, OutlierCounts& here) {
      Point& p = points[original];
      const auto limited = point::limited(from, {p.x, p.y, p.z}, limits, point::node_value(field, from));
      p = {limited.place.x, limited.place.y, limited.place.z};
      count(limited.outlier, here);
      if (!outliers.empty()) outliers[original] = static_cast<std::uint8_t>(limited.outlier);
    };
    for_copies(index.points, [&](std::size_t first, std::size_t last) {
      OutlierCounts here;
      for (std::size_t i = first; i < last; ++i) {
        prefetch(points, first_.index().originals(), i);
        hold_back_one(index.original[i], {index.x[i], index.y[i], index.z[i]}, here);
      }
      tally.add(here);
    });
    OutlierCounts of_copies;
    for (const Copy& copy : copies_) hold_back_one(copy.point, to_vec3(copy.place), of_copies);
    tally.add(of_copies);
    return tally.counts();
  }

  // Finds the sorted positions of those queries that are not known yet. One sweep over the cloud, so samples are best
  // taken of the same points again.
  void locate(std::span<const std::uint32_t> queries) {
    std::vector<bool> is_wanted(points_, false);
    bool any_new = false;
    for (const std::uint32_t query : queries) {
      if (!located_.try_emplace(query, point::kNoNeighbor).second) continue;
      is_wanted[query] = any_new = true;
    }
    if (!any_new) return;
    const std::span<const Index> originals = first_.index().originals();
    for_items(first_.index().view().points, kCopyBlock, {}, [&](std::size_t i) {
      if (is_wanted[originals[i]]) located_.find(originals[i])->second = Index(i);
    });
  }

  unsigned threads_;
  tbb::task_arena arena_;
  const Kernels& kernels_ = best_kernels();
  MemoryMeter meter_;
  std::uint64_t points_ = 0;
  Buffer<Point> uploaded_{meter_};
  bool upload_is_indexed_ = false;  // then the memory of the upload is lent to the first chain
  std::vector<Copy> copies_;        // that are set aside; NaN in what is indexed
  Buffer<Point> input_{meter_};     // of iterations from the third on, in the order of the iteration before
  Buffer<Index> input_originals_{meter_};
  SortSpace space_{meter_};
  Chain first_{meter_}, further_{meter_};
  int further_iteration_ = 0;  // the iteration whose results further_ holds; 0: none
  // Outliers, which are NaN from some iteration on, in the form of invalid points of that iteration's index.
  struct Lost {
    int before;
    InvalidPoint point;
  };
  std::vector<Lost> lost_;
  std::vector<SolverReport> solved_;          // of each iteration
  std::unordered_map<Index, Index> located_;  // upload index to sorted position, of the points that were asked for
};

}  // namespace
}  // namespace cpu

std::unique_ptr<Backend> make_cpu_backend(unsigned threads) { return std::make_unique<cpu::CpuBackend>(threads); }

DeviceStatus cpu_status() {
  const cpu::CpuBackend backend(0);
  DeviceStatus status{backend.device(), true, {}};
  status.info.reason = "always available";
  status.details.push_back(std::string("instruction set ") + cpu::best_kernels().name);
  return status;
}

}  // namespace pointfair
