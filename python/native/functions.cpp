// SPDX-License-Identifier: Apache-2.0
// Functions of arrays that need no pipeline.
#include <nanobind/stl/array.h>
#include <nanobind/stl/optional.h>

#include <algorithm>
#include <optional>

#include "bindings.hpp"
#include "interruptible.hpp"

namespace nb = nanobind;

namespace pointfair::python {
namespace {

template <class Scalar>
using Table = nb::ndarray<Scalar, nb::ndim<2>, nb::c_contig, nb::device::cpu>;

// Rows of k indices into `out`, -1 where there are fewer points.
void find_neighbors(const Input<float>& coordinates, const Table<std::int64_t>& out) {
  const std::span points(reinterpret_cast<const Point*>(coordinates.data()), coordinates.shape(0));
  const std::size_t k = out.shape(1);
  run_interruptible(kAlwaysStoppable, nb::none(), [&](const Watch& watch) {
    const std::vector<std::uint32_t> found = nearest_neighbors(points, k, watch.stop);
    std::ranges::transform(found, out.data(),
                           [](std::uint32_t j) { return j == kNoNeighbor ? std::int64_t(-1) : std::int64_t(j); });
  });
}

void denoise_image(const Table<const float>& depth, const Table<float>& out, unsigned threads) {
  nb::gil_scoped_release release;  // an image takes too little time to be stopped
  denoise_depth(span_of(depth), depth.shape(1), span_of(out), threads);
}

// Where the rays of an image meet, which lies row by row.
std::optional<Position> find_camera(const Input<double>& points, std::size_t width) {
  return image_viewpoint(std::span(reinterpret_cast<const Position*>(points.data()), points.shape(0)), width);
}

}  // namespace

void bind_functions(nb::module_& module) {
  module.def("nearest_neighbors", &find_neighbors, nb::arg("coordinates").noconvert(), nb::arg("out").noconvert());
  module.def("denoise_depth", &denoise_image, nb::arg("depth").noconvert(), nb::arg("out").noconvert(),
             nb::arg("threads"));
  module.def("image_viewpoint", &find_camera, nb::arg("points").noconvert(), nb::arg("width"));
}

}  // namespace pointfair::python
