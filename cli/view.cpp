// SPDX-License-Identifier: Apache-2.0
// pointfair view IN: the interactive page in the browser.
#include <fmt/format.h>

#include <memory>

#include "arguments.hpp"
#include "output.hpp"
#include "platform/system.hpp"
#include "pointfair/pointfair.hpp"
#include "verbs.hpp"
#if POINTFAIR_VIEWER
#include "viewer/server.hpp"
#endif

namespace pointfair::cli {
namespace {

struct ViewArguments {
  std::string input, host = "127.0.0.1", save_folder = ".";
  std::optional<std::uint16_t> port;
  std::uint64_t points = 3'000'000;
  std::string viewpoint;
  bool no_open = false, token = false;
  InputArguments in;
  DeviceArguments device;
};

#if POINTFAIR_VIEWER

constexpr std::uint16_t kUsualPort = 7373;

void view(const ViewArguments& arguments, std::stop_token stop) {
  if (arguments.input == "-")
    throw Error(ErrorKind::usage, "view needs a file and cannot read standard input; write the cloud to a file first");
  if (arguments.input.empty() && !arguments.viewpoint.empty())
    throw Error(ErrorKind::usage, "--viewpoint says where the sensor of a file stood; name the file");
  if (!std::filesystem::is_directory(arguments.save_folder))
    throw Error(ErrorKind::file,
                "--save-folder " + arguments.save_folder + ": is no folder; create it or name another");
  viewer::ServerOptions options;
  options.host = arguments.host;
  options.token = arguments.token;
  options.device = make_device(arguments.device);
  // in the build as where it is installed
  options.page = system::program_file().parent_path().parent_path() / "share/pointfair/web";
  options.save_folder = arguments.save_folder;
  options.point_budget = arguments.points;
  options.viewpoint = arguments.viewpoint;
  options.reading = make_read_options(arguments.in, 0);
  check_viewpoint(options.viewpoint);
  const auto ready = [&](const std::string& url) {
    print_output(url + "\n");
    if (!arguments.no_open) system::open_browser(url);
  };
  options.port = arguments.port.value_or(kUsualPort);
  options.other_port = !arguments.port;
  viewer::serve(arguments.input, options, ready, stop);
  throw Error(ErrorKind::interrupted, "interrupted");
}

#else

void view(const ViewArguments&, std::stop_token) {
  throw Error(
      ErrorKind::failed,
      "this build has no viewer: install libboost-dev, nodejs and npm, and configure with -DPOINTFAIR_VIEWER=ON");
}

#endif

}  // namespace

Verb add_view(CLI::App& app) {
  const auto arguments = std::make_shared<ViewArguments>();
  CLI::App& command = *app.add_subcommand("view", "Denoise a cloud interactively, in the browser.");
  command.add_option("IN", arguments->input, "cloud to read; without it, the page asks for a file");
  command
      .add_option("--port", arguments->port, "port to listen on; 0: any free one; default: 7373, or any if it is taken")
      ->type_name("N");
  command
      .add_option("--host", arguments->host,
                  "address to listen on; if other machines can reach it, the URL has a token")
      ->type_name("ADDRESS");
  command.add_flag("--token", arguments->token, "require a token on this machine too, if other people use it");
  command.add_flag("--no-open", arguments->no_open, "print the URL, do not open a browser");
  command
      .add_option("--save-folder", arguments->save_folder, "folder that the page saves to; default: the current one")
      ->type_name("FOLDER");
  command.add_option("--points", arguments->points, "show at most N points; runs and files have all of them")
      ->check(CLI::Range(1000, 100'000'000).description(""))
      ->type_name("N");
  add_viewpoint(command, arguments->viewpoint);
  add_input(command, arguments->in);
  add_device(command, arguments->device);
  return {&command, [arguments](std::stop_token stop) { view(*arguments, stop); }};
}

}  // namespace pointfair::cli
