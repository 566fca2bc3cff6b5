// SPDX-License-Identifier: Apache-2.0
#include "cpu/chain.h"

#include <algorithm>
#include <atomic>
#include <cmath>
#include <limits>
#include <vector>

#include "cpu/constrained.h"
#include "cpu/facets.h"
#include "cpu/implicit.h"
#include "cpu/parallel.h"
#include "cpu/weighted_graph.h"
#include "seam/noise_levels.hpp"
#include "seam/rules.hpp"

namespace pointfair::cpu {
namespace {

// Between two looks at the stop token: at most about 10 ms of work where neighbourhoods are as wide as they can be, and
// where lists are as long as they can be under the constraint, which then takes up to 10 ms a leaf.
constexpr std::size_t kLeavesABlock = 32, kConstrainedLeavesABlock = 2;

// For the notes of a block of leaves: 12 bytes a point, about three for each of 64 leaves that a leaf's neighbourhoods
// meet. They are 45 where the noise is as large as the spacing.
constexpr std::size_t kNotesABlock = std::size_t(12) * kLeafSize * kLeavesABlock;

// The memory of so many points as three arrays.
VectorsOut three_arrays(Buffer<Point>& points) {
  static_assert(sizeof(Point) == 3 * sizeof(float));
  float* const x = reinterpret_cast<float*>(points.data());
  return {x, x + points.size(), x + 2 * points.size()};
}

// Distances of the leaves along the curve, each with the k-th nearest of the leaf before, and a quarter of that more,
// as what is likely.
class DistanceSearch {
 public:
  DistanceSearch(const Kernels& kernels, const IndexView& index, int k)
      : kernels_(kernels), index_(index), k_(k), squared_(std::size_t(k) * kLeafSize) {}
  const float* find(Index leaf) {
    kernels_.nearest_distances(index_, leaf, k_, likely_, squared_.data());
    constexpr float kRoom = 1.25f * 1.25f;
    likely_ = kRoom * *std::max_element(squared_.end() - kLeafSize, squared_.end());
    return squared_.data();
  }

 private:
  const Kernels& kernels_;
  const IndexView& index_;
  int k_;
  float likely_ = std::numeric_limits<float>::infinity();
  std::vector<float> squared_;
};

}  // namespace

Chain::Chain(MemoryMeter& meter)
    : index_(meter),
      lists_(meter),
      mesh_lists_(meter),
      mean_distance_(meter),
      squared_level_(meter),
      further_share_(meter),
      squared_radius_(meter),
      squared_growth_(meter),
      displaced_x_(meter),
      displaced_y_(meter),
      displaced_z_(meter),
      notes_(meter),
      normals_(meter),
      faired_(meter) {}

void Chain::build_index(std::span<const Point> points, std::span<const Index> originals,
                        const std::optional<Frame>& frame, SortSpace& space, const Kernels& kernels,
                        const std::stop_token& stop) {
  has_lists_ = false;
  notes_.release();
  mesh_lists_.clear();
  index_.build(points, originals, frame, space, kernels, stop);
  counts_ = {};
  counts_.unmoved.non_finite = index_.invalid().size();
}

void Chain::release_small_results() {
  for (Buffer<float>* values : {&mean_distance_, &squared_level_, &further_share_, &squared_radius_, &squared_growth_,
                                &displaced_x_, &displaced_y_, &displaced_z_})
    values->release();
  normals_.release();
  notes_.release();
}

VectorsView Chain::normals() const {
  const float* const x = reinterpret_cast<const float*>(normals_.data());
  return {x, x + normals_.size(), x + 2 * normals_.size()};
}

Notes Chain::notes_of(std::size_t block) {
  if (notes_.size() == 0) return {};
  std::uint8_t* const begin = notes_.data() + block * kNotesABlock;
  return {begin, begin + kNotesABlock - kLeavesABlock * kBytesOfNoNotes};
}

Neighborhoods Chain::neighborhoods() const {
  return {{neighbors_.k, stored_k_, lists_.data(), mesh_lists_.rings(), mesh_lists_.balls()},
          {squared_radius_.data(), neighbors_.radius * neighbors_.radius, neighbors_.min_neighbors,
           neighbors_.radius_follows ? squared_levels() : nullptr, nullptr, squared_widest(neighbors_)}};
}

Neighborhoods Chain::grown_neighborhoods() const {
  Neighborhoods result = neighborhoods();
  if (radii_grow()) result.radii.squared_growth = squared_growth_.data();
  return result;
}

bool Chain::prefix_suffices(const NeighborSettings& settings) const {
  NeighborSettings longer = settings;
  longer.k = neighbors_.k;
  return has_lists_ && settings.k > 0 && settings.k <= stored_k_ && longer == neighbors_;
}

// Neighbourhoods of fewer than k, where the constraint may have cut them.
void Chain::count_short(const std::stop_token& stop) {
  counts_.short_neighborhoods = 0;
  if (!neighbors_.constraint) return;
  const IndexView index = index_.view();
  std::atomic<std::uint64_t> total = 0;
  for_blocks(index.leaves, kLeavesABlock, stop, [&](std::size_t first, std::size_t last, std::size_t) {
    std::uint64_t here = 0;
    for (std::size_t i = first * kLeafSize; i < std::min<std::size_t>(last * kLeafSize, index.points); ++i) {
      const std::size_t last_slot = i / kLeafSize * stored_k_ + std::size_t(neighbors_.k) - 1;
      here += lists_[last_slot * kLeafSize + i % kLeafSize] == point::kNoNeighbor;
    }
    total += here;
  });
  counts_.short_neighborhoods = total;
}

void Chain::find_neighbors(const NeighborSettings& settings, const Kernels& kernels, const std::stop_token& stop) {
  if (prefix_suffices(settings)) {
    neighbors_ = settings;
    return count_short(stop);
  }
  has_lists_ = false;
  neighbors_ = settings;
  stored_k_ = settings.k;
  if (!by_list() && index_.view().points > 0 && index_.view().share == nullptr)
    throw Error(ErrorKind::failed, "sums over radius neighbourhoods need an index along a frame's curve");
  mesh_lists_.clear();
  lists_.resize(neighbors_.mesh ? 0 : index_.view().leaves * list_row());
  mean_distance_.resize(std::size_t(index_.view().leaves) * kLeafSize);
  measure_levels(kernels, stop);
  if (!by_list()) {
    measure_radii(kernels, stop);
  } else if (!neighbors_.mesh) {
    find_lists(kernels, stop);
  }
  has_areas_ = !by_list() || !neighbors_.mesh;
  if (neighbors_.mesh) mesh_lists_.find(index_.view(), neighbors_, neighborhoods().radii, stop);
  count_short(stop);
  has_lists_ = true;
}

void Chain::find_lists(const Kernels& kernels, const std::stop_token& stop) {
  const IndexView index = index_.view();
  const float limit =
      neighbors_.radius > 0 ? neighbors_.radius * neighbors_.radius : std::numeric_limits<float>::infinity();
  const std::size_t block_size = neighbors_.constraint ? kConstrainedLeavesABlock : kLeavesABlock;
  for_blocks(index.leaves, block_size, stop, [&](std::size_t first, std::size_t last, std::size_t) {
    ConstrainedSearch constrained(kernels, neighbors_, limit);
    float squared[point::kAreaNeighbors * kLeafSize];
    for (std::size_t leaf = first; leaf < last; ++leaf) {
      Index* const list = lists_.data() + leaf * list_row();
      const Index* nearest = list;
      int nearest_count = neighbors_.k;
      if (neighbors_.constraint) {
        nearest = constrained.find(index, Index(leaf), list);
        nearest_count = point::kAreaNeighbors;
      } else {
        kernels.nearest(index, Index(leaf), neighbors_.k, limit, list);
      }
      if (nearest_count < point::kAreaNeighbors || neighbors_.radius > 0) {  // W_a knows no radius
        kernels.nearest_distances(index, Index(leaf), point::kAreaNeighbors, std::numeric_limits<float>::infinity(),
                                  squared);
      } else {
        kernels.listed_distances(index, Index(leaf), nearest, point::kAreaNeighbors, squared);
      }
      kernels.mean_distances(squared, point::kAreaNeighbors, mean_distance_.data() + leaf * kLeafSize);
    }
  });
}

// Of W_a, which knows no mesh: along one it is the only reader of what lies nearest.
void Chain::measure_areas(const Kernels& kernels, const std::stop_token& stop) {
  has_areas_ = true;
  const IndexView index = index_.view();
  for_blocks(index.leaves, kLeavesABlock, stop, [&](std::size_t first, std::size_t last, std::size_t) {
    DistanceSearch nearest(kernels, index, point::kAreaNeighbors);
    for (std::size_t leaf = first; leaf < last; ++leaf) {
      kernels.mean_distances(nearest.find(Index(leaf)), point::kAreaNeighbors,
                             mean_distance_.data() + leaf * kLeafSize);
    }
  });
}

void Chain::measure_levels(const Kernels& kernels, const std::stop_token& stop) {
  if (!neighbors_.levels) return squared_level_.release();
  const IndexView index = index_.view();
  const point::NodeField field = field_of(neighbors_.levels.get());
  squared_level_.resize(std::size_t(index.leaves) * kLeafSize);
  for_blocks(index.leaves, kLeavesABlock, stop, [&](std::size_t first, std::size_t last, std::size_t) {
    for (std::size_t leaf = first; leaf < last; ++leaf)
      kernels.squared_levels(index, Index(leaf), field, squared_level_.data() + leaf * kLeafSize);
  });
}

void Chain::measure_radii(const Kernels& kernels, const std::stop_token& stop) {
  const IndexView index = index_.view();
  squared_radius_.resize(std::size_t(index.leaves) * kLeafSize);
  const int count = std::max(neighbors_.min_neighbors, point::kAreaNeighbors);  // of which both take the first ones
  const point::NodeField reach = field_of(neighbors_.reach_levels.get());
  if (reach.values == nullptr) further_share_.release();
  if (reach.values != nullptr) further_share_.resize(squared_radius_.size());
  for_blocks(index.leaves, kLeavesABlock, stop, [&](std::size_t first, std::size_t last, std::size_t) {
    DistanceSearch nearest(kernels, index, count);
    float reach_level[kLeafSize];
    for (std::size_t leaf = first; leaf < last; ++leaf) {
      const float* const squared = nearest.find(Index(leaf));
      kernels.mean_distances(squared, point::kAreaNeighbors, mean_distance_.data() + leaf * kLeafSize);
      if (reach.values != nullptr) {
        kernels.squared_levels(index, Index(leaf), reach, reach_level);
        std::transform(reach_level, reach_level + kLeafSize, further_share_.data() + leaf * kLeafSize,
                       [](float level) { return point::further_share(level); });
      }
      kernels.squared_radii(index, Index(leaf), squared, neighborhoods().radii,
                            reach.values != nullptr ? reach_level : nullptr, squared_radius_.data() + leaf * kLeafSize);
    }
  });
}

void Chain::estimate_normals(const NormalSettings& settings, const Kernels& kernels, const std::stop_token& stop) {
  normal_settings_ = settings;
  normals_.resize(std::size_t(index_.view().leaves) * kLeafSize);
  notes_.release();
  if (settings.faces) {
    face_normals(*settings.faces, stop);
  } else {
    plane_normals(settings, kernels, stop);
  }
  filter_normals(settings, kernels, stop);
}

void Chain::plane_normals(const NormalSettings& settings, const Kernels& kernels, const std::stop_token& stop) {
  const IndexView index = index_.view();
  const VectorsOut out = three_arrays(normals_);
  if (!by_list() && !neighbors_.mesh) notes_.resize((index.leaves + kLeavesABlock - 1) / kLeavesABlock * kNotesABlock);
  std::atomic<std::uint64_t> too_few = 0, no_normal = 0;
  for_blocks(index.leaves, kLeavesABlock, stop, [&](std::size_t first, std::size_t last, std::size_t block) {
    std::uint64_t too_few_here = 0, no_normal_here = 0;
    Notes notes = notes_of(block);
    unsigned found[kLeafSize];
    for (std::size_t leaf = first; leaf < last; ++leaf) {
      kernels.normals(index, Index(leaf), neighborhoods(), settings, out, found, notes);
      const Index points = std::min<Index>(kLeafSize, index.points - Index(leaf) * kLeafSize);
      for (Index lane = 0; lane < points; ++lane) {
        const std::size_t i = leaf * kLeafSize + lane;
        if (found[lane] < unsigned(point::kLeastNeighbors)) {
          ++too_few_here;
        } else if (out.x[i] == 0 && out.y[i] == 0 && out.z[i] == 0) {
          ++no_normal_here;
        }
      }
    }
    too_few += too_few_here;
    no_normal += no_normal_here;
  });
  counts_.unmoved.too_few_neighbors = too_few;
  counts_.unmoved.no_normal = no_normal;
}

// A face that has lost a corner does not count; a vertex of no face has too few neighbours.
void Chain::face_normals(const MeshFaces& faces, const std::stop_token& stop) {
  using Vec = point::Vec3<double>;
  const IndexView index = index_.view();
  const std::vector<Index> at = sorted_positions(index, neighbors_.mesh->vertex.size());
  const auto normal_of = [&](std::uint32_t face) {  // twice the area long
    const auto corners = faces.of(face);
    const auto place = [&](std::size_t c) {
      const Index i = at[corners[c]];
      return Vec{index.x[i], index.y[i], index.z[i]};
    };
    Vec sum{};
    if (std::any_of(corners.begin(), corners.end(), [&](std::uint32_t c) { return at[c] == point::kNoNeighbor; }))
      return sum;
    for (std::size_t c = 2; c < corners.size(); ++c) sum = sum + cross(place(c - 1) - place(0), place(c) - place(0));
    return sum;
  };
  const VectorsOut out = three_arrays(normals_);
  std::atomic<std::uint64_t> too_few = 0, no_normal = 0;
  for_blocks(normals_.size(), kLeavesABlock * kLeafSize, stop, [&](std::size_t first, std::size_t last, std::size_t) {
    for (std::size_t i = first; i < last; ++i) {
      if (i >= index.points) {
        out.x[i] = out.y[i] = out.z[i] = 0;
        continue;
      }
      const auto around = faces.around(neighbors_.mesh->vertex[index.original[i]]);
      Vec sum{};
      for (const std::uint32_t face : around) sum = sum + normal_of(face);
      const double length = std::sqrt(point::squared_length(sum));
      const Vec unit = length > 0 ? (1 / length) * sum : Vec{};
      out.x[i] = float(unit.x), out.y[i] = float(unit.y), out.z[i] = float(unit.z);
      if (around.empty()) {
        ++too_few;
      } else if (!(length > 0)) {
        ++no_normal;
      }
    }
  });
  counts_.unmoved.too_few_neighbors = too_few;
  counts_.unmoved.no_normal = no_normal;
}

void Chain::filter_normals(const NormalSettings& settings, const Kernels& kernels, const std::stop_token& stop) {
  if (settings.filter_rounds == 0) return;
  const IndexView index = index_.view();
  faired_.resize(normals_.size());  // the rounds' memory: no point is faired yet
  if (radii_grow()) squared_growth_.resize(normals_.size());
  for (int round = 0; round < settings.filter_rounds; ++round) {
    const bool is_last = round + 1 == settings.filter_rounds;
    float* const squared_growth = is_last && radii_grow() ? squared_growth_.data() : nullptr;
    const VectorsOut out = three_arrays(faired_);
    for_blocks(index.leaves, kLeavesABlock, stop, [&](std::size_t first, std::size_t last, std::size_t block) {
      Notes notes = notes_of(block);
      for (std::size_t leaf = first; leaf < last; ++leaf)
        kernels.filter_normals(index, Index(leaf), neighborhoods(), settings, normals(), further_shares(), out,
                               squared_growth, notes);
    });
    std::swap(normals_, faired_);
  }
}

void Chain::fair(const FairingSettings& settings, const Kernels& kernels, const std::stop_token& stop) {
  fairing_settings_ = settings;
  const AreaView area{mean_distance_.data(), area_power(settings.area_weight)};
  faired_.resize(std::size_t(index_.view().leaves) * kLeafSize);
  solver_ = {};
  counts_.unmoved.boundary = 0;
  if (settings.method != Method::bilateral) notes_.release();
  if (area.power != 0 && !has_areas_) measure_areas(kernels, stop);
  if (settings.method == Method::implicit) {
    solver_ = fair_at_once(settings, stop);
  } else if (settings.method == Method::jones) {
    const IndexView index = index_.view();
    fair_by_facets({index, neighborhoods().lists, *neighbors_.mesh, *settings.faces}, settings,
                   {faired_.data(), index.points}, stop);
  } else if (settings.method == Method::bilateral) {
    fair_bilaterally(settings, area, kernels, stop);
  } else {
    fair_otherwise(settings, area, kernels, stop);
  }
  if (settings.kept_boundary) keep_boundary(*settings.kept_boundary, stop);
}

SolverReport Chain::fair_at_once(const FairingSettings& settings, const std::stop_token& stop) {
  const IndexView index = index_.view();
  const GraphSource source{index, neighborhoods().lists, neighbors_.mesh.get(), settings.faces.get()};
  return fair_implicitly(source, settings, {faired_.data(), index.points}, stop);
}

void Chain::keep_boundary(const MeshEdges& mesh, const std::stop_token& stop) {
  const IndexView index = index_.view();
  const VectorsView its_normals = normals();
  std::atomic<std::uint64_t> held = 0;
  for_blocks(index.points, kLeavesABlock * kLeafSize, stop, [&](std::size_t first, std::size_t last, std::size_t) {
    std::uint64_t held_here = 0;
    for (std::size_t i = first; i < last; ++i) {
      if (mesh.is_boundary[index.original[i]] == 0) continue;
      faired_[i] = {index.x[i], index.y[i], index.z[i]};
      held_here += its_normals.x[i] != 0 || its_normals.y[i] != 0 || its_normals.z[i] != 0;  // others: by their reason
    }
    held += held_here;
  });
  counts_.unmoved.boundary = held;
}

void Chain::fair_bilaterally(const FairingSettings& settings, AreaView area, const Kernels& kernels,
                             const std::stop_token& stop) {
  const IndexView index = index_.view();
  const point::Sensors sensors = sensors_of(settings.sensors.get());
  const point::Levels levels{squared_levels(), settings.is_further ? further_shares() : nullptr};
  for_blocks(index.leaves, kLeavesABlock, stop, [&](std::size_t first, std::size_t last, std::size_t block) {
    Notes notes = notes_of(block);
    for (std::size_t leaf = first; leaf < last; ++leaf)
      kernels.fair(index, Index(leaf), grown_neighborhoods(), normals(), area, settings, sensors, levels, notes,
                   &faired_[leaf * kLeafSize].x);
  });
  notes_.release();
}

void Chain::fair_otherwise(const FairingSettings& settings, AreaView area, const Kernels& kernels,
                           const std::stop_token& stop) {
  const IndexView index = index_.view();
  const point::MethodRule rule = method_rule(settings);
  const point::Sensors sensors = sensors_of(settings.sensors.get());
  for (Buffer<float>* axis : {&displaced_x_, &displaced_y_, &displaced_z_})
    axis->resize(std::size_t(index.leaves) * kLeafSize);
  const VectorsOut displacements{displaced_x_.data(), displaced_y_.data(), displaced_z_.data()};
  for_blocks(index.leaves, kLeavesABlock, stop, [&](std::size_t first, std::size_t last, std::size_t) {
    for (std::size_t leaf = first; leaf < last; ++leaf)
      kernels.displacements(index, Index(leaf), neighborhoods(), normals(), area, rule, displacements);
  });
  for_blocks(index.leaves, kLeavesABlock, stop, [&](std::size_t first, std::size_t last, std::size_t) {
    for (std::size_t leaf = first; leaf < last; ++leaf)
      kernels.move(index, Index(leaf), neighborhoods(), {displaced_x_.data(), displaced_y_.data(), displaced_z_.data()},
                   area, rule, sensors, &faired_[leaf * kLeafSize].x);
  });
  for (Buffer<float>* axis : {&displaced_x_, &displaced_y_, &displaced_z_}) axis->release();
}

}  // namespace pointfair::cpu
