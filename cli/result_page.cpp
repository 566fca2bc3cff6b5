// SPDX-License-Identifier: Apache-2.0
#include "result_page.hpp"

#include <fmt/chrono.h>
#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <ctime>
#include <future>
#include <limits>
#include <map>
#include <optional>

#include "comparison.hpp"
#include "file_rows.hpp"
#include "html.hpp"
#include "picture.hpp"
#include "report.hpp"
#include "sha256.hpp"

namespace pointfair::cli {
namespace {

namespace fs = std::filesystem;

constexpr std::size_t kDrawn = 2'000'000;  // points of a picture; there are 300,000 pixels
constexpr double kDetail = 90;             // spacings across the near pictures, or a third of the whole if that is less
constexpr std::size_t kQuantiled = 200'000;

// Lengths for people: in millimetres or metres where the file says how long its unit is.
class Lengths {
 public:
  explicit Lengths(const FileInfo& info) : metres_(info.metres_per_unit) {}
  std::string operator()(double value) const { return length_text(value, metres_) + (metres_ ? "" : " units"); }
  std::string unit() const {
    if (!metres_) return "not said by the file; lengths are in its unit";
    return fmt::format("{:.10g} m, as the file says", *metres_);
  }

 private:
  std::optional<double> metres_;
};

// Finite values of a sample.
double quantile(const std::vector<float>& values, double share) {
  std::vector<float> sample;
  const std::size_t stride = std::max<std::size_t>(1, values.size() / kQuantiled);
  for (std::size_t i = 0; i < values.size(); i += stride)
    if (std::isfinite(values[i])) sample.push_back(values[i]);
  if (sample.empty()) return 0;
  const auto at = sample.begin() + static_cast<std::ptrdiff_t>(share * double(sample.size() - 1));
  std::nth_element(sample.begin(), at, sample.end());
  return *at;
}

std::string counted(std::uint64_t count) {
  std::string text = std::to_string(count);
  for (std::size_t i = text.size(); i > 3; i -= 3) text.insert(i - 3, 1, ',');
  return text;
}

std::string share_of(std::uint64_t part, std::uint64_t all) {
  return all == 0 ? counted(part) : fmt::format("{} ({:.3g} %)", counted(part), 100.0 * double(part) / double(all));
}

class PageMaker {
  // Work that another thread does, or this one once it is asked for.
  template <class Work>
  auto beside_this(Work work) const {
    return std::async(job_.reading.threads == 1 ? std::launch::deferred : std::launch::async, std::move(work));
  }

 public:
  PageMaker(const PageJob& job, const Cloud& before, Pipeline& pipeline, std::stop_token stop)
      : job_(job), before_(before), pipeline_(pipeline), stop_(stop), length_(file_info(before)) {}

  std::string make() {
    std::future<std::string> input_sum = beside_this([&] { return sha256_of(job_.input); });
    after_ = read(job_.output, job_.reading);
    std::future<std::string> output_sum = beside_this([&] { return sha256_of(job_.output); });
    compare();
    estimates_ = pipeline_.estimates(stop_);
    noise_.resize(before_.points.size());
    pipeline_.noise(noise_, job_.asked, stop_);
    draw();
    const std::string html = warnings() + section_of("Before and after", before_and_after_) +
                             section_of("Noise of the input", noise_section()) +
                             section_of("How far points moved", displacement_section()) +
                             section_of("Outliers", outlier_section()) + section_of("What stayed", stayed_section()) +
                             section_of("Files", files_section(input_sum.get(), output_sum.get())) +
                             section_of("How it was made", made_section());
    return page_of(job_.output.filename().string(), lead(), html);
  }

  // Of two files whose run is not known: neither what it chose nor what it left out.
  std::vector<std::string> notes_on_pair(std::optional<double> metres_per_unit) const {
    constexpr double kOfAnother = 0.5;  // diagonals; no denoising moves points so far
    const Statistics& moved = copy_.displacement;
    std::vector<std::string> notes;
    if (moved.p95 > kOfAnother * estimates_.diagonal && estimates_.diagonal > 0)
      notes.push_back(fmt::format(
          "points lie up to {} from where they were, which is more than half of the cloud: {} "
          "seems to be no result of {}",
          length_text(moved.max, metres_per_unit), job_.output.filename().string(), job_.input.filename().string()));
    std::ranges::move(notes_on_run({}, estimates_, {}, {moved.mean, moved.rms, moved.p95, moved.max},
                                   stored_float_step(before_, estimates_), metres_per_unit),
                      std::back_inserter(notes));
    std::ranges::move(notes_on_units(before_), std::back_inserter(notes));
    return notes;
  }

 private:
  // Points that are not in the result have no displacement.
  void compare() {
    const Cloud remaining = job_.removed.empty() ? Cloud() : without_points(before_, job_.removed);
    copy_ = compare_copies(job_.removed.empty() ? before_ : remaining, after_,
                           fmt::format("{}, {}", job_.input.string(), job_.output.string()));
    moved_ = copy_.moved;
    if (job_.removed.empty()) return;
    moved_.assign(before_.points.size(), std::numeric_limits<float>::quiet_NaN());
    for (std::size_t i = 0, of_result = 0; i < moved_.size(); ++i)
      if (job_.removed[i] == 0) moved_[i] = copy_.moved[of_result++];
  }

  std::string typical_noise() const {
    const bool is_given = job_.noise_attribute.empty() && !job_.asked.noise.is_automatic() && job_.run;
    return fmt::format("{} ({})", length_(is_given ? job_.run->params.noise.value : estimates_.noise),
                       noise_source(job_.run ? job_.asked : Params{}, job_.noise_attribute));
  }

  std::string lead() const {
    return fmt::format("{} points, {}. Noise of the input {}; points moved {} on average, {} at most.",
                       counted(before_.points.size()), job_.run ? "denoised by pointfair" : "compared with their input",
                       typical_noise(), length_(copy_.displacement.mean), length_(copy_.displacement.max));
  }

  std::string warnings() const {
    std::string items;
    for (const std::string& note : job_.run ? job_.notes : notes_on_pair(file_info(before_).metres_per_unit))
      items += fmt::format("<li>{}</li>\n", escaped(note));
    return section_of("Warnings", items.empty() ? items : fmt::format("<ul class=\"warnings\">\n{}</ul>\n", items));
  }

  Camera for_result(Camera camera) const {
    for (std::size_t axis = 0; axis < 3; ++axis) camera.centre[axis] -= after_.origin[axis] - before_.origin[axis];
    return camera;
  }

  // All pictures, since they share what is seen.
  void draw() {
    const std::size_t stride = 1 + before_.points.size() / kDrawn;
    const Camera far = overview(before_.points);
    auto original_seen = beside_this([&] { return see(far, before_.points, estimates_.spacing, stride); });
    std::future<std::string> from_near = beside_this([&] { return pictures_from_near(far); });
    const Seen denoised = see(for_result(far), after_.points, estimates_.spacing, stride);
    const Seen original = original_seen.get();
    std::future<std::string> maps = beside_this([&] {
      displacement_map_ =
          map_of(denoised, copy_.moved, "how far each point moved, in colours", "How far points moved.");
      return map_of(original, noise_, "the noise at each point, in colours", "The standard deviation of the noise.");
    });
    const std::string name = before_.points.empty() ? "no points" : "the cloud";
    before_and_after_ = beside({figure_of(shaded_png(original), name + " before", "Before."),
                                figure_of(shaded_png(denoised), name + " after", "After, from the same place.")});
    draw_outliers(original, far);
    before_and_after_ += from_near.get();
    noise_map_ = maps.get();
  }

  std::string pictures_from_near(const Camera& far) const {
    if (!(estimates_.spacing > 0)) return {};
    const double across = std::min(kDetail * estimates_.spacing, kPictureWidth / far.pixels_per_unit / 3);
    const Camera near = detail(far, before_.points, across);
    auto after = beside_this([&] { return shaded_png(see(for_result(near), after_.points, estimates_.spacing, 1)); });
    const std::string before = shaded_png(see(near, before_.points, estimates_.spacing, 1));
    return beside({figure_of(before, "a part of it before, from near",
                             fmt::format("Before: a part of {} across.", length_(across))),
                   figure_of(after.get(), "the same part after, from near", "After: the same part.")});
  }

  std::string map_of(const Seen& seen, const std::vector<float>& values, std::string_view alt,
                     std::string_view caption) const {
    const double most = quantile(values, 0.98);
    const auto share = [&](std::uint32_t i) { return most > 0 ? float(values[i] / most) : 0.0f; };
    return figure_of(mapped_png(seen, share), alt, caption,
                     scale_of(kMapColours, "0", length_(most) + " or more (98 % have less)"));
  }

  void draw_outliers(const Seen& seen, const Camera& camera) {
    std::vector<Mark> marks;
    for (std::size_t i = 0; i < job_.outliers.size(); ++i) {
      if (job_.outliers[i] > 0 && job_.outliers[i] <= kMarkColours.size())
        marks.push_back({before_.points[i], job_.outliers[i] - std::size_t{1}});
    }
    if (marks.empty()) return;
    constexpr const char* kReasons[] = {"isolated", "off the surface", "mixed pixel"};
    std::string key = "<p>";
    for (std::size_t i = 0; i < kMarkColours.size(); ++i)
      key += fmt::format("<span class=\"swatch\" style=\"background: {}\"></span>{} ", kMarkColours[i], kReasons[i]);
    outlier_picture_ = figure_of(marked_png(seen, camera, marks), "the outliers in colours before the grey cloud",
                                 "Outliers, wherever they are in depth.", key + "</p>");
  }

  std::string noise_section() const {
    const auto& [quiet, typical, loud] = estimates_.noise_quantiles;
    const std::string table = table_of("Noise (standard deviation across the surface)",
                                       {{"typical", typical_noise()},
                                        {"at quiet, typical and loud places",
                                         fmt::format("{}, {}, {}", length_(quiet), length_(typical), length_(loud))},
                                        {"mean distance between points", length_(estimates_.spacing)}});
    return beside({noise_map_, table}).append(parts_table());
  }

  // By class, or by scan.
  std::string parts_table() const {
    for (const char* const name : {"classification", "scan"}) {
      const std::optional<AttributeInfo> info = attribute_info(before_, name);
      if (info && info->components == 1) return parts_table(name, parts_of(name));
    }
    return {};
  }

  // Integers; empty where they are none.
  std::vector<std::int64_t> parts_of(std::string_view name) const {
    const Attribute values = attribute(before_, name);
    if (values.type == ScalarType::float32 || values.type == ScalarType::float64) return {};
    std::vector<std::int64_t> result(before_.points.size());
    for (std::size_t i = 0; i < result.size(); ++i) result[i] = static_cast<std::int64_t>(value_at(values, i));
    return result;
  }

  std::string parts_table(const std::string& name, const std::vector<std::int64_t>& parts) const {
    constexpr std::size_t kMost = 64;  // rows
    std::map<std::int64_t, std::vector<std::uint32_t>> members;
    for (std::uint32_t i = 0; i < parts.size() && members.size() <= kMost; ++i) members[parts[i]].push_back(i);
    if (members.empty() || members.size() > kMost) return {};
    const bool is_class = name == "classification";
    std::vector<std::vector<std::string>> rows{
        {is_class ? "class" : name, "points", "median noise", "moved on average"}};
    for (const auto& [part, points] : members) {
      std::vector<float> noise;
      double sum = 0, finite = 0;
      for (const std::uint32_t i : points) {
        noise.push_back(noise_[i]);
        if (!std::isfinite(moved_[i])) continue;
        sum += moved_[i];
        ++finite;
      }
      const std::string title =
          is_class ? fmt::format("{} {}", part, class_name(static_cast<unsigned>(part))) : std::to_string(part);
      rows.push_back(
          {title, counted(points.size()), length_(quantile(noise, 0.5)), length_(finite > 0 ? sum / finite : 0)});
    }
    return grid_of(is_class ? "By class" : "By scan", rows);
  }

  std::string displacement_section() const {
    constexpr std::size_t kBars = 48;
    const Statistics& moved = copy_.displacement;
    const double most = std::max(quantile(copy_.moved, 0.99), 1e-300);
    std::vector<double> counts(kBars);
    for (const float length : copy_.moved)
      if (length > 0 && length <= most)
        ++counts[std::min(kBars - 1, static_cast<std::size_t>(length / most * double(kBars)))];
    const std::string alt = fmt::format("how many points moved how far: half of them less than {}, 95 % less than {}",
                                        length_(quantile(copy_.moved, 0.5)), length_(moved.p95));
    std::string table =
        table_of("Displacement", {{"mean", length_(moved.mean)},
                                  {"root mean square", length_(moved.rms)},
                                  {"95 % of the points moved less than", length_(moved.p95)},
                                  {"most", length_(moved.max)},
                                  {"points at their old place", share_of(copy_.kept, before_.points.size())}});
    if (moved.max > 0) table.append(histogram_of(counts, alt, length_(most), "points by displacement"));
    return beside({displacement_map_, table});
  }

  Pairs reasons_of(const OutlierCounts& outliers) const {
    const std::uint64_t all = before_.points.size();
    return {{"isolated: too few neighbours within reach", share_of(outliers.isolated, all)},
            {"off the surface of their neighbours", share_of(outliers.off_surface, all)},
            {"mixed pixels, between two surfaces", share_of(outliers.mixed_pixels, all)}};
  }

  std::string outlier_section() const {
    std::string html;
    if (job_.run) {
      const UnmovedCounts& unmoved = job_.run->unmoved;
      const std::uint64_t all = before_.points.size();
      Pairs reasons = reasons_of(unmoved.outliers_by_reason);
      reasons.insert(reasons.end(), {{"fewer than three neighbours", share_of(unmoved.too_few_neighbors, all)},
                                     {"no normal", share_of(unmoved.no_normal, all)},
                                     {"on the border of the mesh", share_of(unmoved.boundary, all)},
                                     {"not finite, or ignored", share_of(unmoved.non_finite, all)}});
      if (job_.held > 0) reasons.emplace_back("others, held by limits such as a box", share_of(job_.held, all));
      html =
          table_of(job_.removed.empty() ? "Why points were kept in place" : "Why points were kept in place, or removed",
                   reasons);
      if (job_.run->pulled.total() > 0)
        html += table_of("Why points were pulled in as outliers", reasons_of(job_.run->pulled));
    } else if (!job_.outliers.empty()) {
      const auto marked = job_.outliers.size() - std::size_t(std::ranges::count(job_.outliers, 0));
      html = table_of("Marked in the result", {{"outliers", share_of(marked, before_.points.size())}});
    }
    return outlier_picture_.empty() ? html : beside({outlier_picture_, html});
  }

  std::string stayed_section() const {
    std::vector<std::vector<std::string>> rows{{"what", "in the result"}};
    const std::size_t removed = before_.points.size() - after_.points.size();
    rows.push_back(
        {"points",
         fmt::format("{}, {}, {}", counted(after_.points.size()),
                     removed == 0 ? "as many as before" : counted(removed) + " removed as outliers",
                     job_.run ? "in the same order" : "each compared with the one at its place in the file")});
    for (const Comparison::Row& row : copy_.rows)
      rows.push_back({row.what, row.differ != 0 ? counted(row.differ) + " differ"
                                : row.has_bytes ? "the same, byte for byte"
                                                : "the same values, stored in another type"});
    if (const auto differ = copy_.faces_that_differ)
      rows.push_back({"corners of the faces", *differ == 0 ? "the same" : counted(*differ) + " faces differ"});
    for (const std::string& name : copy_.lost) rows.push_back({name, "not there"});
    for (const std::string& name : copy_.added) rows.push_back({name, "new"});
    return grid_of("Compared after the result was written", rows) +
           "<p>Nothing else was compared: a file may also hold texture coordinates of corners, materials, parts, "
           "values of faces or comments.</p>\n";
  }

  std::string files_section(const std::string& input_sum, const std::string& output_sum) const {
    return file_table("Input", job_.input, before_, input_sum) + file_table("Result", job_.output, after_, output_sum) +
           (job_.run ? "<p>The same input, version and parameters give the same bits on any machine, any number of "
                       "threads, and any device. Whoever repeats the command gets a result with this checksum.</p>\n"
                     : "");
  }

  std::string file_table(std::string_view caption, const fs::path& path, const Cloud& cloud,
                         const std::string& sum) const {
    std::error_code failed;
    Pairs pairs{{"name", path.filename().string()},
                {"bytes", counted(fs::file_size(path, failed))},
                {"SHA-256", sum},
                {"points", counted(cloud.points.size())},
                {"length of the unit", Lengths(file_info(cloud)).unit()}};
    for (const FileInfo::Row& row : file_info(cloud).rows) pairs.emplace_back(row.name, row.value);
    return table_of(caption, pairs);
  }

  // Lengths as elsewhere on the page.
  std::string value_of(const Params& params, const ParamInfo& info) const {
    const auto* const length = std::get_if<Length Params::*>(&info.field);
    const bool is_of_file = length && (params.*(*length)).unit == Length::Unit::file;
    return is_of_file ? length_((params.*(*length)).value) : param_text(params, info);
  }

  std::string made_section() const {
    const DeviceInfo device = job_.run ? job_.run->device : pipeline_.device();
    Pairs pairs{
        {"command", job_.command},
        {"program", fmt::format("pointfair {}", version())},
        {"date of this page", fmt::format("{:%Y-%m-%d %H:%M} UTC", fmt::gmtime(std::time(nullptr)))},
        {job_.run ? "computed on" : "measured on", fmt::format("{}, {}", device_name(device.kind), device.name)}};
    if (job_.run) pairs.emplace_back("time of the run", fmt::format("{:.3g} s", job_.run->total_milliseconds / 1000));
    std::string html = table_of("Run", pairs);
    if (!job_.run) return html;
    Pairs used;
    const bool is_mesh = job_.run->params.connectivity == Connectivity::mesh;
    const bool is_implicit = job_.run->params.method == Method::implicit;
    for (const ParamInfo& info : kParams) {
      if (is_of_meshes(info) && !is_mesh) continue;
      if (info.name.starts_with("implicit_") && !is_implicit) continue;
      const std::string text = value_of(job_.run->params, info);
      const bool is_chosen = param_text(job_.asked, info) == "auto";
      used.emplace_back(info.name, is_chosen && text != "auto" ? fmt::format("auto ({})", text) : text);
    }
    return html + table_of("Parameters, of a typical place where they were chosen by the program", used);
  }

  const PageJob& job_;
  const Cloud& before_;
  Pipeline& pipeline_;
  std::stop_token stop_;
  Lengths length_;
  Cloud after_;
  Comparison copy_;
  Estimates estimates_;
  std::vector<float> noise_, moved_;  // of the points before; copy_ has those of the result
  std::string before_and_after_, noise_map_, displacement_map_, outlier_picture_;
};

}  // namespace

ResultPage result_page(const PageJob& job, const Cloud& before, Pipeline& pipeline, std::stop_token stop) {
  PageMaker maker(job, before, pipeline, stop);
  std::string text = maker.make();
  return {std::move(text), job.run ? job.notes : maker.notes_on_pair({})};
}

}  // namespace pointfair::cli
