// SPDX-License-Identifier: Apache-2.0
// The graph of Method::implicit and its system of equations, (M + lambda S) d = -lambda S b of docs/methods.md, Eq. 28,
// row by row; backends walk the rows. All numbers but the weights of edges are doubles.
#pragma once

#include "point/exponential.h"
#include "point/neighbors.h"

namespace pointfair::point {

using Place = Vec3<double>;

// Sums over all points are those of blocks of so many points, each in the order of its points, and then of the blocks
// in their order: so they have one result on every device.
inline constexpr int kSumBlock = 2048;

inline constexpr double kSolverResidual = 1e-6;  // of each coordinate, relative to its right-hand side
inline constexpr int kSolverIterations = 1000;   // at most

inline constexpr double kUnitOfScale = 0.5;   // of a squared length; see docs/methods.md
inline constexpr double kLeastLength = 1e-3;  // of the mean one; points at one place have none, and 1 / length no bound

struct alignas(8) GraphEntry {  // is read at once
  Index there;
  float weight;
};

// Lists may hold any of the points at one place, which follow each other in the index; equations must not depend on
// which. Returns, for the entry of that slot in the list of point `at`, the first there that no slot before stands for,
// but for the point itself. listed(slot) is an entry; is_at_one_place(i, j) compares points.
template <class Listed, class IsAtOnePlace>
POINTFAIR_INLINE Index first_alike(const Listed& listed, int slot, Index at, const IsAtOnePlace& is_at_one_place) {
  const Index entry = listed(slot);
  Index first = entry, step = 1;
  for (; first >= step && is_at_one_place(first - step, entry); step *= 2) first -= step;
  for (; step > 0; step /= 2)
    if (first >= step && is_at_one_place(first - step, entry)) first -= step;
  Index alike = first;
  for (int s = slot - 1; s >= 0 && is_at_one_place(listed(s), entry); --s) ++alike;
  return alike + (first <= at && at <= alike ? 1 : 0);
}

// Of a row whose entries ascend: each neighbour once, with the sum of its weights in their order. Returns how many.
POINTFAIR_INLINE Index merge_entries(GraphEntry* row, Index count) {
  Index merged = 0;
  for (Index n = 0; n < count; ++n) {
    const GraphEntry entry = row[n];
    if (merged > 0 && row[merged - 1].there == entry.there) {
      row[merged - 1].weight += entry.weight;
    } else {
      row[merged++] = entry;
    }
  }
  return merged;
}

POINTFAIR_INLINE double edge_length(Place a, Place b) { return square_root(squared_length(b - a)); }

// What an edge counts for by its length.
struct EdgeRule {
  bool by_scale = false;    // 1 / length; else exp(-factor length^2)
  double factor = 0;        // 0: every edge alike
  double least_length = 0;  // of by_scale
};

// Weighs the entries of a row at `here`, which have numbers of edges for weights, and returns its mass. `place_of`
// tells where a neighbour is.
template <class PlaceOf>
POINTFAIR_INLINE double weigh_row(GraphEntry* row, Index count, Place here, const EdgeRule& rule,
                                  const PlaceOf& place_of) {
  double mass = 0;
  for (Index n = 0; n < count; ++n) {
    const double length = edge_length(here, place_of(row[n].there));
    if (rule.by_scale) {
      const double its = larger(length, rule.least_length);
      mass += row[n].weight * its / 2;
      row[n].weight = float(row[n].weight / its);
    } else {
      if (rule.factor > 0) row[n].weight = float(row[n].weight * exponential(-rule.factor * length * length));
      mass += row[n].weight;
    }
  }
  return mass;
}

POINTFAIR_INLINE double sum_of_row(const GraphEntry* row, Index count) {
  double sum = 0;
  for (Index n = 0; n < count; ++n) sum += row[n].weight;
  return sum;
}

// By sorted position. A row's entries ascend, each neighbour once; a point without a mass stays.
struct GraphView {
  const unsigned long long* begin;  // of each row, in `entries`
  const Index* count;
  const GraphEntry* entries;
  const double *mass, *weight_sum;
};

// Where a displaced point ends.
POINTFAIR_INLINE Vec3<float> end_of(Place here, double strength, Place displacement) {
  const Place to = here + strength * displacement;
  return {float(to.x), float(to.y), float(to.z)};
}

POINTFAIR_INLINE Place scaled(Place a, Place b) { return {a.x * b.x, a.y * b.y, a.z * b.z}; }
// a / b of each coordinate; 0 where b is, so that a coordinate that is solved stays.
POINTFAIR_INLINE Place quotient(Place a, Place b) {
  return {b.x > 0 ? a.x / b.x : 0, b.y > 0 ? a.y / b.y : 0, b.z > 0 ? a.z / b.z : 0};
}
// Largest over the coordinates, of the squares of what is left.
POINTFAIR_INLINE double squared_residual(Place left, Place whole) {
  const Place share = quotient(left, whole);
  return larger(larger(share.x, share.y), share.z);
}

// Of what is left, plain and by the diagonal.
struct SquaresLeft {
  Place plain{}, by_diagonal{};
};

// Conjugate gradients for displacements of those points that have a mass, with rows divided by their diagonals. The
// coordinates are three systems with one matrix. Arrays have a place for each point.
struct Gradients {
  GraphView graph;
  double lambda;
  Place *found, *rest, *way, *image;

  POINTFAIR_INLINE bool stays(Index i) const { return !(graph.mass[i] > 0); }
  POINTFAIR_INLINE double inverse_diagonal(Index i) const { return 1 / (graph.mass[i] + lambda * graph.weight_sum[i]); }

  // Zeros for a point that stays; so all below.
  template <class PlaceOf>
  POINTFAIR_INLINE SquaresLeft start(Index i, const PlaceOf& place_of) const {
    found[i] = rest[i] = way[i] = {};
    if (stays(i)) return {};
    const Place here = place_of(i);
    Place sum{};
    const GraphEntry* const row = graph.entries + graph.begin[i];
    for (Index n = 0; n < graph.count[i]; ++n) sum = sum + double(row[n].weight) * (place_of(row[n].there) - here);
    rest[i] = lambda * sum;
    way[i] = inverse_diagonal(i) * rest[i];
    return {scaled(rest[i], rest[i]), scaled(rest[i], way[i])};
  }

  // The image of the way; returns its product with the way.
  POINTFAIR_INLINE Place multiply(Index i) const {
    if (stays(i)) return {};
    const Place own = way[i];
    Place sum{};
    const GraphEntry* const row = graph.entries + graph.begin[i];
    for (Index n = 0; n < graph.count[i]; ++n) sum = sum + double(row[n].weight) * (own - way[row[n].there]);
    const Place its = graph.mass[i] * own + lambda * sum;
    image[i] = its;
    return scaled(own, its);
  }

  POINTFAIR_INLINE SquaresLeft advance(Index i, Place step) const {
    if (stays(i)) return {};
    found[i] = found[i] + scaled(step, way[i]);
    rest[i] = rest[i] - scaled(step, image[i]);
    const Place squared = scaled(rest[i], rest[i]);
    return {squared, inverse_diagonal(i) * squared};
  }

  POINTFAIR_INLINE void turn(Index i, Place share) const {
    if (!stays(i)) way[i] = inverse_diagonal(i) * rest[i] + scaled(share, way[i]);
  }
};

}  // namespace pointfair::point
