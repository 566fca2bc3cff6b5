// SPDX-License-Identifier: Apache-2.0
// The attribute that tells which points are outliers.
#pragma once

#include <algorithm>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "pointfair/cloud.hpp"

namespace pointfair {

// "outlier", or outlier_2 and so on where the cloud has one of that name.
inline Attribute outlier_marks(const Cloud& cloud, std::span<const std::uint8_t> outliers) {
  const std::vector<AttributeInfo> present = attributes(cloud);
  std::string name = "outlier";
  for (int number = 2; std::any_of(present.begin(), present.end(), [&](const auto& a) { return a.name == name; });)
    name = "outlier_" + std::to_string(number++);
  const auto bytes = std::as_bytes(outliers);
  Attribute attribute;
  attribute.name = std::move(name);
  attribute.type = ScalarType::uint8;
  attribute.data.assign(bytes.begin(), bytes.end());
  return attribute;
}

}  // namespace pointfair
