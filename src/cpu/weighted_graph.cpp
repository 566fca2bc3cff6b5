// SPDX-License-Identifier: Apache-2.0
#include "cpu/weighted_graph.h"

#include <algorithm>
#include <cmath>
#include <numeric>

#include "cpu/ordered_sum.h"
#include "cpu/parallel.h"
#include "point/neighbors.h"
#include "seam/rules.hpp"

namespace pointfair::cpu {
namespace {

using Vec = point::Vec3<double>;

constexpr double kLeastSine = 1e-6;       // of a triangle's corner; a thinner triangle has no cotangents
constexpr double kUnitOfCurvature = 1.5;  // of a squared length, on a mesh; see docs/methods.md

Vec place(const IndexView& index, std::size_t i) { return {index.x[i], index.y[i], index.z[i]}; }

// Half an edge from each end that lists the other, so that both ends see the same whole.
template <class Visit>
void for_listed(const GraphSource& source, const Visit& visit) {
  const IndexView& index = source.index;
  const auto are_at_one_place = [&](Index i, Index j) {
    return index.x[i] == index.x[j] && index.y[i] == index.y[j] && index.z[i] == index.z[j];
  };
  for (Index i = 0; i < source.index.points; ++i) {
    const Index* const list = source.lists.of_leaf(i / kLeafSize).list + i % kLeafSize;
    for (int slot = 0; slot < source.lists.k && list[slot * kLeafSize] != point::kNoNeighbor; ++slot) {
      const Index there = point::first_alike([&](int s) { return list[s * kLeafSize]; }, slot, i, are_at_one_place);
      visit(i, there, 0.5f);
      visit(there, i, 0.5f);
    }
  }
}

template <class Visit>
void for_edges(const MeshEdges& mesh, const std::vector<Index>& at, const Visit& visit) {
  for (std::uint32_t v = 0; v < at.size(); ++v) {
    if (at[v] == point::kNoNeighbor) continue;
    for (const std::uint32_t there : mesh.neighbors_of(v))
      if (at[there] != point::kNoNeighbor) visit(at[v], at[there], 1.0f);
  }
}

// Calls visit(corners, share) for triangles that make up the faces. A polygon is cut from each of its corners in turn,
// so that none is preferred, and each cut counts for its share.
template <class Visit>
void for_triangles(const MeshFaces& faces, const std::vector<Index>& at, const Visit& visit) {
  std::vector<Index> its;
  for (std::size_t f = 0; f < faces.size(); ++f) {
    its.clear();
    for (const std::uint32_t corner : faces.of(f)) its.push_back(at[corner]);
    if (std::ranges::find(its, point::kNoNeighbor) != its.end()) continue;
    const std::size_t n = its.size(), cuts = n == 3 ? 1 : n;
    for (std::size_t first = 0; first < cuts; ++first)
      for (std::size_t i = 1; i + 1 < n; ++i)
        visit(std::array{its[first], its[(first + i) % n], its[(first + i + 1) % n]}, 1.0 / double(cuts));
  }
}

// A quarter of the cotangent of each corner, for the edge across it.
template <class Visit>
void for_cotangents(const IndexView& index, const std::array<Index, 3>& corners, double share, const Visit& visit) {
  for (std::size_t c = 0; c < 3; ++c) {
    const Index a = corners[(c + 1) % 3], b = corners[(c + 2) % 3];
    const Vec to_a = place(index, a) - place(index, corners[c]), to_b = place(index, b) - place(index, corners[c]);
    const double sine = std::sqrt(point::squared_length(cross(to_a, to_b)));
    const float weight = float(share * dot(to_a, to_b) / (4 * sine));
    visit(a, b, weight);
    visit(b, a, weight);
  }
}

double doubled_area(const IndexView& index, const std::array<Index, 3>& t) {
  const Vec origin = place(index, t[0]);
  return std::sqrt(point::squared_length(cross(place(index, t[1]) - origin, place(index, t[2]) - origin)));
}

bool has_cotangents(const IndexView& index, const std::array<Index, 3>& t) {
  double longest = 0;
  for (std::size_t c = 0; c < 3; ++c)
    longest = std::max(longest, point::squared_length(place(index, t[c]) - place(index, t[(c + 1) % 3])));
  return doubled_area(index, t) > kLeastSine * longest;
}

// `for_each(visit)` calls visit(row, there, weight) in the same order whenever it is called.
template <class ForEach>
void collect(WeightedGraph& graph, std::size_t points, const ForEach& for_each) {
  graph.begin.assign(points + 1, 0);
  for_each([&](Index row, Index, float) { ++graph.begin[row + 1]; });
  std::partial_sum(graph.begin.begin(), graph.begin.end(), graph.begin.begin());
  graph.entries.resize(graph.begin.back());
  graph.count.assign(points, 0);
  for_each([&](Index row, Index there, float weight) {
    graph.entries[graph.begin[row] + graph.count[row]++] = {there, weight};
  });
}

// In the order of neighbours, each once, with the sum of its weights.
void merge_row(std::span<WeightedGraph::Entry> row, Index& count) {
  for (std::size_t i = 1; i < row.size(); ++i) {  // rows are short, and equal ones must keep their order
    const WeightedGraph::Entry entry = row[i];
    std::size_t to = i;
    for (; to > 0 && entry.there < row[to - 1].there; --to) row[to] = row[to - 1];
    row[to] = entry;
  }
  count = point::merge_entries(row.data(), Index(row.size()));
}

void merge_rows(WeightedGraph& graph, const std::stop_token& stop) {
  for_items(graph.points(), kSumBlock, stop, [&](std::size_t i) {
    merge_row({graph.entries.data() + graph.begin[i], graph.count[i]}, graph.count[i]);
  });
}

double mean_length(const WeightedGraph& graph, const IndexView& index, const std::stop_token& stop) {
  struct Lengths {
    double sum = 0, count = 0;
    Lengths& operator+=(const Lengths& more) { return sum += more.sum, count += more.count, *this; }
  };
  const Lengths all = ordered_sum<Lengths>(graph.points(), stop, [&](std::size_t i, Lengths& here) {
    for (const auto& entry : graph.row(i)) here.sum += point::edge_length(place(index, i), place(index, entry.there));
    here.count += graph.count[i];
  });
  return all.count > 0 ? all.sum / all.count : 0;
}

// Weights by length, and the masses that go with them. `graph` has numbers of edges for weights.
void weigh(WeightedGraph& graph, const IndexView& index, const point::EdgeRule& rule, const std::stop_token& stop) {
  graph.mass.resize(graph.points());
  for_items(graph.points(), kSumBlock, stop, [&](std::size_t i) {
    graph.mass[i] = point::weigh_row(graph.entries.data() + graph.begin[i], graph.count[i], place(index, i), rule,
                                     [&](Index there) { return place(index, there); });
  });
}

void sum_rows(WeightedGraph& graph, const std::stop_token& stop) {
  graph.weight_sum.resize(graph.points());
  for_items(graph.points(), kSumBlock, stop, [&](std::size_t i) {
    graph.weight_sum[i] = point::sum_of_row(graph.row(i).data(), graph.count[i]);
    if (graph.count[i] < Index(point::kLeastNeighbors)) graph.mass[i] = 0;
  });
}

WeightedGraph curvature_of_mesh(const GraphSource& source, const std::vector<Index>& at, const std::stop_token& stop) {
  WeightedGraph graph;
  const IndexView& index = source.index;
  std::vector<double> areas(index.points, 0);
  collect(graph, index.points, [&](const auto& visit) {
    for_triangles(*source.faces, at, [&](const std::array<Index, 3>& corners, double share) {
      if (has_cotangents(index, corners)) for_cotangents(index, corners, share, visit);
    });
  });
  for_triangles(*source.faces, at, [&](const std::array<Index, 3>& corners, double share) {
    if (!has_cotangents(index, corners)) return;
    for (const Index corner : corners) areas[corner] += share * doubled_area(index, corners) / 2;
  });
  merge_rows(graph, stop);
  graph.mass = std::move(areas);
  return graph;
}

}  // namespace

std::vector<Index> sorted_positions(const IndexView& index, const MeshEdges& mesh) {
  std::vector<Index> at(mesh.vertices(), point::kNoNeighbor);
  for (Index i = 0; i < index.points; ++i) {
    const std::uint32_t point = index.original[i];
    if (mesh.first[mesh.vertex[point]] == point) at[mesh.vertex[point]] = i;
  }
  return at;
}

WeightedGraph weighted_graph(const GraphSource& source, const FairingSettings& settings, const std::stop_token& stop) {
  const IndexView& index = source.index;
  const ImplicitWeights by = settings.implicit_weights;
  WeightedGraph graph;
  std::vector<Index> at;
  if (source.mesh != nullptr) at = sorted_positions(index, *source.mesh);
  if (source.mesh != nullptr && by == ImplicitWeights::curvature) {
    graph = curvature_of_mesh(source, at, stop);
    const double length = mean_length(graph, index, stop);
    graph.unit = kUnitOfCurvature * length * length;
  } else {
    collect(graph, index.points, [&](const auto& visit) {
      source.mesh != nullptr ? for_edges(*source.mesh, at, visit) : for_listed(source, visit);
    });
    merge_rows(graph, stop);
    const double length = mean_length(graph, index, stop);
    weigh(graph, index, edge_rule(settings, length), stop);
    graph.unit = lambda_unit(settings, length);
  }
  sum_rows(graph, stop);
  return graph;
}

}  // namespace pointfair::cpu
