// SPDX-License-Identifier: Apache-2.0
// The attribute that tells which points are outliers.
#pragma once

#include <span>
#include <string>
#include <utility>

#include "pointfair/cloud.hpp"

namespace pointfair {

// "outlier", or outlier_2 and so on where the cloud has one of that name.
inline Attribute outlier_marks(const Cloud& cloud, std::span<const std::uint8_t> outliers) {
  std::string name = "outlier";
  for (int number = 2; attribute_info(cloud, name); ++number) name = "outlier_" + std::to_string(number);
  const auto bytes = std::as_bytes(outliers);
  return {{std::move(name), ScalarType::uint8}, {bytes.begin(), bytes.end()}};
}

}  // namespace pointfair
