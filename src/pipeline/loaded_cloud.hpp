// SPDX-License-Identifier: Apache-2.0
// A cloud on a backend: on one device; or on one card that shares its stages with others; or, where the memory of cards
// does not suffice, in host memory and in tiles on all cards; or, for runs that no card can do, on the CPU.
#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <span>
#include <stop_token>
#include <vector>

#include "estimate/estimate.hpp"
#include "pipeline/plan.hpp"
#include "seam/device_memory.hpp"
#include "tiles/choice.hpp"
#include "tiles/tiled_backend.hpp"

namespace pointfair {

using MakeBackend = std::function<std::unique_ptr<Backend>()>;

// Points that stages do not see, and that get what others have: the copies that were found; along a mesh, of each
// vertex all points but its first; of each place all points but one.
enum class Aside { nothing, copies, seams, repeats };

// What computes tiles.
struct MakeWorkers {
  std::vector<MakeBackend> of_cards{};  // one each; none: a cloud that does not fit is an error
  std::uint64_t worth_dividing = Cards{}.worth_dividing;
  MakeBackend on_cpu{};  // for runs that a card cannot do; null: such a run is an error
};

class LoadedCloud {
 public:
  // `backend` is that of the first card.
  LoadedCloud(std::unique_ptr<Backend> backend, MakeWorkers workers)
      : backend_(std::move(backend)), workers_(std::move(workers)) {}

  // Takes the place of the cloud before. Afterwards, also if it throws, nothing is cached; if it throws, no cloud is
  // held. `overlapped`: the upload may go on, and `points` must stay, until finish_load().
  void load(std::span<const Point> points, IndexOrder expected, bool overlapped = false);
  void finish_load() noexcept;
  // The same of points in the memory of the device; returns their origin. Throws Error(usage) where the backend
  // computes elsewhere.
  Origin load(const DevicePoints& points, DeviceStream stream, IndexOrder expected);

  // Does `work`; where the device's memory does not suffice, again with the cloud in tiles, nothing cached.
  void within_memory(const std::function<void()>& work);

  // Goes on with the same points on the CPU, nothing cached, until another cloud is loaded. False where it may not.
  bool move_to_cpu();
  bool is_on_cpu() const { return is_on_cpu_; }

  // Another backend of the same kind; null where none can be made.
  std::unique_ptr<Backend> make_worker() const {
    return workers_.of_cards.empty() ? nullptr : workers_.of_cards.front()();
  }
  Backend& backend();  // throws Error(device) if the device was lost for good
  std::uint64_t points() const { return points_; }

  // Finds the copies by the rule, and the sample of the cloud without them; `times` as CopiesFound::points.
  void find_copies(const CopyRule& rule, double times, const std::stop_token& stop);
  // Finds the points at one place, unless this was done. `corner`: as in CopyRule.
  void find_repeats(const Point& corner, const std::stop_token& stop);
  // Of a mesh over the points.
  void keep_seams(std::vector<Copy> seams) { seams_ = std::move(seams); }
  // What was found or kept before; nothing is cached after a change.
  void set_aside(Aside which);
  Aside aside() const { return aside_; }
  std::span<const Copy> copies_aside() const;

  Cached cached;
  // Measured once, of the cloud as loaded; null: not yet.
  std::optional<CloudSample> sample;
  std::optional<Spacing> spacing;
  std::optional<CopiesFound> copies;  // with the noise, which is of the cloud without them, as the next two
  std::optional<CloudSample> sample_without_copies;
  std::optional<Spacing> spacing_without_copies;
  std::optional<Noise> noise;
  std::shared_ptr<const NoiseLevels> levels;       // with the noise, as the next; null: 1 everywhere
  std::shared_ptr<const NodeLevels> reach_levels;  // of NeighborSettings
  KnownSensor sensor;                              // found with the noise

 private:
  void forget();
  void replace(std::uint64_t points, const std::function<void()>& upload);
  void drop() noexcept;
  void reset() noexcept;
  void carry_over(const std::function<void()>& make);
  void upload(std::span<const Point> points, IndexOrder expected, bool overlapped);
  // Of the cloud's points, which `points` gets.
  std::vector<Copy> copies_by(const CopyRule& rule, std::span<Point> points, const std::stop_token& stop);
  Cards cards() const { return {workers_.of_cards.size(), workers_.worth_dividing}; }
  std::uint64_t tiles_after(const Error& error) const;
  void hold(std::uint64_t points);
  bool divide();
  void cut_into(std::uint64_t tiles);

  std::unique_ptr<Backend> backend_;  // null: must be made again
  TiledBackend* tiled_ = nullptr;     // the same, if it computes tiles of a cloud in host memory
  bool is_divided_ = false;           // whether several devices share what lies on the first
  bool is_on_cpu_ = false;            // whether it was moved there
  Aside aside_ = Aside::nothing;
  std::vector<Copy> copies_, seams_;
  std::optional<std::vector<Copy>> repeats_;
  MakeWorkers workers_;
  std::uint64_t points_ = 0;
  std::uint64_t tiles_ = 1;  // that the backend was asked to cut the cloud into
};

}  // namespace pointfair
