// SPDX-License-Identifier: Apache-2.0
// pointfair info IN: what a cloud holds, and the parameters of a typical place.
#include <fmt/format.h>

#include <cmath>
#include <iterator>
#include <limits>
#include <memory>

#include "arguments.hpp"
#include "file_rows.hpp"
#include "output.hpp"
#include "pointfair/pointfair.hpp"
#include "report.hpp"
#include "survey.hpp"
#include "verbs.hpp"

namespace pointfair::cli {
namespace {

struct InfoArguments {
  std::string input, report;
  std::vector<std::string> more;
  InputArguments in;
  DeviceArguments device;
};

// A coordinate without the digits that floats around the cloud's origin do not hold.
double rounded(double origin, double offset) {
  const double precision = std::abs(offset) * std::numeric_limits<float>::epsilon();
  if (!(precision > 0)) return origin + offset;
  const double unit = std::pow(10, std::ceil(std::log10(precision)));
  return std::round((origin + offset) / unit) * unit;
}

std::string bounds_text(const Cloud& cloud, const Estimates& estimates) {
  std::string text;
  for (std::size_t axis = 0; axis < 3; ++axis)
    fmt::format_to(std::back_inserter(text), "  {}  {:.10g} .. {:.10g}\n", "xyz"[axis],
                   rounded(cloud.origin[axis], estimates.min[axis]), rounded(cloud.origin[axis], estimates.max[axis]));
  return text;
}

std::string info_text(const Cloud& cloud, const Estimates& estimates, const Params& params) {
  std::string text = file_text(cloud);
  fmt::format_to(std::back_inserter(text), "points      {}, {} of them finite\n", estimates.points, estimates.finite);
  const auto out = std::back_inserter(text);
  if (estimates.finite > 0) {
    fmt::format_to(out, "bounds\n{}", bounds_text(cloud, estimates));
    fmt::format_to(out, "diagonal    {:.6g}\n", estimates.diagonal);
  }
  fmt::format_to(out, "spacing     {:.4g}\nnoise       {:.4g}\n", estimates.spacing, estimates.noise);
  if (estimates.spacing > 0) {
    fmt::format_to(out, "            {:.3g} of the spacing\n", estimates.noise / estimates.spacing);
    const auto& [quiet, typical, loud] = estimates.noise_quantiles;
    fmt::format_to(out, "            {:.4g} .. {:.4g} .. {:.4g} at quiet, typical, loud places\n", quiet, typical,
                   loud);
  }
  if (const double step = file_info(cloud).step; estimates.noise > 0 && step > estimates.noise)
    fmt::format_to(out, "            less than the step of {:.4g} between coordinates: --las-scale makes that finer\n",
                   step);
  for (const std::string& note : notes_on_cloud(estimates, stored_float_step(cloud, estimates)))
    fmt::format_to(out, "note        {}\n", note);
  const std::vector<AttributeInfo> all = attributes(cloud);
  text += all.empty() ? "attributes  none\n" : "attributes\n";
  for (const AttributeInfo& attribute : all) {
    const std::string shape = attribute.components > 1 ? fmt::format(" x {}", attribute.components) : "";
    fmt::format_to(out, "  {:<19} {}{}\n", attribute.name, type_name(attribute.type), shape);
  }
  fmt::format_to(
      out, "parameters of a typical place; a run without parameters follows each place, so these do not repeat it\n");
  for (const ParamInfo& info : kParams) fmt::format_to(out, "  {:<18} {}\n", info.name, param_text(params, info));
  return text;
}

Json info_json(const Cloud& cloud, const Estimates& estimates, const Params& typical) {
  return {{"file", file_json(cloud)},
          {"points", estimates.points},
          {"finite", estimates.finite},
          {"bounds", bounds_json(cloud, estimates)},
          {"diagonal", estimates.diagonal},
          {"attributes", attributes_json(attributes(cloud))},
          {"spacing", estimates.spacing},
          {"float_step", estimates.float_step},
          {"noise", estimates.noise},
          {"noise_quantiles", estimates.noise_quantiles},
          {"without_surface", estimates.without_surface},
          {"typical_parameters", params_json(typical)},
          {"notes", notes_on_cloud(estimates, stored_float_step(cloud, estimates))}};
}

// All automatic where nothing can be measured.
Params typical_params(Pipeline& pipeline, std::stop_token stop) {
  try {
    return pipeline.resolve({}, stop);
  } catch (const Error& error) {
    if (error.kind() != ErrorKind::usage) throw;
    return {};
  }
}

struct Known {
  Cloud cloud;
  Estimates estimates;
  Params typical;
};

Known look_at(const InfoArguments& arguments, const std::string& input, Pipeline& pipeline, std::stop_token stop) {
  Known known;
  known.cloud = read(input, make_read_options(arguments.in, arguments.device.threads));
  pipeline.load(known.cloud);
  known.estimates = pipeline.estimates(stop);
  known.typical = typical_params(pipeline, stop);
  return known;
}

void info_of_one(const InfoArguments& arguments, Pipeline& pipeline, std::stop_token stop) {
  const Known known = look_at(arguments, arguments.input, pipeline, stop);
  write_report(arguments.report, info_json(known.cloud, known.estimates, known.typical));
  if (arguments.report != "-") print_output(info_text(known.cloud, known.estimates, known.typical));
}

// Files of one table may be in feet and in metres.
std::string unit_text(const Cloud& cloud) {
  const FileInfo file = file_info(cloud);
  if (file.is_geographic) return "degrees";
  return file.metres_per_unit ? fmt::format("{:.4g} m", *file.metres_per_unit) : "unknown";
}

// A line a file, as it becomes known; those that cannot be read come at the end.
void info_of_many(const InfoArguments& arguments, const std::vector<std::filesystem::path>& files, Pipeline& pipeline,
                  std::stop_token stop) {
  const bool prints = arguments.report != "-";
  if (prints)
    print_output(
        fmt::format("{:>12} {:>10} {:>10} {:>10} {:>10}  file\n", "points", "spacing", "noise", "diagonal", "unit"));
  Json rows = Json::array();
  std::vector<Error> failures;
  for (const std::filesystem::path& file : files) {
    Json row{{"input", file.string()}};
    try {
      const Known known = look_at(arguments, file.string(), pipeline, stop);
      const Estimates& found = known.estimates;
      row.update(info_json(known.cloud, found, known.typical));
      if (prints)
        print_output(fmt::format("{:>12} {:>10.4g} {:>10.4g} {:>10.4g} {:>10}  {}\n", found.points, found.spacing,
                                 found.noise, found.diagonal, unit_text(known.cloud), file.string()));
    } catch (const NoPoints&) {
      row["points"] = row["finite"] = 0;
      if (prints)
        print_output(fmt::format("{:>12} {:>10} {:>10} {:>10} {:>10}  {}\n", 0, "-", "-", "-", "-", file.string()));
    } catch (const Error& error) {
      if (error.kind() == ErrorKind::interrupted) throw;
      row["error"] = error.what();
      failures.push_back(error);
    }
    rows.push_back(row);
  }
  write_report(arguments.report, {{"version", version()}, {"files", rows}});
  if (failures.empty()) return;
  std::vector<ErrorKind> kinds;
  for (const Error& failure : failures) {
    print_error(failure.what());
    kinds.push_back(failure.kind());
  }
  throw Error(common_kind(kinds),
              fmt::format("{} of {} files failed; the lines above say why", failures.size(), files.size()));
}

void info(const InfoArguments& arguments, std::stop_token stop) {
  check_report(arguments.report, {arguments.input});
  Pipeline pipeline(make_device(arguments.device));
  if (arguments.more.empty() && !is_survey(arguments.input)) return info_of_one(arguments, pipeline, stop);
  std::vector<std::string> inputs = {arguments.input};
  inputs.insert(inputs.end(), arguments.more.begin(), arguments.more.end());
  const std::vector<std::filesystem::path> files = files_of_survey(inputs, arguments.in.format);
  check_report(arguments.report, files);
  info_of_many(arguments, files, pipeline, stop);
}

}  // namespace

Verb add_info(CLI::App& app) {
  const auto arguments = std::make_shared<InfoArguments>();
  CLI::App& command = *app.add_subcommand("info", "Print size, spacing, noise, typical parameters.");
  command.add_option("IN", arguments->input, "cloud to read; - is standard input; also a folder of clouds, or a VPC")
      ->required();
  command.add_option("MORE", arguments->more, "more of them: a line each");
  add_device(command, arguments->device);
  add_input(command, arguments->in);
  add_report(command, arguments->report);
  return {&command, [arguments](std::stop_token stop) { info(*arguments, stop); }};
}

}  // namespace pointfair::cli
