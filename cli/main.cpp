// SPDX-License-Identifier: Apache-2.0
// pointfair on the command line: finds the verb, runs it, turns errors into one line and an exit code.
#include <fmt/format.h>

#include <algorithm>
#include <cctype>
#include <exception>
#include <filesystem>
#include <iterator>
#include <new>
#include <optional>
#include <string>
#include <system_error>
#include <vector>

#include "arguments.hpp"
#include "command_line.hpp"
#include "interrupts.hpp"
#include "misunderstood.hpp"
#include "output.hpp"
#include "platform/system.hpp"
#include "pointfair/pointfair.hpp"
#include "verbs.hpp"

namespace pointfair::cli {
namespace {

constexpr std::string_view kHelp = R"(pointfair {}: removes the noise of 3D scans and keeps their shape

{}
Files: {}
       - is standard input or output.
pointfair VERB --help lists the flags of a verb; the usual start is

  pointfair run scan.ply denoised.ply
)";

// The words in lines that fit a screen.
std::string wrapped(const std::vector<std::string>& words) {
  constexpr std::size_t kWidth = 70;
  std::string text, line;
  for (const std::string& word : words) {
    if (!line.empty() && line.size() + word.size() > kWidth) {
      text += line + ",\n       ";
      line.clear();
    }
    line += (line.empty() ? "" : ", ") + word;
  }
  return text + line;
}

std::string help(const std::vector<Verb>& verbs) {
  std::string lines;
  for (const Verb& verb : verbs) {
    std::string usage = verb.command->get_name();
    for (const CLI::Option* option : verb.command->get_options())
      if (option->get_positional() && option->get_items_expected_max() == 1)
        fmt::format_to(std::back_inserter(usage), " {}", option->get_name());
    std::string does = verb.command->get_description();
    does.pop_back();  // the full stop
    does[0] = static_cast<char>(std::tolower(static_cast<unsigned char>(does[0])));
    lines += fmt::format("  pointfair {:<15} {}\n", usage, does);
  }
  return fmt::format(kHelp, version(), lines, wrapped(format_names()));
}

// Without the command's own name.
std::string words_before(const CLI::App& command) { return words_of(command.get_parent()); }

// The help of a verb; `with_all`: also the flags that are seldom needed.
std::string help_of(CLI::App& command, bool with_all) {
  const auto is_seldom = [](std::string_view group) {
    return group == kExpertGroup || group == kInputGroup || group == kOutputGroup || group == kMoreGroup;
  };
  const bool hides = !with_all && command.get_help_all_ptr() != nullptr;
  for (CLI::Option* option : command.get_options())
    if (hides && is_seldom(option->get_group())) option->group("");  // CLI11 hides such
  return command.help(words_before(command));
}

// Returns the verb to run, or null where only help or the version was asked for, which is then printed.
const Verb* parse(CLI::App& app, const std::vector<Verb>& verbs, std::vector<std::string> words) {
  if (words.empty() || words[0] == "--help" || words[0] == "-h") {
    print_output(help(verbs));
    return nullptr;
  }
  const auto is_named = [&](const Verb& verb) { return verb.command->get_name() == words[0]; };
  if (!words[0].starts_with('-') && std::ranges::none_of(verbs, is_named))
    throw Error(ErrorKind::usage, unknown_verb(words[0], app));
  words = complete_switches(with_dashes(std::move(words)));
  std::ranges::reverse(words);  // as CLI11 wants them
  try {
    app.parse(std::move(words));
  } catch (const CLI::CallForHelp&) {
    print_output(app.get_subcommands().empty() ? help(verbs) : help_of(asked_command(app), false));
    return nullptr;
  } catch (const CLI::CallForAllHelp&) {
    print_output(help_of(asked_command(app), true));
    return nullptr;
  } catch (const CLI::CallForVersion&) {
    print_output(fmt::format("pointfair {}\n", version()));
    return nullptr;
  } catch (const CLI::ParseError& error) {
    throw Error(ErrorKind::usage, told(error, app));
  }
  return &*std::ranges::find_if(verbs, [](const Verb& verb) { return verb.command->parsed(); });
}

void run_verb(std::vector<std::string> words, std::stop_token stop) {
  CLI::App app("", "pointfair");
  app.allow_windows_style_options(false);  // a path may begin with a slash everywhere
  app.set_version_flag("--version", "");
  app.require_subcommand(1);
  const std::vector<Verb> verbs = {add_run(app),   add_tile(app),    add_view(app),  add_info(app),  add_compare(app),
                                   add_noise(app), add_certify(app), add_bench(app), add_doctor(app)};
  remember_command(words);
  if (const Verb* verb = parse(app, verbs, std::move(words))) verb->action(stop);
}

int fail(Interrupts& interrupts, std::string_view message, int code) {
  interrupts.finish();
  if (system::pipe_is_broken()) return kExitFailed;  // the reader of the pipe left, so nobody reads a message
  print_error(message);
  return code;
}

}  // namespace
}  // namespace pointfair::cli

int main(int count, char** words) {
  using namespace pointfair;
  cli::system::prepare_streams();
  std::optional<cli::Interrupts> listening;
  try {
    listening.emplace();
  } catch (const std::system_error& error) {
    cli::print_error(fmt::format("cannot start a thread: {}; end other programs, or raise the limit of processes",
                                 error.code().message()));
    return cli::kExitFailed;
  }
  cli::Interrupts& interrupts = *listening;
  try {
    cli::run_verb({words + 1, words + count}, interrupts.token());
    return cli::kExitOk;
  } catch (const Error& error) {
    return cli::fail(interrupts, error.what(), cli::exit_code(error.kind()));
  } catch (const std::bad_alloc&) {
    return cli::fail(interrupts, "out of memory; close other programs or use fewer points", cli::kExitMemory);
  } catch (const std::length_error&) {
    return cli::fail(interrupts, "too many points for any memory; use fewer", cli::kExitMemory);
  } catch (const std::filesystem::filesystem_error& error) {
    return cli::fail(interrupts, error.what(), cli::kExitFile);
  } catch (const std::exception& error) {
    return cli::fail(interrupts, error.what(), cli::kExitFailed);
  }
}
