// SPDX-License-Identifier: Apache-2.0
#include "cpu/implicit.h"

#include <cmath>
#include <numeric>
#include <vector>

#include "cpu/ordered_sum.h"
#include "portable.hpp"

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
    for_items(points_, kSumBlock, stop_, [&](std::size_t i) { rows_.turn(Index(i), share); });
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

// Connected parts of a mesh, each named by one of its vertices.
class Parts {
 public:
  explicit Parts(std::size_t points) : parent_(points) { std::iota(parent_.begin(), parent_.end(), 0u); }
  Index of(Index i) {
    while (parent_[i] != i) i = parent_[i] = parent_[parent_[i]];
    return i;
  }
  void join(Index a, Index b) {
    a = of(a), b = of(b);
    parent_[std::max(a, b)] = std::min(a, b);  // the name does not depend on the order
  }

 private:
  std::vector<Index> parent_;
};

struct Part {
  Vec sum{};
  double count = 0, before = 0, after = 0;  // volumes
  double factor = 1;
  Vec center() const { return (1 / count) * sum; }
};

double volume_under(const Vec& a, const Vec& b, const Vec& c) { return dot(a, cross(b, c)) / 6; }

// Keeps the volume that a closed mesh encloses (Desbrun 1999): scales each connected part of the mesh, once displaced,
// about the mean of its vertices, so that it encloses the volume that it had. A part whose volume has vanished or
// changed its sign stays as it is. `source.faces` enclose a volume; displacements are in sorted order, and those of
// points that are no vertex are not read.
void keep_volumes(const GraphSource& source, std::vector<Vec>& displacements) {
  const IndexView& index = source.index;
  const std::vector<Index> at = sorted_positions(index, *source.mesh);
  const MeshFaces& faces = *source.faces;
  Parts parts(index.points);
  std::vector<bool> is_vertex(index.points);
  for (std::size_t f = 0; f < faces.size(); ++f)
    for (const std::uint32_t corner : faces.of(f)) {
      const Index i = at[corner], first = at[faces.of(f).front()];
      if (i == point::kNoNeighbor || first == point::kNoNeighbor) return;  // a hole where an outlier was
      is_vertex[i] = true;
      parts.join(first, i);
    }
  const auto moved = [&](Index i) { return place(index, i) + displacements[i]; };
  std::vector<Part> of_parts(index.points);
  for (Index i = 0; i < index.points; ++i)
    if (is_vertex[i]) {
      Part& part = of_parts[parts.of(i)];
      part.sum = part.sum + moved(i);
      ++part.count;
    }
  for (std::size_t f = 0; f < faces.size(); ++f) {
    const auto corners = faces.of(f);
    const Index first = at[corners[0]];
    Part& part = of_parts[parts.of(first)];
    const Vec center = part.center();
    for (std::size_t c = 2; c < corners.size(); ++c) {
      const Index second = at[corners[c - 1]], third = at[corners[c]];
      part.before +=
          volume_under(place(index, first) - center, place(index, second) - center, place(index, third) - center);
      part.after += volume_under(moved(first) - center, moved(second) - center, moved(third) - center);
    }
  }
  for (Part& part : of_parts)
    if (part.before / part.after > 0 && std::isfinite(part.before / part.after))
      part.factor = portable::pow(part.before / part.after, 1.0 / 3);
  for (Index i = 0; i < index.points; ++i) {
    if (!is_vertex[i]) continue;
    const Part& part = of_parts[parts.of(i)];
    const Vec center = part.center();
    displacements[i] = center + part.factor * (moved(i) - center) - place(index, i);
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
  for_items(index.points, kSumBlock, stop, [&](std::size_t i) {
    const point::Vec3<float> to = point::end_of(place(index, i), strength, displacements[i]);
    out[i] = {to.x, to.y, to.z};
  });
  return report;
}

}  // namespace pointfair::cpu
