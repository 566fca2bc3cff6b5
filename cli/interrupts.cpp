// SPDX-License-Identifier: Apache-2.0
#include "interrupts.hpp"

#include <chrono>

#include "output.hpp"
#include "platform/system.hpp"
#include "pointfair/io.hpp"

namespace pointfair::cli {
namespace {

// The library answers a stop request within 200 ms at worst and far sooner as a rule.
constexpr std::chrono::milliseconds kGrace{100};

std::mutex scratch_mutex;
std::filesystem::path scratch;

// Others may still write there: what they add is removed again, until the folder itself is gone.
void remove_scratch() {
  const std::lock_guard lock(scratch_mutex);
  std::error_code error;
  for (int tries = 0; !scratch.empty() && std::filesystem::exists(scratch, error) && tries < 100; ++tries)
    std::filesystem::remove_all(scratch, error);
}

// Scratch folders stay: the next run in tiles removes them.
void end_without_file(int) {
  remove_unfinished_files();
  system::end_process(kExitFile,
                      "pointfair: a file became shorter, or its disk went away, while it was read; copy it again and "
                      "repeat the run\n");
}

}  // namespace

void remove_if_ended(const std::filesystem::path& folder) {
  const std::lock_guard lock(scratch_mutex);
  scratch = folder;
}

Interrupts::Interrupts() {
  system::catch_interrupts();
  system::catch_lost_files(end_without_file);
  watcher_ = std::thread([this] { watch(); });
}

Interrupts::~Interrupts() {
  finish();
  system::end_wait(watcher_);
  watcher_.join();
}

void Interrupts::finish() {
  const std::lock_guard lock(mutex_);
  finished_ = true;
  changed_.notify_all();
}

void Interrupts::watch() {
  system::wait_for_interrupt();
  source_.request_stop();
  std::unique_lock lock(mutex_);
  changed_.wait_for(lock, kGrace, [this] { return finished_; });
  if (finished_) return;
  remove_unfinished_files();
  remove_scratch();
  print_error("interrupted");
  system::end_process(kExitInterrupted);
}

}  // namespace pointfair::cli
