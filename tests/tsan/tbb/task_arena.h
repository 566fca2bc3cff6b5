// SPDX-License-Identifier: Apache-2.0
// See parallel_for.h beside it.
#pragma once

#include <utility>

namespace tbb {

namespace this_task_arena {
inline thread_local int concurrency = 2;
inline int max_concurrency() { return concurrency; }
}  // namespace this_task_arena

class task_arena {
 public:
  static constexpr int automatic = -1;  // as many threads as around it
  explicit task_arena(int concurrency)
      : concurrency_(concurrency == automatic ? this_task_arena::concurrency : concurrency) {}
  int max_concurrency() const { return concurrency_; }

  template <class Body>
  decltype(auto) execute(Body&& body) {
    struct Restore {
      int outer = this_task_arena::concurrency;
      ~Restore() { this_task_arena::concurrency = outer; }
    } restore;
    this_task_arena::concurrency = concurrency_;
    return std::forward<Body>(body)();
  }

 private:
  int concurrency_;
};

}  // namespace tbb
