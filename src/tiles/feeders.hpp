// SPDX-License-Identifier: Apache-2.0
// Threads that take tasks from one queue, each for the workers of one card.
#pragma once

#include <condition_variable>
#include <cstddef>
#include <deque>
#include <functional>
#include <mutex>
#include <optional>
#include <utility>

namespace pointfair {

// Calls body(feeder) for each at once, the first on this thread. When all have returned, throws what was thrown first.
void on_feeders(std::size_t feeders, const std::function<void(std::size_t feeder)>& body);

// Tasks, of which each may lead to others. Any number of threads may use it.
template <class Task>
class TaskQueue {
 public:
  void put(Task task) {
    const std::lock_guard lock(mutex_);
    tasks_.push_back(std::move(task));
    ++unfinished_;
    changed_.notify_one();
  }
  // The next one. Nothing if there is none now or, with `wait`, if there will be none, since all are finished or the
  // queue was closed.
  std::optional<Task> take(bool wait) {
    std::unique_lock lock(mutex_);
    if (wait) changed_.wait(lock, [&] { return !tasks_.empty() || unfinished_ == 0 || closed_; });
    if (tasks_.empty() || closed_) return std::nullopt;
    std::optional<Task> task(std::move(tasks_.front()));
    tasks_.pop_front();
    return task;
  }
  // Of one that was taken, after what it led to was put in.
  void finish_one() {
    const std::lock_guard lock(mutex_);
    if (--unfinished_ == 0) changed_.notify_all();
  }
  // After a failure: nobody is to begin another one.
  void close() {
    const std::lock_guard lock(mutex_);
    closed_ = true;
    changed_.notify_all();
  }
  bool is_closed() {
    const std::lock_guard lock(mutex_);
    return closed_;
  }

 private:
  std::mutex mutex_;
  std::condition_variable changed_;
  std::deque<Task> tasks_;
  std::size_t unfinished_ = 0;
  bool closed_ = false;
};

}  // namespace pointfair
