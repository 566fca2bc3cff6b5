// SPDX-License-Identifier: Apache-2.0
// Functions of arrays that need no pipeline.
#include <algorithm>

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

}  // namespace

void bind_functions(nb::module_& module) {
  module.def("nearest_neighbors", &find_neighbors, nb::arg("coordinates").noconvert(), nb::arg("out").noconvert());
  module.def("denoise_depth", &denoise_image, nb::arg("depth").noconvert(), nb::arg("out").noconvert(),
             nb::arg("threads"));
}

}  // namespace pointfair::python
