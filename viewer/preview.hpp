// SPDX-License-Identifier: Apache-2.0
// The part of a cloud that shows a change at once: the points about where the user looks, at full density, so that what
// they do is what the whole run will make them do. A small part comes first; if it was quick, a larger one.
// Memory beside the pipeline of the whole cloud: one on about 4,096 points, one on 49,152 and one on 393,216, each from
// its first use on.
#pragma once

#include <array>
#include <cstdint>
#include <functional>
#include <optional>
#include <span>
#include <stop_token>
#include <vector>

#include "pointfair/pointfair.hpp"

namespace pointfair::viewer {

/// Indices of about `size` points nearest to `center`, in the order of the file; all finite ones if there are fewer.
/// `radius` is how far they reach. O(N).
struct Patch {
  std::vector<std::uint32_t> indices;
  float radius = 0;
};
Patch cut_patch(std::span<const Point> points, const Point& center, std::size_t size);

class Preview {
 public:
  using MakePipeline = std::function<Pipeline()>;
  /// The points within `radius` of `center`, by index in the cloud, and where they go.
  struct Result {
    Point center;
    float radius = 0;
    std::vector<std::uint32_t> indices;
    std::vector<Point> after;
    double milliseconds = 0;
    bool more = false;  ///< a larger part follows that is worth waiting for
  };
  using Show = std::function<void(const Result&)>;

  explicit Preview(MakePipeline make) : make_(std::move(make)) {}

  /// Forgets the cloud.
  void reset();

  /// Fairs parts of `points` about `center` with `params`, which hold no `auto`, and shows each as it is done.
  /// `spacing` is that of the whole cloud. Throws what Pipeline::run throws.
  void run(std::span<const Point> points, const Point& center, const Params& params, double spacing,
           std::stop_token stop, const Show& show);
  /// Where the sensor stood, relative to the cloud's origin, as Pipeline::set_viewpoint takes it. After reset().
  void set_viewpoint(std::vector<Position> viewpoints) { viewpoints_ = std::move(viewpoints); }

 private:
  struct Part {
    std::size_t size;
    std::optional<Pipeline> pipeline;
    Patch patch;
    Point center{};
    std::vector<Point> before, after;
  };
  void aim(Part& part, std::span<const Point> points, const Point& center);
  bool is_next(std::size_t part, double milliseconds, std::size_t done, std::size_t points) const;
  Result run_part(Part& part, const Params& params, double spacing, std::stop_token stop);

  MakePipeline make_;
  std::vector<Position> viewpoints_;
  std::array<Part, 3> parts_{Part{4096, {}, {}, {}, {}, {}}, Part{49152, {}, {}, {}, {}, {}},
                             Part{393216, {}, {}, {}, {}, {}}};
};

}  // namespace pointfair::viewer
