// SPDX-License-Identifier: Apache-2.0
// A plan as the text that its file holds: a line for each thing, its name first.
#pragma once

#include <string>

#include "scale/plan.hpp"

namespace pointfair::scale {

std::string text_of(const Plan& plan);
// `name` is that of the file, for errors. Throws Error(file) for one of another version, and if it is damaged.
Plan plan_of(const std::string& text, const std::string& name);

}  // namespace pointfair::scale
