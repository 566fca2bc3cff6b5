// SPDX-License-Identifier: Apache-2.0
// A cloud's attributes as the page colours by them.
#pragma once

#include <cstdint>
#include <string_view>
#include <vector>

#include "message.hpp"
#include "order.hpp"
#include "pointfair/pointfair.hpp"

namespace pointfair::viewer {

/// What the page offers to colour by: [{"name", "kind": "rgb" | "scalar"}]. Colours come first, as "rgb"; an attribute
/// of several components is offered as name[0], name[1], ... What is zero everywhere, as most fields of a LAS file are,
/// is left out. O(N) for each attribute.
Json colour_choices(const Cloud& cloud);

/// A scalar attribute of the places [0, count), NaN where a value is none. Throws ErrorKind::usage for an unknown name.
std::vector<float> scalars(const Cloud& cloud, std::string_view choice, const Order& order, std::size_t count);

/// The colours of the places [0, count): r, g, b, 255 each.
std::vector<std::uint8_t> colours(const Cloud& cloud, const Order& order, std::size_t count);

}  // namespace pointfair::viewer
