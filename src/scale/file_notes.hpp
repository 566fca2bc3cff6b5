// SPDX-License-Identifier: Apache-2.0
// What a run in tiles will tell of its files, known of each when it is planned.
#pragma once

#include <cstdint>
#include <filesystem>
#include <memory>
#include <span>
#include <string>
#include <vector>

#include "io/source.hpp"
#include "pointfair/tiled_run.hpp"

namespace pointfair::scale {

struct InputFile;
struct Plan;

/// What is known of a result before the work, and told after it.
struct FileNote {
  enum class Kind : std::uint8_t {
    loss,              ///< the output does not keep it
    loss_by_removal,   ///< the same, where points are left out
    remark,            ///< what is so whatever the run does
    on_moves,          ///< what no longer is true once points moved
    on_unfound_sensor  ///< what is so unless the run finds the place of the sensor by itself
  };
  Kind kind;
  std::string text;  ///< one line
};

/// `file`: its paths.
std::vector<FileNote> notes_on(const TiledJob& job, const std::shared_ptr<const Source>& source, const InputFile& file);

/// What the places of sensors, which are known of all files together, come to; each time that it is so.
void add_notes_on_sensors(const std::vector<std::shared_ptr<Source>>& sources, Plan& plan);

/// Throws Error(file) where notes tell of losses.
void refuse_losses(const std::filesystem::path& output, const std::vector<FileNote>& notes);

/// The coordinate system of a file in one line; empty: it does not say.
std::string coordinate_system_of(const Source& source);

/// The systems that the files name with an EPSG code, those of most files first.
std::vector<NamedSystem> named_systems(std::span<const InputFile> files);

}  // namespace pointfair::scale
