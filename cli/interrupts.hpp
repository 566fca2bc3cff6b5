// SPDX-License-Identifier: Apache-2.0
// Interrupts, as by Ctrl-C.
#pragma once

#include <condition_variable>
#include <filesystem>
#include <mutex>
#include <stop_token>
#include <thread>

namespace pointfair::cli {

/// Turns SIGINT and SIGTERM into a stop request; where nothing answers it in time, removes the half-written clouds and
/// ends the program with exit code 130. Make one before any other thread: threads inherit the blocked signals.
class Interrupts {
 public:
  Interrupts();
  ~Interrupts();
  Interrupts(const Interrupts&) = delete;
  Interrupts& operator=(const Interrupts&) = delete;

  std::stop_token token() const { return source_.get_token(); }

  /// From here on signals change nothing any more: the program is about to say how it ended.
  void finish();

 private:
  void watch();

  std::stop_source source_;
  std::mutex mutex_;
  std::condition_variable changed_;
  bool finished_ = false;
  std::thread watcher_;
};

/// A folder that is removed, with all that is in it, where the program is ended because nothing answered in time. One
/// at a time; empty: none.
void remove_if_ended(const std::filesystem::path& folder);

}  // namespace pointfair::cli
