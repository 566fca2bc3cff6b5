// SPDX-License-Identifier: Apache-2.0
#include "io/output.hpp"

#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>

#include <array>
#include <atomic>
#include <cerrno>
#include <climits>
#include <cstdio>
#include <cstring>
#include <optional>
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

// Paths of the temporary files that exist now, in static memory so that a signal handler may read them.
struct UnfinishedFile {
  enum State : int { free, claimed, live };
  std::atomic<int> state{free};
  std::array<char, PATH_MAX> path{};
};
std::array<UnfinishedFile, 16> unfinished;
static_assert(std::atomic<int>::is_always_lock_free);

// Null if all places are taken or the path is too long; the file is then only removed by its owner.
UnfinishedFile* remember(const std::string& path) {
  if (path.size() >= PATH_MAX) return nullptr;
  for (UnfinishedFile& file : unfinished) {
    int expected = UnfinishedFile::free;
    if (!file.state.compare_exchange_strong(expected, UnfinishedFile::claimed)) continue;
    std::memcpy(file.path.data(), path.c_str(), path.size() + 1);
    file.state = UnfinishedFile::live;
    return &file;
  }
  return nullptr;
}

[[noreturn]] void fail_to_write(const std::string& name, int error) {
  fail(name, "cannot write: " + std::system_category().message(error));
}

// Writes to a descriptor. Once there is no room left, it only counts, so that the error can say how much is needed.
class Writer {
 public:
  Writer(int fd, const std::string& name) : fd_(fd), name_(name) {}

  void write(std::string_view bytes) {
    total_ += bytes.size();
    while (!bytes.empty() && full_ == 0) {
      const ssize_t done = ::write(fd_, bytes.data(), bytes.size());
      if (done < 0 && errno == EINTR) continue;
      if (done < 0 && errno != ENOSPC && errno != EDQUOT && errno != EFBIG) fail_to_write(name_, errno);
      if (done <= 0) {
        full_ = done < 0 ? errno : ENOSPC;
        room_ = total_ - bytes.size();
        (void)!::ftruncate(fd_, 0);  // others may need the room meanwhile
        return;
      }
      bytes.remove_prefix(static_cast<std::size_t>(done));
    }
  }

  void patch(std::uint64_t at, std::string_view bytes) {
    if (full_ != 0) return;
    if (::lseek(fd_, static_cast<off_t>(at), SEEK_SET) < 0) fail_to_write(name_, errno);
    const std::uint64_t total = total_;
    write(bytes);
    total_ = total;
    if (full_ == 0 && ::lseek(fd_, 0, SEEK_END) < 0) fail_to_write(name_, errno);
  }

  void require_room() const {
    if (full_ == 0) return;
    fail(name_, "cannot write: " + std::system_category().message(full_) + "; the output needs " +
                    std::to_string(total_) + " bytes, " + std::to_string(total_ - room_) +
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
  ~StreamOutput() override {
    if (fd_ > STDERR_FILENO) ::close(fd_);
  }
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
    do {
      temporary_ = target_.parent_path() / unfinished_name(kUnfinishedOutput);
      slot_ = remember(temporary_.string());
      fd_ = ::open(temporary_.c_str(), O_WRONLY | O_CREAT | O_EXCL | O_CLOEXEC, 0666);
      if (fd_ < 0) forget();
    } while (fd_ < 0 && errno == EEXIST);
    if (fd_ < 0) fail(name_, "cannot create a file in its folder: " + std::system_category().message(errno));
    writer_.emplace(fd_, name_);
  }

  ~AtomicOutput() override {
    if (fd_ >= 0) ::close(fd_);
    if (!finished_) ::unlink(temporary_.c_str());
    forget();
  }
  AtomicOutput(const AtomicOutput&) = delete;
  AtomicOutput& operator=(const AtomicOutput&) = delete;

  void write(std::string_view bytes) override { writer_->write(bytes); }
  void patch(std::uint64_t at, std::string_view bytes) override { writer_->patch(at, bytes); }

  void require_room() override { writer_->require_room(); }

  void finish() override {
    require_room();
    struct stat status {};
    if (overwrite_ && ::stat(target_.c_str(), &status) == 0) (void)::fchmod(fd_, status.st_mode & 07777);
    if (sync_ && ::fsync(fd_) != 0) fail_to_write(name_, errno);
    const int closed = ::close(std::exchange(fd_, -1));
    if (closed != 0) fail_to_write(name_, errno);
    // Without overwrite the name must still be free at this moment, not only when the writing began.
    const int renamed =
        overwrite_ ? ::rename(temporary_.c_str(), target_.c_str()) : platform::rename_to_free_name(temporary_, target_);
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
  if (path == "-") return std::make_unique<StreamOutput>(STDOUT_FILENO, name);
  struct stat status {};
  const bool exists = ::stat(path.c_str(), &status) == 0;
  if (exists && S_ISDIR(status.st_mode)) fail(name, "is a directory; name a file in it");
  if (exists && !S_ISREG(status.st_mode)) {
    const int fd = ::open(path.c_str(), O_WRONLY | O_CLOEXEC);
    if (fd < 0) fail_to_write(name, errno);
    return std::make_unique<StreamOutput>(fd, name);
  }
  if (exists && !overwrite) fail(name, "exists already; choose another name or allow overwriting");
  // The file that a symbolic link names is replaced, not the link.
  std::error_code ignored;
  const fs::path target = exists ? fs::canonical(path, ignored) : fs::absolute(path, ignored);
  return std::make_unique<AtomicOutput>(target.empty() ? path : target, name, overwrite, sync);
}

}  // namespace io

void remove_unfinished_files() noexcept {
  for (const io::UnfinishedFile& file : io::unfinished) {
    if (file.state == io::UnfinishedFile::live) ::unlink(file.path.data());
  }
}

}  // namespace pointfair
