// SPDX-License-Identifier: Apache-2.0
// Blocks in parallel, with results and errors that do not depend on the order in which threads arrive.
#pragma once

#include <tbb/info.h>
#include <tbb/parallel_for.h>
#include <tbb/parallel_pipeline.h>
#include <tbb/task_arena.h>

#include <algorithm>
#include <atomic>
#include <cstddef>
#include <exception>
#include <mutex>
#include <string>
#include <utility>

#include "io/output.hpp"

namespace pointfair::io {

/// How many threads work at once here.
inline std::size_t concurrency() { return static_cast<std::size_t>(tbb::this_task_arena::max_concurrency()); }

/// Calls `body(block)` for every block below `count`. If some throw, the exception of the lowest one is passed on.
template <class Body>
void for_each_block(std::size_t count, const Body& body) {
  std::atomic<std::size_t> failed{count};
  std::exception_ptr error;
  std::mutex guard;
  tbb::parallel_for(std::size_t{0}, count, [&](std::size_t block) {
    if (block > failed.load(std::memory_order_relaxed)) return;
    try {
      body(block);
    } catch (...) {
      const std::lock_guard lock(guard);
      if (block >= failed) return;
      failed = block;
      error = std::current_exception();
    }
  });
  if (error) std::rethrow_exception(error);
}

/// Writes `format(block, buffer)` of every block below `count` in order; buffers are filled in parallel.
template <class Format>
void write_blocks(Output& out, std::size_t count, const Format& format) {
  const std::size_t in_flight = 2 * concurrency();
  std::size_t next = 0;
  tbb::parallel_pipeline(
      in_flight,
      tbb::make_filter<void, std::size_t>(tbb::filter_mode::serial_in_order, [&](tbb::flow_control& control) {
        if (next == count) control.stop();
        return next++;
      }) & tbb::make_filter<std::size_t, std::string>(tbb::filter_mode::parallel, [&](std::size_t block) {
        std::string buffer;
        format(block, buffer);
        return buffer;
      }) & tbb::make_filter<std::string, void>(tbb::filter_mode::serial_in_order, [&](const std::string& buffer) {
        out.write(buffer);
      }));
}

/// Runs `body` with at most `threads` threads; 0: all cores. Never more than there are: oneTBB would print a warning.
template <class Body>
decltype(auto) with_threads(unsigned threads, Body&& body) {
  const int cores = tbb::info::default_concurrency();
  tbb::task_arena arena(threads == 0 ? cores : std::min(cores, static_cast<int>(std::min(threads, 1U << 16))));
  return arena.execute(std::forward<Body>(body));
}

}  // namespace pointfair::io
