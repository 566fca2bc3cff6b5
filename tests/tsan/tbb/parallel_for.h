// SPDX-License-Identifier: Apache-2.0
// Stands in for oneTBB under ThreadSanitizer, by plain threads. The distribution's oneTBB is not instrumented, so the
// sanitizer cannot see that its scheduler hands work from thread to thread, and calls every parallel loop a race.
#pragma once

#include <tbb/blocked_range.h>
#include <tbb/task_arena.h>

#include <algorithm>
#include <atomic>
#include <cstddef>
#include <exception>
#include <mutex>
#include <thread>
#include <vector>

namespace tbb {

// Calls body(range of one) for each item, from as many threads as the arena has; rethrows the first exception.
template <class Body>
void parallel_for(const blocked_range<std::size_t>& items, const Body& body) {
  const int concurrency = this_task_arena::max_concurrency();
  std::atomic<std::size_t> next{items.begin()};
  std::exception_ptr error;
  std::mutex guard;
  const auto work = [&] {
    this_task_arena::concurrency = concurrency;
    try {
      for (std::size_t i = next++; i < items.end(); i = next++) body(blocked_range<std::size_t>(i, i + 1));
    } catch (...) {
      next = items.end();
      const std::lock_guard lock(guard);
      if (!error) error = std::current_exception();
    }
  };
  std::vector<std::jthread> threads;
  const std::size_t helpers = std::min(items.size(), std::size_t(std::max(concurrency, 1))) - (items.empty() ? 0 : 1);
  for (std::size_t t = 0; t < helpers; ++t) threads.emplace_back(work);
  work();
  threads.clear();
  if (error) std::rethrow_exception(error);
}

template <class Body>
void parallel_for(std::size_t first, std::size_t last, const Body& body) {
  parallel_for(blocked_range<std::size_t>(first, last), [&](const blocked_range<std::size_t>& range) {
    for (std::size_t i = range.begin(); i != range.end(); ++i) body(i);
  });
}

}  // namespace tbb
