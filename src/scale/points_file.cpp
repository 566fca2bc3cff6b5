// SPDX-License-Identifier: Apache-2.0
#include "scale/points_file.hpp"

#include <numeric>

#include "platform/path_text.hpp"

namespace pointfair::scale {

Grouped::Grouped(std::span<const std::uint32_t> group_of, std::size_t groups) : begins(groups + 1, 0) {
  for (const std::uint32_t group : group_of)
    if (group != kNone) ++begins[group + 1];
  std::partial_sum(begins.begin(), begins.end(), begins.begin());
  order.resize(begins.back());
  std::vector<std::uint64_t> next = begins;
  for (std::size_t i = 0; i < group_of.size(); ++i)
    if (group_of[i] != kNone) order[next[group_of[i]]++] = static_cast<std::uint32_t>(i);
}

PointsWriter::PointsWriter(const std::filesystem::path& path, PointsHeader header, const std::vector<Section>& sections,
                           const std::vector<double>& numbers)
    : file_(path, [&] {
        header.sections = sections.size();
        header.numbers = numbers.size();
        header.points = 0;
        for (const Section& section : sections) header.points += section.count;
        return header.size();
      }()) {
  file_.write(&header, sizeof header);
  file_.write(std::span(sections));
  file_.write(std::span(numbers));
}

PointsFile::PointsFile(const std::filesystem::path& path) : file_(path) {
  file_.read(0, &header_, sizeof header_);
  if (header_.magic != PointsHeader().magic || header_.size() != file_.size())
    throw Error(ErrorKind::file, platform::text_of(path) + ": is damaged; remove it and run again");
}

std::vector<Section> PointsFile::sections() const {
  std::vector<Section> sections(header_.sections);
  file_.read(sizeof(PointsHeader), std::span(sections));
  return sections;
}

std::vector<double> PointsFile::numbers() const {
  std::vector<double> numbers(header_.numbers);
  file_.read(sizeof(PointsHeader) + header_.sections * sizeof(Section), std::span(numbers));
  return numbers;
}

void PointsFile::positions(std::uint64_t first, std::span<Point> out) const {
  file_.read(header_.positions_at() + first * sizeof(Point), out);
}

void PointsFile::indices(std::uint64_t first, std::span<std::uint64_t> out) const {
  if (header_.index_bytes == sizeof(std::uint64_t)) {
    file_.read(header_.indices_at() + first * sizeof(std::uint64_t), out);
    return;
  }
  std::vector<std::uint32_t> differences(out.size());
  short_indices(first, differences);
  std::ranges::transform(differences, out.begin(),
                         [&](std::uint32_t difference) { return header_.first_index + difference; });
}

void PointsFile::short_indices(std::uint64_t first, std::span<std::uint32_t> out) const {
  file_.read(header_.indices_at() + first * sizeof(std::uint32_t), out);
}

}  // namespace pointfair::scale
