// SPDX-License-Identifier: Apache-2.0
// What one neighbourhood says of the noise: how far its points lie off a cubic over their plane (Eq. 8 of
// docs/how-it-works.md).
#pragma once

#include <array>
#include <cmath>
#include <cstddef>
#include <span>
#include <vector>

#include "point/vec.h"

namespace pointfair {

using Offset = point::Vec3<double>;  // of a neighbour from its query
inline double length(Offset o) { return std::sqrt(point::dot(o, o)); }

inline constexpr std::size_t kLargestFit = 600;  // points

// The nearest points of a query, first few of them and then more.
class GrowingNeighborhood {
 public:
  // `nearest` first, 4 at least, kept by reference.
  explicit GrowingNeighborhood(std::span<const Offset> nearest) : nearest_(nearest) {}

  // Looks at the first n, 4 <= n <= kLargestFit and never fewer than before. O(n).
  void grow_to(std::size_t n);

  // Enough points of the query's own sheet, and neither along a line nor in one place: there the residuals of a cubic
  // are no noise.
  bool shows_a_surface() const { return is_surface_ && has_enough(); }
  // Against the noise.
  bool is_wide() const;
  // Between the two sheets of a thin part that these points belong to; 0 where there is one.
  double gap() const { return gap_; }
  // Side of the square that holds one point of the sheet.
  double spacing() const;
  // Standard deviation of the own sheet's heights over their cubic. Only of what shows a surface. O(n), 60 n products.
  double noise() const;

 private:
  struct Frame {
    Offset centroid;
    std::array<Offset, 3> axes;  // by falling eigenvalue: the last is the normal
    double least_eigenvalue;     // variance along the normal
  };
  // First and second moments of offsets from the query. It lies among them, so little is lost when the mean is taken
  // off at the end, and a neighbourhood that grows adds its new points only.
  class Moments {
   public:
    void add(Offset o);
    Frame frame(std::size_t count) const;

   private:
    Offset first_{0, 0, 0};
    std::array<double, 6> second_{};
  };
  class CubicFit;

  static Frame principal_frame(Offset centroid, double (&m)[3][3]);
  void find_own_sheet();
  bool has_enough() const;

  std::span<const Offset> nearest_;
  std::size_t count_ = 0;
  Moments moments_;  // of all `count_`
  double radius_ = 0;
  bool is_surface_ = false;
  double gap_ = 0;
  std::vector<Offset> sheet_;    // the query's, where there are two
  std::span<const Offset> own_;  // `sheet_`, or all
  Frame frame_{};                // of the own ones
};

}  // namespace pointfair
