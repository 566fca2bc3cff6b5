// SPDX-License-Identifier: Apache-2.0
// Who may talk to the server. A page of another site could reach a server on loopback through the user's browser; the
// Host header shows a name that was bent to point here, the Origin header shows whose page asks.
#pragma once

#include <string>
#include <string_view>
#include <vector>

namespace pointfair::viewer {

struct Gate {
  std::vector<std::string> hosts;  ///< names and addresses that this server goes by; empty: any, as the token decides
  std::string token;               ///< empty: none is asked for

  /// Whether the Host header, with or without a port, is a name of this server.
  bool admits_host(std::string_view host_header) const;
  /// Whether the Origin header is a page of this very server.
  bool admits_origin(std::string_view origin, std::string_view host_header) const;
  /// Whether the query of the target holds the token.
  bool admits_target(std::string_view target) const;
};

/// Random, 32 hexadecimal digits.
std::string make_token();

/// The path of a target, without its query.
std::string_view path_of(std::string_view target);

/// The value of a key of the target's query, percent-decoded; "" if there is none.
std::string query_value(std::string_view target, std::string_view key);

}  // namespace pointfair::viewer
