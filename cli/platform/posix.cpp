// SPDX-License-Identifier: Apache-2.0
// Linux and macOS.
#include <fcntl.h>
#include <pthread.h>
#include <spawn.h>
#include <sys/resource.h>
#include <sys/wait.h>
#include <unistd.h>
#ifdef __linux__
#include <sys/prctl.h>
#endif
#ifdef __APPLE__
#include <mach-o/dyld.h>
#endif
#ifdef __GLIBC__
#include <malloc.h>
#endif

#include <cerrno>
#include <chrono>
#include <climits>
#include <csignal>
#include <cstdlib>
#include <cstring>

#include "system.hpp"

extern char** environ;

namespace pointfair::cli::system {
namespace fs = std::filesystem;
namespace {

volatile std::sig_atomic_t broken_pipe = 0;
sigset_t interrupts;

void note_broken_pipe(int) { broken_pipe = 1; }

// A shell sets SIGINT to "ignore" for what runs in the background, and nohup SIGHUP; that wish is kept.
bool is_ignored(int signal) {
  struct sigaction action {};
  return sigaction(signal, nullptr, &action) == 0 && action.sa_handler == SIG_IGN;
}

std::string why_not(const fs::path& path, int rights) {
  return ::access(path.c_str(), rights) == 0 ? std::string() : std::strerror(errno);
}

}  // namespace

// A standard stream that is closed gets a descriptor that cannot be used: else the next file that is opened would take
// its number, and what is printed would go into that file.
void prepare_streams() {
  for (const int stream : {STDIN_FILENO, STDOUT_FILENO, STDERR_FILENO})
    if (::fcntl(stream, F_GETFD) < 0) (void)::open("/dev/null", stream == STDIN_FILENO ? O_WRONLY : O_RDONLY);
}
bool errors_go_to_terminal() { return ::isatty(STDERR_FILENO) != 0; }
int process_id() { return ::getpid(); }
#ifdef __APPLE__
fs::path program_file() {
  std::string name(PATH_MAX, '\0');
  auto size = static_cast<std::uint32_t>(name.size());
  if (::_NSGetExecutablePath(name.data(), &size) != 0) return {};
  return fs::canonical(name.c_str());  // without links, as on Linux
}
#else
fs::path program_file() { return fs::read_symlink("/proc/self/exe"); }
#endif

std::string why_not_writable(const fs::path& file) { return why_not(file, W_OK); }
std::string why_no_files_in(const fs::path& folder) { return why_not(folder, W_OK | X_OK); }

bool replaces_what_is_read() { return true; }

std::uint64_t peak_memory() {
  rusage usage{};
  if (::getrusage(RUSAGE_SELF, &usage) != 0) return 0;
#ifdef __APPLE__
  return static_cast<std::uint64_t>(usage.ru_maxrss);
#else
  return static_cast<std::uint64_t>(usage.ru_maxrss) << 10;
#endif
}

// glibc keeps freed arrays of up to 32 MB, which those of a tile mostly are: twice the memory.
void keep_no_freed_memory() {
#ifdef __GLIBC__
  ::mallopt(M_MMAP_THRESHOLD, 1 << 20);
#endif
}

// In a container this process may be process 1, to which orphans go elsewhere: so the id of the parent is given.
bool end_with_parent(int parent) {
#ifdef __linux__
  ::prctl(PR_SET_PDEATHSIG, SIGKILL);
#else
  std::thread([parent] {
    while (::getppid() == parent) std::this_thread::sleep_for(std::chrono::milliseconds(200));
    ::_exit(128 + SIGKILL);
  }).detach();
#endif
  return ::getppid() == parent;
}

// Its own output would disturb ours.
void open_browser(std::string url) {
#ifdef __APPLE__
  std::string program = "open";
#else
  if (!std::getenv("DISPLAY") && !std::getenv("WAYLAND_DISPLAY")) return;
  std::string program = "xdg-open";
#endif
  char* words[] = {program.data(), url.data(), nullptr};
  posix_spawn_file_actions_t actions;
  posix_spawn_file_actions_init(&actions);
  for (const int stream : {0, 1, 2}) posix_spawn_file_actions_addopen(&actions, stream, "/dev/null", O_RDWR, 0);
  pid_t child = 0;
  const bool started = posix_spawnp(&child, words[0], &actions, nullptr, words, environ) == 0;
  posix_spawn_file_actions_destroy(&actions);
  if (started) std::thread([child] { waitpid(child, nullptr, 0); }).detach();
}

// Threads inherit the blocked signals.
void catch_interrupts() {
  struct sigaction pipe {};
  pipe.sa_handler = note_broken_pipe;  // the write then fails with EPIPE
  sigaction(SIGPIPE, &pipe, nullptr);
  std::signal(SIGXFSZ, SIG_IGN);  // beyond the limit of a file's size: EFBIG
  sigemptyset(&interrupts);
  sigaddset(&interrupts, SIGTERM);
  for (const int signal : {SIGINT, SIGHUP})  // SIGHUP: its terminal was closed
    if (!is_ignored(signal)) sigaddset(&interrupts, signal);
  pthread_sigmask(SIG_BLOCK, &interrupts, nullptr);
}
void wait_for_interrupt() {
  int signal = 0;
  sigwait(&interrupts, &signal);
}
void end_wait(std::thread& waiting) { pthread_kill(waiting.native_handle(), SIGTERM); }
bool pipe_is_broken() { return broken_pipe != 0; }
void catch_lost_files(void (*handler)(int)) { std::signal(SIGBUS, handler); }
void end_process(int code, std::string_view last_words) {
  [[maybe_unused]] const auto written = ::write(STDERR_FILENO, last_words.data(), last_words.size());
  ::_exit(code);
}

}  // namespace pointfair::cli::system
