// SPDX-License-Identifier: Apache-2.0
// Progress on standard error.
#pragma once

#include <chrono>
#include <string>
#include <string_view>

namespace pointfair::cli {

/// The words of --progress. `auto` is a bar on a terminal and nothing elsewhere; `plain` is a line a stage; `json` is
/// an object a line: {"stage":"normals","share":0.5}.
inline constexpr std::string_view kProgressModes[] = {"auto", "bar", "plain", "json", "none"};

class Progress {
 public:
  explicit Progress(std::string_view mode);
  ~Progress();  ///< takes the bar away
  Progress(const Progress&) = delete;
  Progress& operator=(const Progress&) = delete;

  /// `share` of the whole in [0, 1]. Prints at each change of the stage, and a bar or object at most ten times a
  /// second.
  void show(double share, std::string_view stage);

  /// What is shown from now on is a part of the whole, `size` of it from `begin` on; `prefix` stands before the stages.
  void set_part(std::string prefix, double begin, double size);

 private:
  enum class Mode { none, bar, plain, json };
  void print(double share) const;

  Mode mode_ = Mode::none;
  std::string stage_, prefix_;
  double begin_ = 0, size_ = 1;
  std::chrono::steady_clock::time_point last_{};
};

}  // namespace pointfair::cli
