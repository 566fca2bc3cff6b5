// SPDX-License-Identifier: Apache-2.0
// Where the sensor stood, where that is one place for all points.
#pragma once

#include <optional>
#include <string_view>

#include "io/source.hpp"

namespace pointfair::io {

/// The place "x,y,z"; none for the other forms that parse_viewpoints takes. Throws as check_viewpoint.
std::optional<Position> named_place(std::string_view text);

/// That of all blocks, if the file says it.
std::optional<Position> common_sensor(const Source& source);

/// Whether the source has the place of the sensor for some of its points.
bool has_sensor(const Source& source);

}  // namespace pointfair::io
