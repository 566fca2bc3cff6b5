// SPDX-License-Identifier: Apache-2.0
#include "cpu/chain.h"

#include <algorithm>
#include <atomic>
#include <cmath>
#include <vector>

#include "cpu/facets.h"
#include "cpu/implicit.h"
#include "cpu/parallel.h"
#include "cpu/weighted_graph.h"
#include "seam/rules.hpp"

namespace pointfair::cpu {
namespace {

// For the notes of a block of leaves: 12 bytes a point, about three for each of 64 leaves that a leaf's neighbourhoods
// meet. They are 45 where the noise is as large as the spacing.
constexpr std::size_t kNotesABlock = std::size_t(12) * kLeafSize * kLeavesABlock;

// The memory of so many points as three arrays.
VectorsOut three_arrays(Buffer<Point>& points) {
  static_assert(sizeof(Point) == 3 * sizeof(float));
  float* const x = reinterpret_cast<float*>(points.data());
  return {x, x + points.size(), x + 2 * points.size()};
}

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
  const std::vector<Index> at = sorted_positions(index, *neighbors_.mesh);
  const auto normal_of = [&](std::uint32_t face) {  // twice the area long
    const auto corners = faces.of(face);
    if (std::ranges::any_of(corners, [&](std::uint32_t c) { return at[c] == point::kNoNeighbor; })) return Vec{};
    return area_normal(corners, [&](std::uint32_t c) { return Vec{index.x[at[c]], index.y[at[c]], index.z[at[c]]}; });
  };
  const VectorsOut out = three_arrays(normals_);
  std::atomic<std::uint64_t> too_few = 0, no_normal = 0;
  for_items(normals_.size(), kLeavesABlock * kLeafSize, stop, [&](std::size_t i) {
    if (i >= index.points) {
      out.x[i] = out.y[i] = out.z[i] = 0;
      return;
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
      if (!mesh.is_on_boundary(index.original[i])) continue;
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
  for_items(index.leaves, kLeavesABlock, stop, [&](std::size_t leaf) {
    kernels.displacements(index, Index(leaf), neighborhoods(), normals(), area, rule, displacements);
  });
  for_items(index.leaves, kLeavesABlock, stop, [&](std::size_t leaf) {
    kernels.move(index, Index(leaf), neighborhoods(), {displaced_x_.data(), displaced_y_.data(), displaced_z_.data()},
                 area, rule, sensors, &faired_[leaf * kLeafSize].x);
  });
  for (Buffer<float>* axis : {&displaced_x_, &displaced_y_, &displaced_z_}) axis->release();
}

}  // namespace pointfair::cpu
