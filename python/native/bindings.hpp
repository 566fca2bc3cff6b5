// SPDX-License-Identifier: Apache-2.0
// What each file of bindings adds to the module.
#pragma once

#include <nanobind/nanobind.h>
#include <nanobind/ndarray.h>
#include <nanobind/typing.h>

#include "pointfair/pointfair.hpp"

namespace pointfair::python {

void bind_params(nanobind::module_& module);
void bind_clouds(nanobind::module_& module);
void bind_pipelines(nanobind::module_& module);
void bind_functions(nanobind::module_& module);

/// Messages name flags as the command line does, "--similarity-sigma"; in Python it is "similarity_sigma".
std::string in_python(std::string message);

/// As Python's types have them.
using Row = nanobind::typed<nanobind::tuple, nanobind::any, nanobind::ellipsis>;
using Rows = nanobind::typed<nanobind::list, Row>;

/// The fields in the order of the dataclasses of pointfair/_report.py.
Row as_tuple(const DeviceInfo& device);
Row as_tuple(const Report& report);

/// Contiguous coordinates, in the caller's memory, N rows of 3.
template <class Scalar>
using Input = nanobind::ndarray<const Scalar, nanobind::shape<-1, 3>, nanobind::c_contig, nanobind::device::cpu>;
template <class Scalar>
using Output = nanobind::ndarray<Scalar, nanobind::shape<-1, 3>, nanobind::c_contig, nanobind::device::cpu>;
/// One number for each point.
template <class Scalar>
using Column = nanobind::ndarray<Scalar, nanobind::ndim<1>, nanobind::c_contig, nanobind::device::cpu>;
using Mask = nanobind::ndarray<const std::uint8_t, nanobind::ndim<1>, nanobind::c_contig, nanobind::device::cpu>;

template <class Array>
auto span_of(const Array& array) {
  return std::span(array.data(), array.size());
}

}  // namespace pointfair::python
