// SPDX-License-Identifier: Apache-2.0
// pointfair certify IN OUT: the page on a result that is there.
#include <fmt/format.h>

#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "arguments.hpp"
#include "command_line.hpp"
#include "output.hpp"
#include "pointfair/pointfair.hpp"
#include "progress.hpp"
#include "report.hpp"
#include "result_page.hpp"
#include "verbs.hpp"

namespace pointfair::cli {
namespace {

struct CertifyArguments {
  std::string input, output, report;
  InputArguments in;
  DeviceArguments device;
  bool force = false, quiet = false;
};

// The reasons that the run marked in the result, as "outlier", or "outlier_2" where the input had that; empty where it
// did not.
std::vector<std::uint8_t> marks_in(const std::string& path, const Cloud& before, const ReadOptions& reading) {
  const Cloud cloud = read(path, reading);
  for (const AttributeInfo& info : attributes(cloud)) {
    if (!info.name.starts_with("outlier") || attribute_info(before, info.name)) continue;
    if (info.type != ScalarType::uint8 || info.components != 1) continue;
    std::vector<std::uint8_t> result;
    for (const std::byte mark : attribute(cloud, info.name).data) result.push_back(std::to_integer<std::uint8_t>(mark));
    return result;
  }
  return {};
}

void certify(CertifyArguments arguments, std::stop_token stop) {
  namespace fs = std::filesystem;
  for (const std::string& file : {arguments.input, arguments.output})
    if (is_stream(file))
      throw Error(ErrorKind::usage, file + ": certify reads its files several times; write this one to disk first");
  if (arguments.report.empty()) arguments.report = fs::path(arguments.output).replace_extension(".html").string();
  if (!is_page(arguments.report))
    throw Error(ErrorKind::usage, arguments.report + ": certify writes a page; name a file that ends in .html");
  check_page(arguments.report, {arguments.input, arguments.output});
  check_writable(arguments.report, arguments.force);
  const ReadOptions reading = make_read_options(arguments.in, arguments.device.threads);
  Pipeline pipeline(make_device(arguments.device));
  std::vector<std::string> notes;
  {
    Progress progress(arguments.quiet ? "none" : "auto");
    progress.show(0, "reading");
    const Cloud before = read(arguments.input, reading);
    check_not_geographic(before);
    pipeline.load(before);
    progress.show(0.3, "comparing");
    PageJob job;
    job.input = arguments.input;
    job.output = arguments.output;
    if (fs::path(arguments.input).extension() == fs::path(arguments.output).extension()) job.reading = reading;
    job.reading.threads = arguments.device.threads;
    job.command = command_text();
    job.outliers = marks_in(arguments.output, before, job.reading);
    ResultPage page = result_page(job, before, pipeline, stop);
    write_text(arguments.report, page.text);
    notes = std::move(page.notes);
  }
  if (arguments.quiet) return;
  print_message("the page is {}\n", arguments.report);
  for (const std::string& note : notes) print_message("note: {}\n", note);
}

}  // namespace

Verb add_certify(CLI::App& app) {
  const auto arguments = std::make_shared<CertifyArguments>();
  CLI::App& command = *app.add_subcommand("certify", "Write a page that compares a result with its input.");
  command.add_option("IN", arguments->input, "the cloud before")->required();
  command.add_option("OUT", arguments->output, "the denoised cloud, with the same points in the same order")
      ->required();
  command.add_option("--report", arguments->report, "the page; default: OUT with the extension .html")
      ->type_name("FILE.html");
  add_device(command, arguments->device);
  add_input(command, arguments->in);
  command.footer("Options of the input are for IN, and for OUT if its name has the same extension.");
  command.add_flag("--force", arguments->force, "replace the page if it exists");
  command.add_flag("-q,--quiet", arguments->quiet, "print errors only");
  return {&command, [arguments](std::stop_token stop) { certify(*arguments, stop); }};
}

}  // namespace pointfair::cli
