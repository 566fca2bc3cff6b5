// SPDX-License-Identifier: Apache-2.0
// pointfair compare A B: distances of a cloud to a mesh or another cloud.
#include <fmt/format.h>

#include <filesystem>
#include <iterator>
#include <memory>

#include "arguments.hpp"
#include "comparison.hpp"
#include "distances.hpp"
#include "output.hpp"
#include "pointfair/pointfair.hpp"
#include "report.hpp"
#include "verbs.hpp"

namespace pointfair::cli {
namespace {

struct CompareArguments {
  std::string cloud, reference, as = "auto", report;
  std::optional<double> edges;
  std::optional<int> normals;
  InputArguments in;
  unsigned threads = 0;
};

std::string line(std::string_view name, double value, double diagonal) {
  const std::string percent = diagonal > 0 ? fmt::format("  {:.4f} %", 100 * value / diagonal) : "";
  return fmt::format("{:<10}{:<12.6g}{}\n", name, value, percent);
}

std::string faces_text(const FaceComparison& faces, double diagonal) {
  std::string text = fmt::format("{} faces against those of the mesh\n", faces.faces);
  fmt::format_to(std::back_inserter(text), "{:<10}{:.3f} degrees\n{:<10}{}\n", "angle", faces.normal_error, "folded",
                 faces.folded);
  if (faces.turned)
    text += fmt::format(
        "{:<10}by area, most faces of A look the other way than B's: angle and folded are of all of them turned "
        "round\n",
        "turned");
  text += line("back mean", faces.back.mean, diagonal);
  text += line("back max", faces.back.max, diagonal);
  if (faces.volume && faces.reference)
    fmt::format_to(std::back_inserter(text), "{:<10}{:<12.6g}  {:.4f} %\n", "volume", *faces.volume,
                   100 * *faces.volume / *faces.reference);
  return text;
}

std::string comparison_text(const Distances& comparison) {
  const double diagonal = comparison.diagonal;
  std::string text = fmt::format("{} points against a {}, diagonal {:.6g}\n", comparison.points,
                                 comparison.mesh ? "mesh" : "cloud", diagonal);
  text += line("mean", comparison.distance.mean, diagonal);
  text += line("rms", comparison.distance.rms, diagonal);
  text += line("p95", comparison.distance.p95, diagonal);
  text += line("max", comparison.distance.max, diagonal);
  fmt::format_to(std::back_inserter(text), "{:<10}{:.6g}\n", "chamfer", comparison.chamfer);
  if (comparison.edge_rms) {
    text += line("edge rms", *comparison.edge_rms, diagonal);
    fmt::format_to(std::back_inserter(text), "{:<10}of {} points\n", "", comparison.edge_points);
  }
  if (comparison.normal_error)
    fmt::format_to(std::back_inserter(text), "{:<10}{:.3f} degrees\n", "normals", *comparison.normal_error);
  if (comparison.faces) text += faces_text(*comparison.faces, diagonal);
  return text;
}

Json faces_json(const FaceComparison& faces) {
  const auto or_null = [](const std::optional<double>& value) { return value ? Json(*value) : Json(); };
  return {{"faces", faces.faces},
          {"folded", faces.folded},
          {"normal_error", faces.normal_error},
          {"turned", faces.turned},
          {"back", statistics_json(faces.back)},
          {"volume", or_null(faces.volume)},
          {"reference_volume", or_null(faces.reference)}};
}

Json comparison_json(const Distances& comparison) {
  Json json = {{"points", comparison.points}, {"diagonal", comparison.diagonal}};
  json.update(statistics_json(comparison.distance));
  json["chamfer"] = comparison.chamfer;
  json["edge_rms"] = comparison.edge_rms ? Json(*comparison.edge_rms) : Json();
  json["edge_points"] = comparison.edge_points;
  json["normal_error"] = comparison.normal_error ? Json(*comparison.normal_error) : Json();
  json["faces"] = comparison.faces ? faces_json(*comparison.faces) : Json();
  return json;
}

bool are_alike(const std::filesystem::path& a, const std::filesystem::path& b) {
  return a.extension() == b.extension();
}

void compare(const CompareArguments& arguments) {
  if (arguments.cloud == "-" && arguments.reference == "-")
    throw Error(ErrorKind::usage, "standard input holds one cloud; name a file for the other");
  check_report(arguments.report, {arguments.cloud, arguments.reference});
  const auto limit = limit_threads(arguments.threads);
  const ReadOptions options = make_read_options(arguments.in, arguments.threads);
  const Cloud cloud = read(arguments.cloud, options);
  // what is said of A holds for B where both are files of one kind
  ReadOptions plain{.threads = arguments.threads};
  const Cloud reference = read(arguments.reference, are_alike(arguments.cloud, arguments.reference) ? options : plain);
  check_same_unit(cloud, reference, arguments.cloud + ", " + arguments.reference);
  const Distances comparison = compare_clouds(cloud, reference,
                                              {arguments.as == "cloud",
                                               arguments.edges,
                                               arguments.normals,
                                               arguments.threads,
                                               {arguments.cloud, arguments.reference}});
  write_report(arguments.report, comparison_json(comparison));
  if (arguments.report != "-") print_output(comparison_text(comparison));
}

}  // namespace

Verb add_compare(CLI::App& app) {
  const auto arguments = std::make_shared<CompareArguments>();
  CLI::App& command = *app.add_subcommand("compare", "Measure distances of cloud A to mesh or cloud B.");
  command.add_option("A", arguments->cloud, "cloud to measure")->required();
  command.add_option("B", arguments->reference, "mesh or cloud to measure against")->required();
  add_choice(command, "--as", arguments->as, {"auto", "cloud"},
             "auto: B is a mesh if it has faces; cloud: use only its points");
  command.add_option("--edges", arguments->edges, "also measure near edges whose faces differ by more than this angle")
      ->check(number_within(0, 180))
      ->type_name("DEGREES");
  command
      .add_option("--normals", arguments->normals, "also measure the normals of planes through the K nearest points")
      ->check(CLI::Range(3, kMaxNeighbors).description(""))
      ->type_name("K");
  add_input(command, arguments->in);
  add_threads(command, arguments->threads);
  add_report(command, arguments->report);
  command.footer(
      "Distances are in the file's unit and in % of the diagonal of B's bounding box. chamfer is the mean squared\n"
      "distance to the nearest point from A to B plus that from B to A, where B's bounding sphere has radius 1.\n"
      "normals, normal_error in a report, is the mean angle in degrees between the normals of A's points, by\n"
      "--normals, and those of the nearest faces, without their sign.\n"
      "Where A has faces too, and B is taken as a mesh: angle, the mean angle between the faces' normals and B's,\n"
      "folded faces (by more than 90 degrees), the distances of B's vertices to A's faces, and the volume in % of\n"
      "B's where both are closed. Faces of the same corners are compared with each other, others with the nearest\n"
      "face of B. Where most of A's area faces the other way than B's, all of A's faces are turned round first, and\n"
      "a line says so.\n"
      "Options of the input are for A, and for B if its name has the same extension.");
  return {&command, [arguments](std::stop_token) { compare(*arguments); }};
}

}  // namespace pointfair::cli
