// SPDX-License-Identifier: Apache-2.0
#include "scale/file_notes.hpp"

#include <algorithm>
#include <functional>
#include <map>
#include <utility>

#include "estimate/automatic.hpp"
#include "io/remaining_source.hpp"
#include "io/streamed.hpp"
#include "pointfair/run_notes.hpp"
#include "scale/outlier_edits.hpp"
#include "scale/plan.hpp"

namespace pointfair::scale {

std::vector<FileNote> notes_on(const TiledJob& job, const std::shared_ptr<const Source>& source,
                               const InputFile& file) {
  std::vector<FileNote> notes;
  const auto add = [&](FileNote::Kind kind, const std::vector<std::string>& texts) {
    for (const std::string& text : texts) {
      std::string& line = notes.emplace_back(FileNote{kind, text}).text;
      std::ranges::replace(line, '\n', ' ');  // a file may name things so
    }
  };
  const std::string added = added_outlier_attribute(job.outlier_action, job.params, *source);
  add(FileNote::Kind::loss, io::losses_when_streamed(*source, file.output, job.write, added));
  if (job.outlier_action.kind == OutlierAction::Kind::remove)
    add(FileNote::Kind::loss_by_removal, io::losses_by_removal(*source));
  const Cloud shell{.origin = source->origin(), .source = source};
  add(FileNote::Kind::remark, notes_on_waveforms(shell));
  if (job.limits.strength > 0) add(FileNote::Kind::remark, notes_on_units(shell));
  add(FileNote::Kind::remark, notes_on_materials(shell, file.path, file.output, source->format()));
  if (job.params.connectivity == Connectivity::automatic && job.limits.strength > 0)
    add(FileNote::Kind::remark, notes_on_faces(shell));
  add(FileNote::Kind::on_moves, notes_on_kept_normals(shell, source->format()));
  return notes;
}

void add_notes_on_sensors(const std::vector<std::shared_ptr<Source>>& sources, Plan& plan) {
  if (!plan.viewpoint.empty()) return;
  const bool takes_none = !plan.sensor && !plan.seeks_sensor;  // they do not say one place
  for (std::size_t i = 0; i < sources.size(); ++i) {
    if (!sources[i]) continue;  // without points
    std::vector<std::string> texts;
    if (!takes_none) texts = notes_on_grid({.origin = sources[i]->origin(), .source = sources[i]});
    if (takes_none && seeks_outliers(plan.params))
      texts.push_back(
          std::string("the inputs do not say one place of the sensor for all points, so a run in tiles takes "
                      "none: points between two surfaces (mixed pixels) are not looked for") +
          (sources.size() > 1 ? "; --each treats every file on its own" : ""));
    for (std::string& text : texts) plan.files[i].notes.push_back({FileNote::Kind::on_unfound_sensor, std::move(text)});
  }
}

void refuse_losses(const std::filesystem::path& output, const std::vector<FileNote>& notes) {
  std::vector<std::string> lost;
  for (const FileNote& note : notes)
    if (note.kind == FileNote::Kind::loss || note.kind == FileNote::Kind::loss_by_removal) lost.push_back(note.text);
  io::refuse_losses(output, lost);
}

std::string coordinate_system_of(const Source& source) {
  std::string system;
  for (const auto& [name, value] : source.info().rows)
    if (name == "coordinate_system") system = value;
  for (char& c : system)
    if (static_cast<unsigned char>(c) < ' ') c = ' ';
  return system;
}

std::vector<NamedSystem> named_systems(std::span<const InputFile> files) {
  std::map<std::string, NamedSystem> of_codes;
  for (const InputFile& file : files) {
    const std::size_t code = file.coordinate_system.rfind("EPSG:");
    if (code == std::string::npos) continue;  // the same system may have many names
    NamedSystem& system = of_codes[file.coordinate_system.substr(code)];
    if (system.files++ == 0) system = {file.coordinate_system, 1, file.path};
  }
  std::vector<NamedSystem> systems;
  for (auto& [code, system] : of_codes) systems.push_back(std::move(system));
  std::ranges::stable_sort(systems, std::greater(), &NamedSystem::files);
  return systems;
}

}  // namespace pointfair::scale
