// SPDX-License-Identifier: Apache-2.0
#include "scale/outlier_edits.hpp"

#include <algorithm>
#include <mutex>
#include <optional>
#include <utility>

#include "options/outlier_values.hpp"
#include "pipeline/outlier_marks.hpp"
#include "scale/given.hpp"
#include "scale/work_file.hpp"

namespace pointfair::scale {
namespace {

using Kind = OutlierAction::Kind;

std::optional<std::size_t> find_column(const Source& source, const std::string& name) {
  const std::vector<io::Column> columns = source.columns();
  const auto its = std::ranges::find(columns, name, &io::Column::name);
  return its == columns.end() ? std::nullopt : std::optional(static_cast<std::size_t>(its - columns.begin()));
}

// The file's own values, or zeros.
Attribute values_of(const Source& source, const std::string& name) {
  Attribute values{{name, ScalarType::uint8}, std::vector<std::byte>(static_cast<std::size_t>(source.size()))};
  if (const auto column = find_column(source, name))
    source.extract(*column, {reinterpret_cast<char*>(values.data.data()), values.data.size()});
  return values;
}

std::vector<AttributeInfo> attributes_of(const Source& source) {
  return attributes(part_of({std::shared_ptr<const Source>(), &source}, 0, {}));
}

// The attribute that has the classes of points; empty: none has.
std::string attribute_of_classes(const Source& source) {
  const std::string name = outlier_attribute({Kind::classify, {}}, attributes_of(source));
  const auto column = find_column(source, name);
  const bool are_there =
      column && source.columns()[*column].type == io::NativeType::uint8 && source.columns()[*column].components == 1;
  return are_there ? name : std::string();
}

std::string why_none_leave(const Source& source) {
  const bool can_mark = takes_attributes(source.format()) && source.format() != Format::npy;
  const bool is_usual = source.format() == Format::ply || source.format() == Format::obj;
  return source.name() +
         (is_usual
              ? ": what this file holds beside its points may tell them by their number, so a run in tiles on disk "
                "cannot leave points out; use "
              : ": a run in tiles on disk leaves points out of LAS, LAZ, PCD, PLY, OBJ and text files only; use ") +
         (can_mark ? "--outliers mark, or " : "") + "--each to treat every file on its own";
}

}  // namespace

std::string why_no_outlier_action(const OutlierAction& action, const Source& source) {
  if (action.kind == Kind::remove && !source.leaves_points_out()) return why_none_leave(source);
  if (action.kind != Kind::classify && action.kind != Kind::withhold) return {};
  const std::vector<AttributeInfo> infos = attributes_of(source);
  const std::string name = outlier_attribute(action, infos);
  const auto its = std::ranges::find(infos, name, &AttributeInfo::name);
  if (its == infos.end()) return {};
  check_outlier_attribute(*its);
  const auto column = static_cast<std::size_t>(its - infos.begin());
  io::check_fits(source.columns()[column], action.value.value_or(1));
  return source.why_fixed(column);
}

std::string added_outlier_attribute(const OutlierAction& action, const Params& params, const Source& source) {
  const bool marks = action.kind == Kind::none && params.outliers == Outliers::mark;
  if (marks) return outlier_marks(part_of({std::shared_ptr<const Source>(), &source}, 0, {}), {}).name;
  if (action.kind != Kind::classify && action.kind != Kind::withhold) return {};
  const std::string name = outlier_attribute(action, attributes_of(source));
  return find_column(source, name) ? std::string() : name;
}

void add_heights(const TileResults& results, unsigned threads, HeightGrid& heights) {
  std::mutex mutex;
  results.visit_outliers(threads, [&](const SomeOutliers& some) {
    const std::lock_guard lock(mutex);
    for (std::size_t i = 0; i < some.points.size(); ++i)
      if (some.reasons[i] == 0 && is_indexed(some.points[i])) heights.add(some.points[i]);
  });
}

void save(const HeightGrid& heights, const std::filesystem::path& path) {
  const std::int64_t exponent = heights.exponent();
  NewFile file(path, sizeof exponent + heights.cells().size() * sizeof(HeightGrid::Cell));
  file.write(&exponent, sizeof exponent);
  file.write(std::span(heights.cells()));
  file.finish();
}

HeightGrid load_heights(const std::filesystem::path& path) {
  const StoredFile file(path);
  std::int64_t exponent = 0;
  file.read(0, &exponent, sizeof exponent);
  std::vector<HeightGrid::Cell> cells((file.size() - sizeof exponent) / sizeof(HeightGrid::Cell));
  file.read(sizeof exponent, std::span(cells));
  return {static_cast<int>(exponent), std::move(cells)};
}

void add(OutlierOutcome& to, const OutlierOutcome& more) {
  for (std::size_t reason = 0; reason < to.of_reason.size(); ++reason) to.of_reason[reason] += more.of_reason[reason];
  to.low += more.low;
  to.high += more.high;
  to.in_old_classes += more.in_old_classes;
  to.thin += more.thin;
}

OutlierEdits outlier_edits(const TileResults& results, const Plan& plan, const std::shared_ptr<const Source>& source,
                           const HeightGrid& heights, unsigned threads) {
  const OutlierAction& action = plan.outlier_action;
  OutlierEdits edits;
  if (action.kind == Kind::none && plan.params.outliers != Outliers::mark) return edits;
  const bool marks = action.kind == Kind::none, has_old_classes = source->info().has_old_classes;
  Attribute classes, values;
  const std::string name_of_classes = marks ? std::string() : attribute_of_classes(*source);
  if (!name_of_classes.empty()) classes = values_of(*source, name_of_classes);
  if (const std::string name = outlier_attribute(action, attributes_of(*source)); !name.empty())
    values = name == classes.name ? classes : values_of(*source, name);
  std::vector<std::uint8_t> reasons(values.name.empty() ? static_cast<std::size_t>(source->size()) : 0);
  std::mutex mutex;
  results.visit_outliers(threads, [&](const SomeOutliers& some) {
    const auto part = [&](Attribute& all) {
      return all.data.empty() ? std::span<std::byte>() : std::span(all.data).subspan(some.first, some.points.size());
    };
    if (!reasons.empty())
      std::ranges::copy(marks ? some.marks : some.reasons, reasons.begin() + std::ptrdiff_t(some.first));
    if (marks) return;
    OutlierOutcome outcome;
    put_outlier_values(action, has_old_classes, some.reasons, some.points, heights, part(classes), part(values),
                       outcome);
    const std::lock_guard lock(mutex);
    add(edits.outcome, outcome);
  });
  if (marks) edits.added.push_back(outlier_marks(part_of(source, 0, {}), reasons));
  if (!values.name.empty()) edits.added.push_back(std::move(values));
  // without one, the file stays as it is, such as the grid of its points
  if (action.kind == Kind::remove && edits.outcome.outliers() > 0) edits.removed = std::move(reasons);
  return edits;
}

}  // namespace pointfair::scale
