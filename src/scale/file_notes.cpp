// SPDX-License-Identifier: Apache-2.0
#include "scale/file_notes.hpp"

#include <algorithm>

#include "io/remaining_source.hpp"
#include "io/streamed.hpp"
#include "pointfair/run_notes.hpp"
#include "scale/outlier_edits.hpp"

namespace pointfair::scale {

std::vector<FileNote> notes_on(const TiledJob& job, const std::shared_ptr<const Source>& source,
                               const std::filesystem::path& output) {
  std::vector<FileNote> notes;
  const auto add = [&](FileNote::Kind kind, const std::vector<std::string>& texts) {
    for (const std::string& text : texts) {
      std::string& line = notes.emplace_back(FileNote{kind, text}).text;
      std::ranges::replace(line, '\n', ' ');  // a file may name things so
    }
  };
  const std::string added = added_outlier_attribute(job.outlier_action, job.params, *source);
  add(FileNote::Kind::loss, io::losses_when_streamed(*source, output, job.write, added));
  if (job.outlier_action.kind == OutlierAction::Kind::remove)
    add(FileNote::Kind::loss_by_removal, io::losses_by_removal(*source));
  const Cloud shell{.origin = source->origin(), .source = source};
  add(FileNote::Kind::beside, notes_on_waveforms(shell));
  add(FileNote::Kind::on_moves, notes_on_kept_normals(shell, source->format()));
  return notes;
}

void refuse_losses(const std::filesystem::path& output, const std::vector<FileNote>& notes) {
  std::vector<std::string> lost;
  for (const FileNote& note : notes)
    if (note.kind == FileNote::Kind::loss || note.kind == FileNote::Kind::loss_by_removal) lost.push_back(note.text);
  io::refuse_losses(output, lost);
}

}  // namespace pointfair::scale
