// SPDX-License-Identifier: Apache-2.0
// The coordinate systems that the inputs of a run in tiles name.
#pragma once

#include <span>
#include <string>
#include <vector>

#include "io/source.hpp"
#include "pointfair/tiled_run.hpp"
#include "scale/plan.hpp"

namespace pointfair::scale {

/// The system of a file in one line; empty: it does not say.
std::string coordinate_system_of(const Source& source);

/// The systems that the files name with an EPSG code, those of most files first.
std::vector<NamedSystem> named_systems(std::span<const InputFile> files);

}  // namespace pointfair::scale
