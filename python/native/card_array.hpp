// SPDX-License-Identifier: Apache-2.0
// Positions in the memory of a card, by DLPack or as numbers from __cuda_array_interface__.
#pragma once

#include <nanobind/nanobind.h>
#include <nanobind/ndarray.h>

#include <cstdint>

#include "pointfair/pointfair.hpp"

namespace pointfair::python {

/// N rows of 3. Keeps what DLPack gave alive; numbers are the caller's to keep valid.
class CardArray {
 public:
  explicit CardArray(nanobind::ndarray<nanobind::ro> array) : array_(std::move(array)) {
    if (array_.ndim() != 2 || array_.shape(1) != 3 || array_.dtype().lanes != 1 ||
        array_.dtype().code != static_cast<std::uint8_t>(nanobind::dlpack::dtype_code::Float) ||
        (array_.dtype().bits != 32 && array_.dtype().bits != 64))
      throw Error(ErrorKind::usage, "points on a card must be (N, 3) float32 or float64");
    rows_ = {const_cast<void*>(array_.data()),
             array_.shape(0),
             array_.stride(0),
             array_.stride(1),
             array_.dtype().bits == 64 ? ScalarType::float64 : ScalarType::float32,
             array_.device_id()};
  }
  CardArray(std::uintptr_t pointer, std::size_t count, std::ptrdiff_t row_stride, std::ptrdiff_t column_stride,
            bool is_double, int card)
      : rows_{reinterpret_cast<void*>(pointer),
              count,
              row_stride,
              column_stride,
              is_double ? ScalarType::float64 : ScalarType::float32,
              card} {}

  const DeviceOutput& rows() const { return rows_; }

 private:
  nanobind::ndarray<nanobind::ro> array_;
  DeviceOutput rows_;
};

}  // namespace pointfair::python
