// SPDX-License-Identifier: Apache-2.0
#include "gate.hpp"

#include <algorithm>
#include <cctype>
#include <charconv>
#include <random>

namespace pointfair::viewer {
namespace {

bool equal_names(std::string_view a, std::string_view b) {
  return std::ranges::equal(a, b, [](unsigned char x, unsigned char y) { return std::tolower(x) == std::tolower(y); });
}

// Takes as long for a wrong first character as for a wrong last one.
bool equal_secrets(std::string_view a, std::string_view b) {
  unsigned different = a.size() == b.size() ? 0 : 1;
  for (std::size_t i = 0; i < std::min(a.size(), b.size()); ++i)
    different |= static_cast<unsigned>(static_cast<unsigned char>(a[i]) ^ static_cast<unsigned char>(b[i]));
  return different == 0;
}

std::string_view without_port(std::string_view host) {
  if (host.starts_with('[')) return host.substr(0, std::min(host.find(']'), host.size() - 1) + 1);
  return host.substr(0, host.find(':'));
}

std::string percent_decoded(std::string_view text) {
  std::string result;
  for (std::size_t i = 0; i < text.size(); ++i) {
    unsigned value = 0;
    if (text[i] == '%' && i + 2 < text.size() &&
        std::from_chars(text.data() + i + 1, text.data() + i + 3, value, 16).ptr == text.data() + i + 3) {
      result += static_cast<char>(value);
      i += 2;
    } else {
      result += text[i] == '+' ? ' ' : text[i];
    }
  }
  return result;
}

}  // namespace

bool Gate::admits_host(std::string_view host_header) const {
  const std::string_view name = without_port(host_header);
  if (name.empty()) return false;
  if (hosts.empty()) return !token.empty();
  return std::ranges::any_of(hosts, [&](const std::string& host) { return equal_names(host, name); });
}

bool Gate::admits_origin(std::string_view origin, std::string_view host_header) const {
  for (const std::string_view scheme : {"http://", "https://"})
    if (origin.starts_with(scheme) && equal_names(origin.substr(scheme.size()), host_header)) return true;
  return false;
}

bool Gate::admits_target(std::string_view target) const {
  return token.empty() || equal_secrets(query_value(target, "token"), token);
}

std::string make_token() {
  std::random_device device;
  std::string token;
  for (int word = 0; word < 4; ++word) {
    const unsigned value = device();
    for (int digit = 0; digit < 8; ++digit) token += "0123456789abcdef"[(value >> (4 * digit)) & 15];
  }
  return token;
}

std::string_view path_of(std::string_view target) { return target.substr(0, target.find_first_of("?#")); }

std::string query_value(std::string_view target, std::string_view key) {
  std::size_t at = target.find('?');
  while (at != target.npos) {
    const std::size_t end = target.find('&', at + 1);
    const std::string_view pair = target.substr(at + 1, end == target.npos ? target.npos : end - at - 1);
    if (pair.starts_with(key) && pair.substr(key.size()).starts_with('='))
      return percent_decoded(pair.substr(key.size() + 1));
    at = end;
  }
  return "";
}

}  // namespace pointfair::viewer
