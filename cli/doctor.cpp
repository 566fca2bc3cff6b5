// SPDX-License-Identifier: Apache-2.0
// pointfair doctor: what this build can do on this machine.
#include <fmt/format.h>
#include <fmt/ranges.h>

#include <iterator>
#include <memory>

#include "arguments.hpp"
#include "output.hpp"
#include "pointfair/pointfair.hpp"
#include "report.hpp"
#include "verbs.hpp"

namespace pointfair::cli {
namespace {

#if defined(__clang__)
constexpr std::string_view kCompiler = "clang " __clang_version__;
#else
constexpr std::string_view kCompiler = "gcc " __VERSION__;
#endif

constexpr std::string_view kBuild =
#ifdef NDEBUG
    "release";
#else
    "debug";
#endif

std::string device_text(const DeviceStatus& status) {
  std::string text = fmt::format("{:<10}{}: {}", device_name(status.info.kind), status.info.name,
                                 status.usable ? "usable" : "not usable");
  if (!status.info.reason.empty()) fmt::format_to(std::back_inserter(text), " ({})", status.info.reason);
  text += '\n';
  for (const std::string& detail : status.details) fmt::format_to(std::back_inserter(text), "          {}\n", detail);
  return text;
}

std::string doctor_text(const std::vector<DeviceStatus>& devices) {
  std::string text = fmt::format("pointfair {}, {}, {}\n", version(), kBuild, kCompiler);
  for (const DeviceStatus& status : devices) text += device_text(status);
  return text + fmt::format("formats   {}\n", fmt::join(format_names(), ", "));
}

Json doctor_json(const std::vector<DeviceStatus>& devices) {
  Json list = Json::array();
  for (const DeviceStatus& status : devices) {
    Json device = device_json(status.info);
    device["usable"] = status.usable;
    device["details"] = status.details;
    list.push_back(device);
  }
  return {{"version", version()},
          {"build", kBuild},
          {"compiler", kCompiler},
          {"devices", list},
          {"formats", format_names()}};
}

void doctor(const std::string& report) {
  check_report(report, {});
  const std::vector<DeviceStatus> devices = list_devices();
  write_report(report, doctor_json(devices));
  if (report != "-") print_output(doctor_text(devices));
}

}  // namespace

Verb add_doctor(CLI::App& app) {
  struct DoctorArguments {
    std::string report;
    bool losses = false;
  };
  const auto arguments = std::make_shared<DoctorArguments>();
  CLI::App& command = *app.add_subcommand("doctor", "List devices, formats, versions.");
  add_report(command, arguments->report);
  command.add_flag("--losses", arguments->losses, "print what each format keeps of what others hold, as a table");
  return {&command, [arguments](std::stop_token) {
            arguments->losses ? print_output(losses_table()) : doctor(arguments->report);
          }};
}

}  // namespace pointfair::cli
