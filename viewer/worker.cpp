// SPDX-License-Identifier: Apache-2.0
#include "worker.hpp"

#include <algorithm>
#include <new>
#include <utility>

#include "pointfair/pointfair.hpp"

namespace pointfair::viewer {
namespace {

constexpr std::chrono::milliseconds kRest{200};  // without a message before at_rest is called

}  // namespace

Worker::Worker(Duties duties, Turns turns) : duties_(std::move(duties)), turns_(turns) {
  if (turns_ == Turns::own_thread) thread_ = std::thread([this] { work(); });
}

Worker::~Worker() {
  {
    const std::lock_guard lock(mutex_);
    quit_ = true;
    stop_.request_stop();
  }
  changed_.notify_all();
  if (thread_.joinable()) thread_.join();
}

void Worker::submit(Request request) {
  const std::lock_guard lock(mutex_);
  waiting_ = Waiting{std::move(request), page_, {}};
  if (running_) stop_.request_stop();
  changed_.notify_all();
}

bool Worker::post(Job job) {
  const std::lock_guard lock(mutex_);
  if (jobs_.size() >= kMaxWaitingJobs) return false;
  jobs_.push_back(std::move(job));
  if (running_) stop_.request_stop();
  changed_.notify_all();
  return true;
}

bool Worker::cancel(Job job) {
  {
    const std::lock_guard lock(mutex_);
    waiting_.reset();
    cancelled_ = true;
    stop_.request_stop();
  }
  return post(std::move(job));
}

void Worker::forget_requests() {
  const std::lock_guard lock(mutex_);
  ++page_;
  waiting_.reset();
  if (running_) stop_.request_stop();
}

void Worker::work() {
  std::unique_lock lock(mutex_);
  while (true) {
    wait_for_work(lock);
    if (quit_) return;
    take_turn(lock);
  }
}

void Worker::wait_for_work(std::unique_lock<std::mutex>& lock) {
  const auto asked = [this] { return quit_ || waiting_ || !jobs_.empty(); };
  if (rest_at_)
    changed_.wait_until(lock, *rest_at_, asked);
  else
    changed_.wait(lock, asked);
}

std::optional<std::chrono::milliseconds> Worker::step() {
  std::unique_lock lock(mutex_);
  const auto next_due = [this]() -> std::optional<Clock::time_point> {
    if (!jobs_.empty()) return Clock::time_point{};
    return waiting_ ? std::optional(waiting_->due) : rest_at_;
  };
  if (const auto due = next_due(); due && *due <= Clock::now()) take_turn(lock);
  const auto due = next_due();
  if (!due) return std::nullopt;
  return std::max(std::chrono::milliseconds(0), std::chrono::ceil<std::chrono::milliseconds>(*due - Clock::now()));
}

// One job, or else the run that waits, or else the rest; unlocked meanwhile.
void Worker::take_turn(std::unique_lock<std::mutex>& lock) {
  stop_ = std::stop_source();
  const std::stop_token stop = stop_.get_token();
  cancelled_ = false;
  if (!jobs_.empty()) {
    const Job job = std::move(jobs_.front());
    jobs_.pop_front();
    lock.unlock();
    do_job(job, stop);
  } else {
    std::optional<Waiting> waiting = std::exchange(waiting_, std::nullopt);
    running_ = true;
    lock.unlock();
    if (waiting)
      do_run(std::move(*waiting), stop);
    else
      rest(stop);
  }
  lock.lock();
  running_ = false;
}

// Sends what the exception under way says; false if it only says that its work was stopped.
bool Worker::complain(const Json& id) {
  try {
    throw;
  } catch (const std::bad_alloc&) {
    duties_.complain(id, "out of memory; close other programs, or take fewer points or a smaller neighbourhood");
  } catch (const Error& error) {
    if (error.kind() == ErrorKind::interrupted) return false;
    duties_.complain(id, error.what());
  } catch (const std::exception& error) {
    duties_.complain(id, error.what());
  }
  return true;
}

void Worker::do_job(const Job& job, const std::stop_token& stop) {
  try {
    job(stop);
  } catch (...) {
    complain(nullptr);
  }
}

void Worker::do_run(Waiting waiting, const std::stop_token& stop) {
  rest_at_.reset();  // what an older run left to do is void
  try {
    duties_.run(waiting.request, stop);
    rest_at_ = Clock::now() + kRest;
  } catch (...) {
    if (complain(waiting.request.id)) return;
    // a job came between: the run goes on after it, unless newer parameters are there
    const std::lock_guard lock(mutex_);
    if (waiting_ || cancelled_ || waiting.page != page_) return;
    waiting_ = std::move(waiting);
    if (turns_ == Turns::own_thread) return;
    waiting_->due = Clock::now() + kRest;
    waiting_->request.held = false;
  }
}

void Worker::rest(const std::stop_token& stop) {
  const auto due = std::exchange(rest_at_, std::nullopt);
  try {
    duties_.at_rest(stop);
  } catch (...) {
    if (!complain(nullptr)) rest_at_ = due;  // a job came between: after it; a run makes it void
  }
}

}  // namespace pointfair::viewer
