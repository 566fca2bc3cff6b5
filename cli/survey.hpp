// SPDX-License-Identifier: Apache-2.0
// Surveys of several files, named by one word: a folder, or a virtual point cloud (VPC).
#pragma once

#include <filesystem>
#include <string>
#include <vector>

namespace pointfair::cli {

/// Whether the input is a folder, or a VPC by its extension.
bool is_survey(const std::string& input);

/// What such an input is, for an error: "scans: is a folder of 3 point clouds". Throws as files_of_survey.
std::string described_survey(const std::string& input, const std::string& in_format);

/// The files that the inputs stand for: of a folder all clouds in it, in the order of their names, of a VPC those that
/// it names, in its order. `in_format`: as --in-format; that of plain floats asks for the .bin files of folders, which
/// do not say what they hold. Throws Error(file) for a folder without clouds, and a VPC that is damaged or names files
/// elsewhere than on disk.
std::vector<std::filesystem::path> files_of_survey(const std::vector<std::string>& inputs,
                                                   const std::string& in_format = {});

}  // namespace pointfair::cli
