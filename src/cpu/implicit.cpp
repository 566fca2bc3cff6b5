// SPDX-License-Identifier: Apache-2.0
#include "cpu/implicit.h"

#include <cmath>
#include <vector>

#include "cpu/ordered_sum.h"
#include "cpu/volume.h"

namespace pointfair::cpu {
namespace {

using Vec = point::Place;

Vec place(const IndexView& index, std::size_t i) { return {index.x[i], index.y[i], index.z[i]}; }

struct Sums : point::SquaresLeft {
  Sums& operator+=(const point::SquaresLeft& more) {
    plain = plain + more.plain;
    by_diagonal = by_diagonal + more.by_diagonal;
    return *this;
  }
};
struct Sum : Vec {
  Sum& operator+=(const Vec& more) {
    static_cast<Vec&>(*this) = *this + more;
    return *this;
  }
};

// The walk over the rows of point::Gradients.
class ConjugateGradients {
 public:
  ConjugateGradients(const WeightedGraph& graph, double lambda, const std::stop_token& stop)
      : points_(graph.points()),
        stop_(stop),
        found_(points_),
        rest_(points_),
        way_(points_),
        image_(points_),
        rows_{graph.view(), lambda, found_.data(), rest_.data(), way_.data(), image_.data()} {}

  SolverReport solve(const IndexView& index) {
    const auto place_of = [&](Index i) { return place(index, i); };
    Sums left = sum<Sums>([&](Index i) { return rows_.start(i, place_of); });
    const Vec whole = left.plain;
    SolverReport report;
    while (point::squared_residual(left.plain, whole) > point::kSolverResidual * point::kSolverResidual &&
           report.iterations < std::uint64_t(point::kSolverIterations)) {
      const Vec step = point::quotient(left.by_diagonal, sum<Sum>([&](Index i) { return rows_.multiply(i); }));
      const Sums next = sum<Sums>([&](Index i) { return rows_.advance(i, step); });
      turn(point::quotient(next.by_diagonal, left.by_diagonal));
      left = next;
      ++report.iterations;
    }
    report.residual = std::sqrt(point::squared_residual(left.plain, whole));
    return report;
  }
  std::vector<Vec>& displacements() { return found_; }

 private:
  template <class Total, class Of>
  Total sum(const Of& of) const {
    return ordered_sum<Total>(points_, stop_, [&](std::size_t i, Total& here) { here += of(Index(i)); });
  }
  void turn(const Vec& share) const {
    for_blocks(points_, kSumBlock, stop_, [&](std::size_t first, std::size_t last, std::size_t) {
      for (std::size_t i = first; i < last; ++i) rows_.turn(Index(i), share);
    });
  }

  std::size_t points_;
  const std::stop_token& stop_;
  std::vector<Vec> found_, rest_, way_, image_;
  point::Gradients rows_;
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
      const point::Vec3<float> to = point::end_of(place(index, i), strength, displacements[i]);
      out[i] = {to.x, to.y, to.z};
    }
  });
  return report;
}

}  // namespace pointfair::cpu
