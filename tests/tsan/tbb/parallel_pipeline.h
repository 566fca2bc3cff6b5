// SPDX-License-Identifier: Apache-2.0
// See parallel_for.h beside it. Of a pipeline, one item after the other passes all filters.
#pragma once

#include <cstddef>
#include <utility>

namespace tbb {

enum class filter_mode { parallel, serial_in_order };

class flow_control {
 public:
  struct Stopped {};
  [[noreturn]] void stop() { throw Stopped{}; }
};

template <class Body>
struct Filter {
  Body body;
};

template <class, class, class Body>
Filter<Body> make_filter(filter_mode, Body body) {
  return {std::move(body)};
}

template <class First, class Second>
auto operator&(Filter<First> first, Filter<Second> second) {
  auto both = [first = first.body, second = second.body](auto& input) mutable {
    auto&& output = first(input);
    return second(output);
  };
  return Filter<decltype(both)>{std::move(both)};
}

template <class Body>
void parallel_pipeline(std::size_t, Filter<Body> filter) {
  try {
    for (flow_control control;;) filter.body(control);
  } catch (const flow_control::Stopped&) {
  }
}

}  // namespace tbb
