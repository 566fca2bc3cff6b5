// SPDX-License-Identifier: Apache-2.0
// The CPU backend: the seam's calls over two chains, on its own number of threads.
#include "backend.hpp"

#include <tbb/global_control.h>
#include <tbb/task_arena.h>

#include <algorithm>
#include <atomic>
#include <cstring>
#include <fstream>
#include <limits>
#include <thread>
#include <unordered_map>

#include "cpu/chain.h"
#include "cpu/parallel.h"
#include "cpu/single_search.h"
#include "point/outliers.h"

namespace pointfair {
namespace cpu {
namespace {

constexpr std::size_t kCopyBlock = 1 << 15;
constexpr float kNan = std::numeric_limits<float>::quiet_NaN(), kInfinity = std::numeric_limits<float>::infinity();

unsigned available_threads() { return std::max(1u, std::thread::hardware_concurrency()); }

std::string processor_name() {
  std::ifstream cpuinfo("/proc/cpuinfo");
  for (std::string line; std::getline(cpuinfo, line);)
    if (line.starts_with("model name")) return line.substr(std::min(line.size(), line.find(':') + 2));
  return "CPU";
}

class CpuBackend final : public Backend {
 public:
  explicit CpuBackend(unsigned threads)
      : threads_(threads == 0 ? available_threads() : threads),
        allow_(tbb::global_control::max_allowed_parallelism, std::max(threads_, available_threads())),
        arena_(int(threads_)) {}

  DeviceInfo device() const override {
    return {Device::cpu,
            processor_name() + ", " + std::to_string(threads_) + (threads_ == 1 ? " thread, " : " threads, ") +
                kernels_.name,
            "requested"};
  }

  void upload(std::span<const Point> points) override {
    meter_.reset_peak();
    further_ = Chain(meter_);
    first_.set_whole(nullptr);
    at_work_ = &first_;
    if (upload_is_indexed_) first_.swap_faired(uploaded_);
    upload_is_indexed_ = false;
    points_ = points.size();
    uploaded_.resize((points.size() + kLeafSize - 1) / kLeafSize * kLeafSize);  // as many as faired positions
    arena_.execute([&] {
      for_blocks(points.size(), kCopyBlock, {}, [&](std::size_t first, std::size_t last, std::size_t) {
        std::copy(points.begin() + first, points.begin() + last, uploaded_.data() + first);
      });
    });
  }

  void set_originals(std::span<const Index> originals) override {
    whole_.resize(originals.size());
    std::copy(originals.begin(), originals.end(), whole_.data());
    first_.set_whole(whole_.data());
  }

  void begin_pass(int pass) override {
    if (pass > 1) {  // the second chain gives its result and takes the next pass
      further_.swap_faired(pass_input_);
      pass_input_.resize(further_.index().originals().size());
      pass_originals_.resize(pass_input_.size());
      std::copy_n(further_.index().originals().begin(), pass_originals_.size(), pass_originals_.data());
    }
    if (pass != pass_) located_.clear();
    pass_ = pass;
    at_work_ = pass == 0 ? &first_ : &further_;
  }

  void order_along(std::optional<CurveCube> cube) override { cube_ = cube; }

  void build_index(std::stop_token stop) override {
    located_.clear();
    arena_.execute([&] {
      if (pass_ == 0) {
        build_first_index(stop);
      } else {
        further_.release_small_results();
        const std::span<const Point> input =
            pass_ == 1 ? first_.faired() : std::span<const Point>(pass_input_.data(), further_.index().view().points);
        const std::span<const Index> originals =
            pass_ == 1 ? first_.index().originals()
                       : std::span<const Index>(pass_originals_.data(), pass_originals_.size());
        further_.build_index(input, originals, cube_, space_, kernels_, stop);
        space_.release();
      }
    });
  }
  void find_neighbors(const NeighborSettings& settings, std::stop_token stop) override {
    arena_.execute([&] { at_work_->find_neighbors(settings, kernels_, stop); });
  }
  void estimate_normals(const NormalSettings& settings, std::stop_token stop) override {
    arena_.execute([&] { at_work_->estimate_normals(settings, kernels_, stop); });
  }
  void fair(const FairingSettings& settings, std::stop_token stop) override {
    arena_.execute([&] { at_work_->fair(settings, kernels_, stop); });
  }

  std::uint64_t download(std::span<Point> points, const DisplacementLimits& limits,
                         std::span<std::uint8_t> outliers) override {
    const bool may_miss_some = at_work_ != &first_;  // those that a pass before turned into NaN
    if (may_miss_some) fill(points, Point{kNan, kNan, kNan});
    scatter(points, at_work_->faired());
    for (const InvalidPoint& p : first_.index().invalid()) points[p.original] = p.position;
    std::fill(outliers.begin(), outliers.end(), std::uint8_t(0));
    if (limits.farthest > 0) return hold_back(points, limits, outliers);
    return may_miss_some ? hold_back(points, {kInfinity, kInfinity}, outliers) : 0;
  }

  void download_normals(std::span<Point> normals) override {
    const VectorsView from = at_work_->normals();
    const std::span<const Index> originals = at_work_->index().originals();
    arena_.execute([&] {
      for_blocks(normals.size(), kCopyBlock, {}, [&](std::size_t first, std::size_t last, std::size_t) {
        std::fill(normals.begin() + first, normals.begin() + last, Point{0, 0, 0});
      });
      for_blocks(at_work_->faired().size(), kCopyBlock, {}, [&](std::size_t first, std::size_t last, std::size_t) {
        for (std::size_t i = first; i < last; ++i) normals[originals[i]] = {from.x[i], from.y[i], from.z[i]};
      });
    });
  }

  void outcomes(const point::Region& loaded, std::span<unsigned char> out) override {
    arena_.execute([&] { at_work_->outcomes(loaded, kernels_, out); });
  }

  Bounds bounds() const override { return at_work_->index().bounds(); }

  void sample_neighborhoods(std::span<const std::uint32_t> queries, int k, std::span<Point> out) override {
    std::fill(out.begin(), out.end(), Point{kNan, kNan, kNan});
    arena_.execute([&] {
      locate(queries);
      const IndexView index = at_work_->index().view();
      for_blocks(queries.size(), 4, {}, [&](std::size_t first, std::size_t last, std::size_t) {
        SingleSearch search;
        std::vector<Index> list(std::size_t(k), 0);
        for (std::size_t q = first; q < last; ++q) {
          const Index at_query = located_.at(queries[q]);
          if (at_query == point::kNoNeighbor) continue;
          search.find(index, at_query, k, std::numeric_limits<float>::infinity(), list.data());
          Point* row = out.data() + q * (std::size_t(k) + 1);
          *row++ = {index.x[at_query], index.y[at_query], index.z[at_query]};
          for (const Index at : list)
            if (at != point::kNoNeighbor) *row++ = {index.x[at], index.y[at], index.z[at]};
        }
      });
    });
  }

  void for_each_on_host(std::size_t count, const std::function<void(std::size_t)>& body) override {
    arena_.execute([&] { Backend::for_each_on_host(count, body); });
  }

  Counts counts() const override {
    Counts counts = at_work_->counts();
    counts.unmoved.non_finite = first_.counts().unmoved.non_finite;
    return counts;
  }
  std::uint64_t peak_host_bytes() const override { return meter_.peak; }
  std::uint64_t peak_device_bytes() const override { return 0; }

 private:
  void build_first_index(const std::stop_token& stop) {
    if (upload_is_indexed_) restore_upload();
    first_.build_index({uploaded_.data(), points_}, {}, cube_, space_, kernels_, stop);
    first_.swap_faired(uploaded_);
    upload_is_indexed_ = true;
  }

  // An index that is built anew takes its points from the old one, which holds them all.
  void restore_upload() {
    first_.swap_faired(uploaded_);
    upload_is_indexed_ = false;
    const IndexView index = first_.index().view();
    for_blocks(index.points, kCopyBlock, {}, [&](std::size_t first, std::size_t last, std::size_t) {
      for (std::size_t i = first; i < last; ++i) uploaded_[index.original[i]] = {index.x[i], index.y[i], index.z[i]};
    });
    for (const InvalidPoint& p : first_.index().invalid()) uploaded_[p.original] = p.position;
  }

  void fill(std::span<Point> points, Point value) {
    arena_.execute([&] {
      for_blocks(points.size(), kCopyBlock, {}, [&](std::size_t first, std::size_t last, std::size_t) {
        std::fill(points.begin() + first, points.begin() + last, value);
      });
    });
  }

  void scatter(std::span<Point> out, std::span<const Point> sorted) {
    const std::span<const Index> originals = at_work_->index().originals();
    arena_.execute([&] {
      for_blocks(sorted.size(), kCopyBlock, {}, [&](std::size_t first, std::size_t last, std::size_t) {
        for (std::size_t i = first; i < last; ++i) out[originals[i]] = sorted[i];
      });
    });
  }

  std::uint64_t hold_back(std::span<Point> points, const DisplacementLimits& limits, std::span<std::uint8_t> outliers) {
    const IndexView index = first_.index().view();
    std::atomic<std::uint64_t> total = 0;
    arena_.execute([&] {
      for_blocks(index.points, kCopyBlock, {}, [&](std::size_t first, std::size_t last, std::size_t) {
        std::uint64_t here = 0;
        for (std::size_t i = first; i < last; ++i) {
          Point& p = points[index.original[i]];
          const auto settled = point::settled({index.x[i], index.y[i], index.z[i]}, {p.x, p.y, p.z}, limits.farthest,
                                              limits.outlier_distance);
          p = {settled.place.x, settled.place.y, settled.place.z};
          here += settled.is_outlier;
          if (!outliers.empty()) outliers[index.original[i]] = settled.is_outlier;
        }
        total += here;
      });
    });
    return total;
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
    const std::span<const Index> originals = at_work_->index().originals();
    for_blocks(at_work_->index().view().points, kCopyBlock, {}, [&](std::size_t first, std::size_t last, std::size_t) {
      for (std::size_t i = first; i < last; ++i)
        if (is_wanted[originals[i]]) located_.find(originals[i])->second = Index(i);
    });
  }

  unsigned threads_;
  tbb::global_control allow_;  // more threads than cores, when asked for
  tbb::task_arena arena_;
  const Kernels& kernels_ = best_kernels();
  MemoryMeter meter_;
  std::uint64_t points_ = 0;
  Buffer<Point> uploaded_{meter_};
  Buffer<Index> whole_{meter_};       // indices in the cloud that the uploaded points are a part of
  bool upload_is_indexed_ = false;    // and its memory lent to the first chain
  Buffer<Point> pass_input_{meter_};  // of the passes from the third on, in the order of the pass before
  Buffer<Index> pass_originals_{meter_};
  SortSpace space_{meter_};
  std::optional<CurveCube> cube_;
  Chain first_{meter_}, further_{meter_};
  Chain* at_work_ = &first_;
  int pass_ = 0;
  std::unordered_map<Index, Index> located_;  // upload index to sorted position in the chain at work, as far as asked
};

}  // namespace
}  // namespace cpu

void Backend::for_each_on_host(std::size_t count, const std::function<void(std::size_t)>& body) {
  tbb::parallel_for(std::size_t(0), count, body);
}

std::unique_ptr<Backend> make_cpu_backend(unsigned threads) { return std::make_unique<cpu::CpuBackend>(threads); }

DeviceStatus cpu_status() {
  const cpu::CpuBackend backend(0);
  DeviceStatus status{backend.device(), true, {}};
  status.info.reason = "always available";
  status.details.push_back(std::string("instruction set ") + cpu::best_kernels().name);
  return status;
}

}  // namespace pointfair
