// SPDX-License-Identifier: Apache-2.0
#include "interrupts.hpp"

#include <pthread.h>
#include <unistd.h>

#include <chrono>

#include "output.hpp"
#include "pointfair/io.hpp"

namespace pointfair::cli {
namespace {

// The library answers a stop request within 200 ms at worst and far sooner as a rule.
constexpr std::chrono::milliseconds kGrace{100};

volatile std::sig_atomic_t broken_pipe = 0;

void note_broken_pipe(int) { broken_pipe = 1; }

// A shell sets SIGINT to "ignore" for what runs in the background; that wish is kept.
bool is_ignored(int signal) {
  struct sigaction action {};
  return sigaction(signal, nullptr, &action) == 0 && action.sa_handler == SIG_IGN;
}

std::mutex scratch_mutex;
std::filesystem::path scratch;

// Others may still write there: what they add is removed again, until the folder itself is gone.
void remove_scratch() {
  const std::lock_guard lock(scratch_mutex);
  std::error_code error;
  for (int tries = 0; !scratch.empty() && std::filesystem::exists(scratch, error) && tries < 100; ++tries)
    std::filesystem::remove_all(scratch, error);
}

}  // namespace

void remove_if_ended(const std::filesystem::path& folder) {
  const std::lock_guard lock(scratch_mutex);
  scratch = folder;
}

Interrupts::Interrupts() {
  struct sigaction pipe {};
  pipe.sa_handler = note_broken_pipe;  // the write then fails with EPIPE
  sigaction(SIGPIPE, &pipe, nullptr);
  std::signal(SIGXFSZ, SIG_IGN);  // beyond the limit of a file's size: EFBIG
  sigemptyset(&signals_);
  sigaddset(&signals_, SIGTERM);
  if (!is_ignored(SIGINT)) sigaddset(&signals_, SIGINT);
  pthread_sigmask(SIG_BLOCK, &signals_, nullptr);
  watcher_ = std::thread([this] { watch(); });
}

Interrupts::~Interrupts() {
  finish();
  pthread_kill(watcher_.native_handle(), SIGTERM);  // ends its sigwait
  watcher_.join();
}

void Interrupts::finish() {
  const std::lock_guard lock(mutex_);
  finished_ = true;
  changed_.notify_all();
}

void Interrupts::watch() {
  int signal = 0;
  sigwait(&signals_, &signal);
  source_.request_stop();
  std::unique_lock lock(mutex_);
  changed_.wait_for(lock, kGrace, [this] { return finished_; });
  if (finished_) return;
  remove_unfinished_files();
  remove_scratch();
  print_error("interrupted");
  _exit(kExitInterrupted);
}

bool pipe_is_broken() { return broken_pipe != 0; }

}  // namespace pointfair::cli
