// SPDX-License-Identifier: Apache-2.0
// pointfair noise IN OUT: a noisy cloud made from a mesh or a cloud.
#include <fmt/format.h>
#include <fmt/ranges.h>

#include <iterator>
#include <memory>

#include "arguments.hpp"
#include "output.hpp"
#include "pointfair/pointfair.hpp"
#include "sampling.hpp"
#include "verbs.hpp"

namespace pointfair::cli {
namespace {

struct NoiseArguments {
  std::string input, output, sigma = "0", outliers = "0";
  std::optional<std::uint64_t> points;
  std::optional<double> uneven;
  std::uint64_t seed = 1;
  unsigned threads = 0;
  InputArguments in;
  FormatArguments format;
  bool force = false, quiet = false;
};

void check_arguments(const NoiseArguments& arguments) {
  if (arguments.uneven && !arguments.points)
    throw Error(ErrorKind::usage, "--uneven needs --points N: only a mesh that is sampled has a density to vary");
  if (!arguments.force) check_not_same(arguments.input, arguments.output, "name another output");
  check_writable(arguments.output, arguments.force);
}

Cloud sample(const Cloud& mesh, const NoiseArguments& arguments) {
  const auto faces = triangles(mesh);
  if (faces.empty())
    throw Error(ErrorKind::usage,
                fmt::format("{}: has no faces to sample; leave --points out to take its points", arguments.input));
  return {
      .origin = mesh.origin,
      .points = sample_surface(mesh.points, faces, *arguments.points, arguments.uneven.value_or(1), arguments.seed)};
}

// Sampled points are new ones, with nothing but their place; faces are what they are sampled from.
std::string lost_by_sampling(const Cloud& mesh) {
  constexpr std::size_t kListed = 5;
  std::vector<std::string> lost = contents(mesh);
  if (lost.empty()) return {};
  if (lost.size() > kListed) {
    lost.resize(kListed);
    lost.emplace_back("more");
  }
  return fmt::format("the sampled points have positions only, and the result lacks {}", fmt::join(lost, ", "));
}

// `diagonal` is that of what was read; the spacing is that of the points that get the noise.
double in_file_units(Length length, double diagonal, const Cloud& cloud, std::stop_token stop) {
  if (length.unit == Length::Unit::percent) return length.value * diagonal / 100;
  if (length.unit == Length::Unit::metre) {
    const std::optional<double> metres = file_info(cloud).metres_per_unit;
    if (metres) return length.value / *metres;
    throw Error(
        ErrorKind::usage,
        "--sigma: the file does not say how long its unit is; give the length in file units, without mm, cm, m or ft");
  }
  if (length.unit != Length::Unit::spacing) return length.value;
  Pipeline pipeline(Device::cpu);
  pipeline.load(cloud);
  return length.value * pipeline.estimates(stop).spacing;
}

void noise(const NoiseArguments& arguments, std::stop_token stop) {
  const Length sigma = parse_length("sigma", arguments.sigma);
  const double outliers = parse_share("outliers", arguments.outliers);
  check_arguments(arguments);
  WriteOptions write_options = make_write_options(arguments.format, arguments.output);
  write_options.overwrite = arguments.force;
  write_options.threads = arguments.threads;
  if (arguments.points && !write_options.format) write_options.format = Format::ply;  // on standard output
  const auto limit = limit_threads(arguments.threads);
  Cloud cloud = read(arguments.input, make_read_options(arguments.in, arguments.threads));
  const double diagonal = bounding_box(cloud.points).diagonal();
  std::vector<std::string> notes;
  if (arguments.points) {
    const std::string lost = lost_by_sampling(cloud);
    if (!lost.empty() && write_options.strict)
      throw Error(ErrorKind::file, fmt::format("{}: {}; leave out --strict", arguments.output, lost));
    if (!lost.empty()) notes.push_back(lost);
    cloud = sample(cloud, arguments);
  }
  const double width = in_file_units(sigma, diagonal, cloud, stop);
  if (width > 0) add_noise(cloud.points, width, arguments.seed);
  if (outliers > 0) add_outliers(cloud.points, outliers, arguments.seed);
  write(arguments.output, cloud, write_options);
  if (arguments.quiet) return;
  print_message("{} points, sigma {:.6g}\n", cloud.points.size(), width);
  if (width == 0 && outliers == 0 && !arguments.points)
    print_message("note: no noise was added; --sigma gives its width, as 0.3% of the diagonal\n");
  std::ranges::move(losses(cloud, write_options.format, write_options.encoding), std::back_inserter(notes));
  for (const std::string& note : notes) print_message("note: {}\n", note);
}

}  // namespace

Verb add_noise(CLI::App& app) {
  const auto arguments = std::make_shared<NoiseArguments>();
  CLI::App& command = *app.add_subcommand("noise", "Sample a mesh, add noise.");
  command.add_option("IN", arguments->input, "mesh or cloud to read")->required();
  command.add_option("OUT", arguments->output, "cloud to write")->required();
  command.add_option("--points", arguments->points, "sample the mesh at N random places, uniformly by area")
      ->check(whole_number_from(1))
      ->type_name("N");
  command
      .add_option("--sigma", arguments->sigma,
                  "standard deviation of the noise in each direction: 0.3% of the diagonal, 2s spacings")
      ->type_name("LENGTH");
  command.add_option("--uneven", arguments->uneven, "let the density vary by this ratio along the longest axis")
      ->check(number_within(1, 1e6))
      ->type_name("RATIO");
  command
      .add_option("--outliers", arguments->outliers,
                  "move this share of the points anywhere in the bounding box, grown by 10 %")
      ->type_name("SHARE");
  command.add_option("--seed", arguments->seed, "the same seed gives the same bytes on any machine")
      ->check(whole_number_from(0))
      ->type_name("N");
  add_threads(command, arguments->threads);
  add_input(command, arguments->in);
  add_format(command, arguments->format);
  command.add_flag("--force", arguments->force, "replace OUT if it exists");
  command.add_flag("-q,--quiet", arguments->quiet, "print errors only");
  return {&command, [arguments](std::stop_token stop) { noise(*arguments, stop); }};
}

}  // namespace pointfair::cli
