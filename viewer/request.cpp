// SPDX-License-Identifier: Apache-2.0
#include "request.hpp"

#include <algorithm>

namespace pointfair::viewer {
namespace {

constexpr std::size_t kMaxNameLength = 200;

std::optional<std::array<double, 3>> focus_of(const Json& json) {
  const auto found = json.find("focus");
  if (found == json.end() || !found->is_array() || found->size() != 3) return std::nullopt;
  std::array<double, 3> focus{};
  for (std::size_t axis = 0; axis < 3; ++axis) {
    if (!(*found)[axis].is_number()) return std::nullopt;
    focus[axis] = (*found)[axis].get<double>();
  }
  return focus;
}

}  // namespace

double Request::milliseconds_since_received() const {
  return std::chrono::duration<double, std::milli>(std::chrono::steady_clock::now() - received).count();
}

std::string string_in(const Json& json, const char* key) {
  const auto found = json.find(key);
  return found != json.end() && found->is_string() ? found->get<std::string>() : std::string();
}

Request read_request(const Json& message, std::chrono::steady_clock::time_point received) {
  Request request;
  request.id = message.value("id", Json());
  request.recipe = read_recipe(message);
  request.focus = focus_of(message);
  request.held = message.value("held", Json()) == true;
  request.output = string_in(message, "output");
  request.encoding = string_in(message, "encoding");
  request.received = received;
  encoding_of(request.encoding);
  return request;
}

void check_file_name(const std::string& name) {
  const bool plain = !name.empty() && name.size() <= kMaxNameLength && name[0] != '.' && name[0] != '-' &&
                     std::ranges::none_of(name, [](char c) {
                       return c == '/' || c == '\\' || static_cast<unsigned char>(c) < 0x20 || c == 0x7f;
                     });
  if (!plain)
    throw Error(ErrorKind::usage, "give a plain file name, such as denoised.ply: it is saved in the folder shown");
  (void)format_to_write(name, std::nullopt);  // throws for an unknown extension, with those that are known
}

}  // namespace pointfair::viewer
