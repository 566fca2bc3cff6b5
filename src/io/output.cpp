// SPDX-License-Identifier: Apache-2.0
#include "io/output.hpp"

#include <algorithm>
#include <array>
#include <atomic>
#include <cerrno>
#include <cstdio>
#include <mutex>
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

// Writes to a descriptor, which it closes. Once there is no room left, it only counts, so that the error can say how
// much is needed.
class DescriptorOutput : public Output {
 public:
  explicit DescriptorOutput(std::string name, int fd = -1) : name_(std::move(name)), fd_(fd) {}
  ~DescriptorOutput() override {
    if (fd_ >= 0) close();
  }

  void write(std::string_view bytes) override {
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

  void patch(std::uint64_t at, std::string_view bytes) override {
    if (full_ != 0) return;
    if (!platform::go_to(fd_, at)) fail_to_write(name_, errno);
    const std::uint64_t total = total_;
    write(bytes);
    total_ = total;
    if (full_ == 0 && !platform::go_to_end(fd_)) fail_to_write(name_, errno);
  }

  void require_room() override {
    if (full_ == 0) return;
    fail(name_, "cannot write: " + platform::message_of(full_) + "; the output needs " + std::to_string(total_) +
                    " bytes, " + std::to_string(total_ - room_) +
                    " more than there is room for: free some space or write elsewhere");
  }

  void finish() override { require_room(); }

 protected:
  int close() { return platform::close_file(std::exchange(fd_, -1)); }

  const std::string name_;
  int fd_;

 private:
  int full_ = 0;  // the error
  std::uint64_t total_ = 0, room_ = 0;
};

// A device, a pipe or standard output: written as it comes.
class StreamOutput final : public DescriptorOutput {
 public:
  using DescriptorOutput::DescriptorOutput;
  bool can_patch() const override { return false; }
};

class AtomicOutput final : public DescriptorOutput {
 public:
  AtomicOutput(const fs::path& target, std::string name, bool overwrite, bool sync)
      : DescriptorOutput(std::move(name)), target_(target), overwrite_(overwrite), sync_(sync) {
    remove_what_was_left(target_.parent_path());
    do {
      temporary_ = target_.parent_path() / unfinished_name(kUnfinishedOutput);
      slot_ = remember(temporary_.native());
      fd_ = platform::open_file(temporary_, Opening::create);
      if (fd_ < 0) forget();
    } while (fd_ < 0 && errno == EEXIST);
    if (fd_ < 0) fail(name_, "cannot create a file in its folder: " + platform::message_of(errno));
  }

  ~AtomicOutput() override {
    if (fd_ >= 0) close();
    if (!finished_) platform::remove_file(temporary_.c_str());
    forget();
  }

  void finish() override {
    require_room();
    if (overwrite_) platform::take_permissions(fd_, target_);
    if (sync_ && platform::sync_file(fd_) != 0) fail_to_write(name_, errno);
    if (close() != 0) fail_to_write(name_, errno);
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
  bool overwrite_, sync_, finished_ = false;
  UnfinishedFile* slot_ = nullptr;
};

}  // namespace

std::unique_ptr<Output> open_output(const fs::path& path, bool overwrite, bool sync) {
  const std::string name = shown_name(path, false);
  if (path == "-") return std::make_unique<StreamOutput>(name, platform::standard_output());
  using Kind = platform::FileStatus::Kind;
  const auto status = platform::status_of(path);
  if (status && status->kind == Kind::folder) fail(name, "is a directory; name a file in it");
  if (status && status->kind == Kind::other) {
    const int fd = platform::open_file(path, Opening::device);
    if (fd < 0) fail_to_write(name, errno);
    return std::make_unique<StreamOutput>(name, fd);
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
