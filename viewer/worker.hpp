// SPDX-License-Identifier: Apache-2.0
// What works for a page, on a thread of its own or, where there is one thread only, in steps of its caller. Jobs are
// done in order and before anything else; kMaxWaitingJobs can wait. Runs have one place to wait: newer parameters
// replace those that wait and stop the run under way. After a run and a short rest, `at_rest` adds what takes too long
// for every run.
#pragma once

#include <chrono>
#include <condition_variable>
#include <cstdint>
#include <deque>
#include <functional>
#include <mutex>
#include <optional>
#include <stop_token>
#include <string_view>
#include <thread>

#include "request.hpp"

namespace pointfair::viewer {

/// A page never has so many under way.
inline constexpr std::size_t kMaxWaitingJobs = 64;

class Worker {
 public:
  using Job = std::function<void(std::stop_token)>;

  /// What the worker calls, all on its thread. `complain` gets what `run`, `at_rest` and jobs throw, in words.
  struct Duties {
    std::function<void(const Request&, std::stop_token)> run;
    Job at_rest;
    std::function<void(const Json& id, std::string_view words)> complain;
  };

  enum class Turns { own_thread, of_caller };

  explicit Worker(Duties duties, Turns turns = Turns::own_thread);
  ~Worker();  ///< stops what runs and waits for it

  /// With Turns::of_caller: takes the next turn if one is due. Returns the time until the next one is; none: nothing is
  /// left to do. A run that ends as interrupted goes on after a rest, no longer `held`, unless newer parameters come.
  std::optional<std::chrono::milliseconds> step();

  /// The newest parameters win: they take the one place there is, and stop what runs.
  void submit(Request request);

  /// A job stops a run, which afterwards goes on where it was. Returns whether there was room for it: a job that was
  /// taken will be done, unless the worker ends before.
  [[nodiscard]] bool post(Job job);

  /// Ends the run under way and the one that waits, then does `job`, for which post() says whether there was room.
  [[nodiscard]] bool cancel(Job job);

  /// What a former page asked for is void.
  void forget_requests();

  /// Calls at_rest no more for this result, which is void. On the worker's own thread.
  void forget_rest() { rest_at_.reset(); }

 private:
  using Clock = std::chrono::steady_clock;
  struct Waiting {
    Request request;
    std::uint64_t page;  // which of the pages, one after the other
    Clock::time_point due{};
  };

  void work();
  void wait_for_work(std::unique_lock<std::mutex>& lock);
  void take_turn(std::unique_lock<std::mutex>& lock);
  void do_job(const Job& job, const std::stop_token& stop);
  void do_run(Waiting waiting, const std::stop_token& stop);
  void rest(const std::stop_token& stop);
  bool complain(const Json& id);

  const Duties duties_;
  std::mutex mutex_;
  std::condition_variable changed_;
  std::optional<Waiting> waiting_;
  std::deque<Job> jobs_;
  std::stop_source stop_;
  std::uint64_t page_ = 0;
  bool running_ = false;  // what may be stopped and goes on later
  bool cancelled_ = false, quit_ = false;
  std::optional<Clock::time_point> rest_at_;  // of the worker's thread only
  const Turns turns_;
  std::thread thread_;  // last: starts when all else is there
};

}  // namespace pointfair::viewer
