// SPDX-License-Identifier: Apache-2.0
#include "interruptible.hpp"

#include <nanobind/stl/string.h>
#include <unistd.h>

#include <algorithm>
#include <chrono>
#include <condition_variable>
#include <deque>
#include <exception>
#include <functional>
#include <mutex>
#include <string>
#include <thread>

namespace nb = nanobind;

namespace pointfair::python {
namespace {

constexpr std::size_t kSmall = std::size_t(1) << 18;  // visits of neighbours, some ten milliseconds
constexpr std::chrono::milliseconds kPoll{50};

// Threads that wait for work, as many as ever worked at a time. They are kept: what oneTBB sets up for a thread takes
// time and, by glibc before 2.38, memory that is not used again. They end with the process.
class Helpers {
 public:
  // Those of this process; a forked one begins anew, without threads. The interpreter's lock is held.
  static Helpers& get() {
    static Helpers* helpers = new Helpers;
    if (helpers->process_ != getpid()) helpers = new Helpers;
    return *helpers;
  }

  void start(std::function<void()> work) {
    const std::lock_guard lock(mutex_);
    if (waiting_.size() >= idle_) std::thread([this] { serve(); }).detach();
    waiting_.push_back(std::move(work));
    wake_.notify_one();
  }

 private:
  void serve() {
    std::unique_lock lock(mutex_);
    for (;;) {
      ++idle_;
      wake_.wait(lock, [this] { return !waiting_.empty(); });
      --idle_;
      const std::function<void()> work = std::move(waiting_.front());
      waiting_.pop_front();
      lock.unlock();
      work();
      lock.lock();
    }
  }

  const pid_t process_ = getpid();
  std::mutex mutex_;
  std::condition_variable wake_;
  std::deque<std::function<void()>> waiting_;
  std::size_t idle_ = 0;
};

// The work on a helper, and what it last said of its progress.
class Job {
 public:
  Job(const std::function<void(const Watch&)>& work, bool with_progress) {
    Watch watch{stop_.get_token(), {}};
    if (with_progress) watch.progress = [this](double share, std::string_view stage) { note(share, stage); };
    Helpers::get().start([this, &work, watch] {
      try {
        work(watch);
      } catch (...) {
        error_ = std::current_exception();
      }
      const std::lock_guard lock(mutex_);
      done_ = true;
      changed_.notify_one();
    });
  }
  ~Job() {
    stop_.request_stop();
    std::unique_lock lock(mutex_);
    changed_.wait(lock, [this] { return done_; });
  }
  Job(const Job&) = delete;
  Job& operator=(const Job&) = delete;

  // Whether the work ended within a poll.
  bool wait() {
    std::unique_lock lock(mutex_);
    return changed_.wait_for(lock, kPoll, [this] { return done_; });
  }

  std::pair<double, std::string> progress() {
    const std::lock_guard lock(mutex_);
    return {share_, stage_};
  }

  void rethrow() const {
    if (error_) std::rethrow_exception(error_);
  }

 private:
  void note(double share, std::string_view stage) {
    const std::lock_guard lock(mutex_);
    share_ = share;
    stage_ = stage;
  }

  std::stop_source stop_;
  std::mutex mutex_;
  std::condition_variable changed_;
  bool done_ = false;
  double share_ = 0;
  std::string stage_;
  std::exception_ptr error_;
};

void poll(Job& job, nb::handle progress) {
  const bool tells = !progress.is_none();
  for (;;) {
    bool done = false;
    {
      nb::gil_scoped_release release;
      done = job.wait();
    }
    if (done) break;
    if (PyErr_CheckSignals() != 0) throw nb::python_error();
    if (!tells) continue;
    const auto [share, stage] = job.progress();
    progress(share, stage);
  }
  job.rethrow();
  if (tells) progress(1.0, "done");
}

}  // namespace

std::size_t cost_of(const Params& params, std::size_t points) {
  constexpr std::size_t kUsual = 128;  // visits a point, with what measures the cloud
  const std::size_t most_iterations = params.method == Method::bilateral ? 2 : 8;  // of those that are automatic
  const std::size_t iterations = params.iterations == kAutomatic ? most_iterations : std::size_t(params.iterations);
  const std::size_t within_radius = params.radius.is_automatic() ? kUsual / 2 : points;
  const std::size_t neighbors = params.k == kAutomatic ? within_radius : std::size_t(params.k);
  return points * std::max(kUsual, std::min(points, neighbors) * iterations);
}

void run_interruptible(std::size_t cost, nb::handle progress, const std::function<void(const Watch&)>& work) {
  if (cost < kSmall && progress.is_none()) {
    nb::gil_scoped_release release;
    work({});
    return;
  }
  auto job = std::make_unique<Job>(work, !progress.is_none());
  const auto end = [&] {
    nb::gil_scoped_release release;  // the end of a run that was stopped is awaited
    job.reset();
  };
  try {
    poll(*job, progress);
  } catch (...) {
    end();
    throw;
  }
  end();
}

}  // namespace pointfair::python
