// SPDX-License-Identifier: Apache-2.0
// pointfair view: the page over HTTP and the session over a WebSocket. One page at a time; a new one takes over.
#pragma once

#include <cstdint>
#include <filesystem>
#include <functional>
#include <stop_token>
#include <string>

#include "pointfair/pointfair.hpp"

namespace pointfair::viewer {

struct ServerOptions {
  std::string host = "127.0.0.1";  ///< an address of this machine to listen on
  std::uint16_t port = 0;          ///< 0: any that is free
  bool other_port = false;         ///< take any that is free where `port` is taken
  bool token = false;              ///< ask for a token on loopback too; elsewhere it is always asked for
  Device device;
  std::filesystem::path page;  ///< the folder of the page's files
  std::filesystem::path save_folder = ".";
  std::uint64_t point_budget = 3'000'000;
  std::string viewpoint;                                ///< of the cloud at `input`, as parse_viewpoints reads it
  ReadOptions reading;                                  ///< of the cloud at `input`; its threads are the device's
  std::uint64_t upload_limit = std::uint64_t{1} << 30;  ///< bytes of a file that the page sends
};

/// Shows the cloud at `input`, or where that is empty asks for a file, until `stop`. Calls `ready` with the page's URL
/// once the server listens. Throws ErrorKind::file if the cloud cannot be read, ErrorKind::failed if the page is not
/// there or the address cannot be used, ErrorKind::device.
void serve(const std::filesystem::path& input, const ServerOptions& options,
           const std::function<void(const std::string& url)>& ready, std::stop_token stop);

}  // namespace pointfair::viewer
