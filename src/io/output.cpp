// SPDX-License-Identifier: Apache-2.0
#include "io/output.hpp"

#include <algorithm>
#include <array>
#include <atomic>
#include <cerrno>
#include <cstdio>
#include <mutex>
#include <optional>
#include <set>
#include <system_error>
#include <utility>

#include "io/file_bytes.hpp"
#include "io/unfinished_files.hpp"
#include "platform/files.hpp"
#include "pointfair/io.hpp"

namespace pointfair {
namespace io {
namespace {

namespace fs = std::filesystem;
using platform::Opening;

// Paths of the temporary files that exist now, in static memory so that a signal handler may read them.
struct UnfinishedFile {
  enum State : int { free, claimed, live };
  static constexpr std::size_t kMostCharacters = 4096;
  std::atomic<int> state{free};
  std::array<fs::path::value_type, kMostCharacters> path{};
};
std::array<UnfinishedFile, 16> unfinished;
static_assert(std::atomic<int>::is_always_lock_free);

// Null if all places are taken or the path is too long; the file is then only removed by its owner.
UnfinishedFile* remember(const fs::path::string_type& path) {
  if (path.size() >= UnfinishedFile::kMostCharacters) return nullptr;
  for (UnfinishedFile& file : unfinished) {
    int expected = UnfinishedFile::free;
    if (!file.state.compare_exchange_strong(expected, UnfinishedFile::claimed)) continue;
    std::copy_n(path.c_str(), path.size() + 1, file.path.data());
    file.state = UnfinishedFile::live;
    return &file;
  }
  return nullptr;
}

// What outputs of processes that were killed have left in the folder, once a folder: a process may write many files.
void remove_what_was_left(const fs::path& folder) {
  static std::mutex mutex;
  static std::set<fs::path> folders;
  const std::lock_guard lock(mutex);
  if (folders.insert(folder).second) remove_abandoned(folder, kUnfinishedOutput);
}

[[noreturn]] void fail_to_write(const std::string& name, int error) {
  fail(name, "cannot write: " + platform::message_of(error));
}

// Writes to a descriptor. Once there is no room left, it only counts, so that the error can say how much is needed.
class Writer {
 public:
  Writer(int fd, const std::string& name) : fd_(fd), name_(name) {}

  void write(std::string_view bytes) {
    total_ += bytes.size();
    while (!bytes.empty() && full_ == 0) {
      const std::ptrdiff_t done = platform::write_some(fd_, bytes.data(), bytes.size());
      if (done < 0 && !platform::is_full(errno) && errno != EFBIG) fail_to_write(name_, errno);
      if (done <= 0) {
        full_ = done < 0 ? errno : ENOSPC;
        room_ = total_ - bytes.size();
        platform::make_empty(fd_);  // others may need the room meanwhile
        return;
      }
      bytes.remove_prefix(static_cast<std::size_t>(done));
    }
  }

  void patch(std::uint64_t at, std::string_view bytes) {
    if (full_ != 0) return;
    if (!platform::go_to(fd_, at)) fail_to_write(name_, errno);
    const std::uint64_t total = total_;
    write(bytes);
    total_ = total;
    if (full_ == 0 && !platform::go_to_end(fd_)) fail_to_write(name_, errno);
  }

  void require_room() const {
    if (full_ == 0) return;
    fail(name_, "cannot write: " + platform::message_of(full_) + "; the output needs " + std::to_string(total_) +
                    " bytes, " + std::to_string(total_ - room_) +
                    " more than there is room for: free some space or write elsewhere");
  }

 private:
  int fd_;
  const std::string& name_;
  int full_ = 0;  // the error
  std::uint64_t total_ = 0, room_ = 0;
};

// A device, a pipe or standard output: written as it comes.
class StreamOutput : public Output {
 public:
  StreamOutput(int fd, std::string name) : fd_(fd), name_(std::move(name)), writer_(fd_, name_) {}
  ~StreamOutput() override { platform::close_file(fd_); }
  StreamOutput(const StreamOutput&) = delete;
  StreamOutput& operator=(const StreamOutput&) = delete;

  void write(std::string_view bytes) override { writer_.write(bytes); }
  bool can_patch() const override { return false; }
  void patch(std::uint64_t, std::string_view) override {}
  void require_room() override { writer_.require_room(); }
  void finish() override { require_room(); }

 private:
  int fd_;
  std::string name_;
  Writer writer_;
};

class AtomicOutput : public Output {
 public:
  AtomicOutput(const fs::path& target, std::string name, bool overwrite, bool sync)
      : target_(target), name_(std::move(name)), overwrite_(overwrite), sync_(sync) {
    remove_what_was_left(target_.parent_path());
    do {
      temporary_ = target_.parent_path() / unfinished_name(kUnfinishedOutput);
      slot_ = remember(temporary_.native());
      fd_ = platform::open_file(temporary_, Opening::create);
      if (fd_ < 0) forget();
    } while (fd_ < 0 && errno == EEXIST);
    if (fd_ < 0) fail(name_, "cannot create a file in its folder: " + platform::message_of(errno));
    writer_.emplace(fd_, name_);
  }

  ~AtomicOutput() override {
    if (fd_ >= 0) platform::close_file(fd_);
    if (!finished_) platform::remove_file(temporary_.c_str());
    forget();
  }
  AtomicOutput(const AtomicOutput&) = delete;
  AtomicOutput& operator=(const AtomicOutput&) = delete;

  void write(std::string_view bytes) override { writer_->write(bytes); }
  void patch(std::uint64_t at, std::string_view bytes) override { writer_->patch(at, bytes); }

  void require_room() override { writer_->require_room(); }

  void finish() override {
    require_room();
    if (overwrite_) platform::take_permissions(fd_, target_);
    if (sync_ && platform::sync_file(fd_) != 0) fail_to_write(name_, errno);
    const int closed = platform::close_file(std::exchange(fd_, -1));
    if (closed != 0) fail_to_write(name_, errno);
    // Without overwrite the name must still be free at this moment, not only when the writing began.
    const int renamed =
        overwrite_ ? platform::rename_over(temporary_, target_) : platform::rename_to_free_name(temporary_, target_);
    if (renamed != 0) fail_to_write(name_, errno);
    finished_ = true;
  }

 private:
  void forget() {
    if (slot_) slot_->state = UnfinishedFile::free;
    slot_ = nullptr;
  }

  fs::path target_, temporary_;
  std::string name_;
  bool overwrite_, sync_, finished_ = false;
  int fd_ = -1;
  std::optional<Writer> writer_;
  UnfinishedFile* slot_ = nullptr;
};

}  // namespace

std::unique_ptr<Output> open_output(const fs::path& path, bool overwrite, bool sync) {
  const std::string name = shown_name(path, false);
  if (path == "-") return std::make_unique<StreamOutput>(platform::standard_output(), name);
  using Kind = platform::FileStatus::Kind;
  const auto status = platform::status_of(path);
  if (status && status->kind == Kind::folder) fail(name, "is a directory; name a file in it");
  if (status && status->kind == Kind::other) {
    const int fd = platform::open_file(path, Opening::device);
    if (fd < 0) fail_to_write(name, errno);
    return std::make_unique<StreamOutput>(fd, name);
  }
  if (status && !overwrite) fail(name, "exists already; choose another name or set overwrite");
  // The file that a symbolic link names is replaced, not the link.
  std::error_code ignored;
  const fs::path target = status ? fs::canonical(path, ignored) : fs::absolute(path, ignored);
  return std::make_unique<AtomicOutput>(target.empty() ? path : target, name, overwrite, sync);
}

}  // namespace io

void remove_unfinished_files() noexcept {
  for (const io::UnfinishedFile& file : io::unfinished)
    if (file.state == io::UnfinishedFile::live) platform::remove_file(file.path.data());
}

}  // namespace pointfair
