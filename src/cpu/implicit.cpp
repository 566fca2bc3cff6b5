// SPDX-License-Identifier: Apache-2.0
#include "cpu/implicit.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <utility>
#include <vector>

#include "cpu/ordered_sum.h"
#include "cpu/volume.h"

namespace pointfair::cpu {
namespace {

using Vec = point::Vec3<double>;

Vec scaled(const Vec& a, const Vec& b) { return {a.x * b.x, a.y * b.y, a.z * b.z}; }

struct Sums {
  Vec first{}, second{};
  Sums& operator+=(const Sums& more) {
    first = first + more.first;
    second = second + more.second;
    return *this;
  }
};

// a / b of each coordinate; 0 where b is, so that a coordinate that is solved stays.
Vec quotient(const Vec& a, const Vec& b) {
  const auto of = [](double x, double y) { return y > 0 ? x / y : 0; };
  return {of(a.x, b.x), of(a.y, b.y), of(a.z, b.z)};
}

// (M + lambda S) d = -lambda S b of Eq. 28, for displacements d of those points that have a mass. The coordinates are
// three systems with one matrix, which has no more of a place of its own than the weights of the graph.
class ConjugateGradients {
 public:
  ConjugateGradients(const WeightedGraph& graph, double lambda, const std::stop_token& stop)
      : graph_(graph), lambda_(lambda), stop_(stop), found_(graph.points()), rest_(graph.points()) {}

  SolverReport solve(const IndexView& index) {
    const Sums begin = start(index);
    const Vec whole = begin.first;
    Vec left = whole, weighted = begin.second;
    SolverReport report;
    while (largest(quotient(left, whole)) > kSolverResidual * kSolverResidual &&
           report.iterations < std::uint64_t(kSolverIterations)) {
      const Vec step = quotient(weighted, multiply());
      const Sums next = advance(step);
      turn(quotient(next.second, weighted));
      left = next.first;
      weighted = next.second;
      ++report.iterations;
    }
    report.residual = std::sqrt(largest(quotient(left, whole)));
    return report;
  }
  std::vector<Vec>& displacements() { return found_; }

 private:
  static double largest(const Vec& v) { return std::max({v.x, v.y, v.z}); }
  bool stays(std::size_t i) const { return !(graph_.mass[i] > 0); }
  double inverse_diagonal(std::size_t i) const { return 1 / (graph_.mass[i] + lambda_ * graph_.weight_sum[i]); }

  // Returns the squares of what is left, plain and by the diagonal.
  Sums start(const IndexView& index) {
    way_.resize(graph_.points());
    image_.resize(graph_.points());
    return ordered_sum<Sums>(graph_.points(), stop_, [&](std::size_t i, Sums& sums) {
      if (stays(i)) return;
      const Vec here{index.x[i], index.y[i], index.z[i]};
      Vec sum{};
      for (const auto& [there, weight] : graph_.row(i))
        sum = sum + double(weight) * (Vec{index.x[there], index.y[there], index.z[there]} - here);
      rest_[i] = lambda_ * sum;
      way_[i] = inverse_diagonal(i) * rest_[i];
      sums.first = sums.first + scaled(rest_[i], rest_[i]);
      sums.second = sums.second + scaled(rest_[i], way_[i]);
    });
  }

  // The image of the way, and its product with the way.
  Vec multiply() {
    const Sums sums = ordered_sum<Sums>(graph_.points(), stop_, [&](std::size_t i, Sums& here) {
      if (stays(i)) return;
      const Vec own = way_[i];
      Vec sum{};
      for (const auto& [there, weight] : graph_.row(i)) sum = sum + double(weight) * (own - way_[there]);
      image_[i] = graph_.mass[i] * own + lambda_ * sum;
      here.first = here.first + scaled(own, image_[i]);
    });
    return sums.first;
  }

  Sums advance(const Vec& step) {
    return ordered_sum<Sums>(graph_.points(), stop_, [&](std::size_t i, Sums& sums) {
      if (stays(i)) return;
      found_[i] = found_[i] + scaled(step, way_[i]);
      rest_[i] = rest_[i] - scaled(step, image_[i]);
      const Vec squared = scaled(rest_[i], rest_[i]);
      sums.first = sums.first + squared;
      sums.second = sums.second + inverse_diagonal(i) * squared;
    });
  }

  void turn(const Vec& share) {
    for_blocks(graph_.points(), kSumBlock, stop_, [&](std::size_t first, std::size_t last, std::size_t) {
      for (std::size_t i = first; i < last; ++i)
        if (!stays(i)) way_[i] = inverse_diagonal(i) * rest_[i] + scaled(share, way_[i]);
    });
  }

  const WeightedGraph& graph_;
  double lambda_;
  const std::stop_token& stop_;
  std::vector<Vec> found_, rest_, way_, image_;
};

void hold_boundary(const MeshEdges& mesh, const IndexView& index, WeightedGraph& graph) {
  for (std::size_t i = 0; i < graph.points(); ++i)
    if (mesh.is_on_boundary(index.original[i])) graph.mass[i] = 0;
}

// Points at the place of a vertex go with it.
void follow_vertices(const MeshEdges& mesh, const IndexView& index, std::vector<Vec>& displacements) {
  const std::vector<Index> at = sorted_positions(index, mesh);
  for (std::size_t i = 0; i < displacements.size(); ++i) {
    const Index its = at[mesh.vertex[index.original[i]]];
    if (its != point::kNoNeighbor) displacements[i] = displacements[its];
  }
}

}  // namespace

SolverReport fair_implicitly(const GraphSource& source, const FairingSettings& settings, std::span<Point> out,
                             const std::stop_token& stop) {
  const IndexView& index = source.index;
  WeightedGraph graph = weighted_graph(source, settings, stop);
  if (settings.kept_boundary) hold_boundary(*settings.kept_boundary, index, graph);
  ConjugateGradients solver(graph, settings.implicit_lambda * graph.unit, stop);
  const SolverReport report = solver.solve(index);
  std::vector<Vec>& displacements = solver.displacements();
  if (source.mesh != nullptr) {
    if (source.mesh->encloses) keep_volumes(source, displacements);
    follow_vertices(*source.mesh, index, displacements);
  }
  const double strength = settings.strength;
  for_blocks(index.points, kSumBlock, stop, [&](std::size_t first, std::size_t last, std::size_t) {
    for (std::size_t i = first; i < last; ++i) {
      const Vec to = Vec{index.x[i], index.y[i], index.z[i]} + strength * displacements[i];
      out[i] = {float(to.x), float(to.y), float(to.z)};
    }
  });
  return report;
}

}  // namespace pointfair::cpu
