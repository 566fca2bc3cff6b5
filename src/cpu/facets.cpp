// SPDX-License-Identifier: Apache-2.0
#include "cpu/facets.h"

#include <algorithm>
#include <cmath>
#include <vector>

#include "cpu/parallel.h"
#include "cpu/weighted_graph.h"
#include "portable.hpp"

namespace pointfair::cpu {
namespace {

using Vec = point::Vec3<double>;

constexpr std::size_t kBlock = 512;  // points or faces

struct Facet {
  Vec middle{}, normal{};  // unit; zero: it predicts nothing
  double area = 0;
};

class Facets {
 public:
  Facets(const FacetSource& source, double sigma, const std::stop_token& stop)
      : source_(source),
        sigma_(sigma),
        stop_(stop),
        at_(sorted_positions(source.index, source.mesh)),
        facets_(source.faces.size()) {
    for_facets([&](std::size_t f) {
      const auto corners = source_.faces.of(f);
      if (std::ranges::any_of(corners, [&](std::uint32_t c) { return at_[c] == point::kNoNeighbor; }))
        return;  // it has lost a corner
      const auto its_place = [&](std::uint32_t c) { return place(at_[c]); };
      Vec sum{};
      for (const std::uint32_t c : corners) sum = sum + its_place(c);
      facets_[f].middle = (1 / double(corners.size())) * sum;
      facets_[f].area = std::sqrt(squared_length(area_normal(corners, its_place)));
    });
  }

  // The normals become those of the faces between smoothed vertices: means of the middles of faces around them, by half
  // the sigma and without regard to heights, so that no single face's noise turns its plane.
  void mollify() {
    std::vector<Vec> smooth(source_.index.points);
    for_points([&](std::size_t i, std::vector<std::uint32_t>& around) {
      const Vec here = place(i);
      collect(i, around);
      Vec moment{};
      double weights = 0;
      for (const std::uint32_t f : around) {
        const Vec offset = facets_[f].middle - here;
        const double w = closeness(offset, sigma_ / 2) * facets_[f].area;
        moment = moment + w * offset;
        weights += w;
      }
      smooth[i] = weights > 0 ? here + (1 / weights) * moment : here;
    });
    for_facets([&](std::size_t f) {
      if (!(facets_[f].area > 0)) return;
      const Vec normal = area_normal(source_.faces.of(f), [&](std::uint32_t c) { return smooth[at_[c]]; });
      const double length = std::sqrt(squared_length(normal));
      if (length > 0) facets_[f].normal = (1 / length) * normal;
    });
  }

  void predict(double similarity_sigma, double strength, std::span<Point> out) const {
    const double factor = 0.5 / (similarity_sigma * similarity_sigma);
    for_points([&](std::size_t i, std::vector<std::uint32_t>& around) {
      const Vec here = place(i);
      collect(i, around);
      Vec moment{};
      double weights = 0;
      for (const std::uint32_t f : around) {
        const Facet& facet = facets_[f];
        if (!(squared_length(facet.normal) > 0)) continue;
        const Vec offset = facet.middle - here;
        const double height = dot(facet.normal, offset);
        const double w = closeness(offset, sigma_) * facet.area * portable::exp(-factor * height * height);
        moment = moment + (w * height) * facet.normal;
        weights += w;
      }
      const Vec there = weights > 0 ? here + (strength / weights) * moment : here;
      out[i] = {float(there.x), float(there.y), float(there.z)};
    });
  }

 private:
  Vec place(std::size_t i) const { return {source_.index.x[i], source_.index.y[i], source_.index.z[i]}; }

  // 0 beyond twice the sigma.
  static double closeness(Vec offset, double sigma) {
    const double squared = squared_length(offset) / (sigma * sigma);
    return squared <= 4 ? portable::exp(-0.5 * squared) : 0;
  }

  // The faces at the point's vertex and at those of its list, in their order.
  void collect(std::size_t i, std::vector<std::uint32_t>& around) const {
    around.clear();
    const auto add = [&](Index vertex_at) {
      const auto its = source_.faces.around(source_.mesh.vertex[source_.index.original[vertex_at]]);
      around.insert(around.end(), its.begin(), its.end());
    };
    add(Index(i));
    const LeafLists lists = source_.lists.of_leaf(Index(i / kLeafSize));
    const Index* const list = lists.list + i % kLeafSize;
    for (int slot = 0; slot < lists.k && list[slot * kLeafSize] != point::kNoNeighbor; ++slot)
      add(list[slot * kLeafSize]);
    std::ranges::sort(around);
    around.erase(std::unique(around.begin(), around.end()), around.end());
  }

  template <class Body>
  void for_facets(const Body& body) {
    for_items(facets_.size(), kBlock, stop_, [&](std::size_t f) { body(f); });
  }
  template <class Body>
  void for_points(const Body& body) const {
    for_blocks(source_.index.points, kBlock, stop_, [&](std::size_t first, std::size_t last, std::size_t) {
      std::vector<std::uint32_t> around;
      for (std::size_t i = first; i < last; ++i) body(i, around);
    });
  }

  const FacetSource& source_;
  double sigma_;
  const std::stop_token& stop_;
  std::vector<Index> at_;  // of each vertex
  std::vector<Facet> facets_;
};

}  // namespace

void fair_by_facets(const FacetSource& source, const FairingSettings& settings, std::span<Point> out,
                    const std::stop_token& stop) {
  Facets facets(source, settings.closeness_sigma, stop);
  facets.mollify();
  facets.predict(settings.similarity_sigma, settings.strength, out);
}

}  // namespace pointfair::cpu
