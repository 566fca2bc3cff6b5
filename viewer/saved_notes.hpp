// SPDX-License-Identifier: Apache-2.0
// What the page is told of a file that was saved.
#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "pointfair/pointfair.hpp"

namespace pointfair::viewer {

/// What the file `to` loses or holds from before, as the program says it. `from`: of the cloud `before`; empty where it
/// came through the page.
std::vector<std::string> notes_on_file(const Cloud& before, const Cloud& after, Format format,
                                       std::optional<Encoding> encoding, const std::filesystem::path& from,
                                       const std::filesystem::path& to);

}  // namespace pointfair::viewer
