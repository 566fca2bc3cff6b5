// SPDX-License-Identifier: Apache-2.0
#include "progress.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <nlohmann/json.hpp>

#include "output.hpp"
#include "platform/system.hpp"

namespace pointfair::cli {
namespace {

constexpr int kBarWidth = 30;
constexpr std::chrono::milliseconds kInterval{100};

std::string bar(double share) {
  const auto filled = static_cast<std::size_t>(share * kBarWidth);
  return std::string(filled, '#') + std::string(kBarWidth - filled, '.');
}

}  // namespace

Progress::Progress(std::string_view mode) {
  if (mode == "auto") mode = system::errors_go_to_terminal() ? "bar" : "none";
  if (mode == "bar") mode_ = Mode::bar;
  if (mode == "plain") mode_ = Mode::plain;
  if (mode == "json") mode_ = Mode::json;
}

Progress::~Progress() {
  if (mode_ == Mode::bar && !stage_.empty()) print_message("\r\x1b[K");
}

void Progress::set_part(std::string prefix, double begin, double size) {
  prefix_ = std::move(prefix);
  begin_ = begin;
  size_ = size;
}

void Progress::show(double share, std::string_view its_stage) {
  if (mode_ == Mode::none) return;
  const std::string stage = prefix_ + std::string(its_stage);
  const auto now = std::chrono::steady_clock::now();
  const bool new_stage = stage != stage_;
  if (!new_stage && (mode_ == Mode::plain || now - last_ < kInterval)) return;
  stage_ = stage;
  last_ = now;
  print(begin_ + size_ * std::clamp(share, 0.0, 1.0));
}

void Progress::print(double share) const {
  switch (mode_) {
    case Mode::bar:
      print_message("\r{:<12} [{}] {:3.0f} %\x1b[K", stage_, bar(share), 100 * share);
      break;
    case Mode::plain:
      print_message("{}\n", stage_);
      break;
    case Mode::json:
      print_message("{}\n", nlohmann::ordered_json{{"stage", stage_}, {"share", share}}.dump());
      break;
    case Mode::none:
      break;
  }
}

}  // namespace pointfair::cli
