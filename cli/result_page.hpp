// SPDX-License-Identifier: Apache-2.0
// The page on a result, to hand on with it: what went in, what was done, what came out, in words, numbers and pictures.
#pragma once

#include <cstdint>
#include <filesystem>
#include <stop_token>
#include <string>
#include <vector>

#include "pointfair/pointfair.hpp"

namespace pointfair::cli {

struct PageJob {
  std::filesystem::path input, output;  ///< files; the output is there
  ReadOptions reading;                  ///< of the output
  std::string command;                  ///< that made the output, or the page
  const Report* run = nullptr;          ///< of the run that made the output; null: not known
  Params asked;                         ///< by that run, before anything was estimated
  std::string noise_attribute;          ///< that its noise came from
  std::vector<std::string> notes;       ///< warnings of the run; without one the page says what the two files show
  std::vector<std::uint8_t> outliers;   ///< the reason at each point, as Pipeline::outliers; empty: not known
  std::vector<std::uint8_t> removed;    ///< not 0 at points of the input that the output does not have; empty: none
  std::uint64_t held = 0;               ///< points that nothing but the limits of the run kept in place
};

struct ResultPage {
  std::string text;                ///< HTML of less than 3 MB
  std::vector<std::string> notes;  ///< the warnings on it, with lengths in the file's unit
};

/// Reads the output, so that what it says holds for the file. `pipeline` holds
/// `before`, the cloud of the input, and measures its noise if it did not yet. Throws as read and compare_copies do.
ResultPage result_page(const PageJob& job, const Cloud& before, Pipeline& pipeline, std::stop_token stop);

}  // namespace pointfair::cli
