// SPDX-License-Identifier: Apache-2.0
// What pointfair uses of oneTBB, on one thread: a browser's page has no others. Each call does all of its work before
// it returns, in the order of the items.
#pragma once

#include <algorithm>
#include <cstddef>
#include <list>
#include <type_traits>
#include <utility>

namespace tbb {

template <class T>
class blocked_range {
 public:
  blocked_range(T begin, T end, std::size_t = 1) : begin_(begin), end_(end) {}
  T begin() const { return begin_; }
  T end() const { return end_; }

 private:
  T begin_, end_;
};

template <class T, class Body>
void parallel_for(const blocked_range<T>& range, const Body& body) {
  if (range.begin() < range.end()) body(range);
}

template <class T, class Body>
void parallel_for(T first, T last, const Body& body) {
  for (; first < last; ++first) body(first);
}

template <class Iterator>
void parallel_sort(Iterator first, Iterator last) {
  std::sort(first, last);
}

template <class Iterator, class Less>
void parallel_sort(Iterator first, Iterator last, const Less& less) {
  std::sort(first, last, less);
}

template <class... Bodies>
void parallel_invoke(const Bodies&... bodies) {
  (bodies(), ...);
}

template <class T>
class enumerable_thread_specific {
 public:
  enumerable_thread_specific() : values_(1) {}
  template <class Make>
  explicit enumerable_thread_specific(const Make& make) {
    values_.push_back(make());
  }
  T& local() { return values_.front(); }
  auto begin() { return values_.begin(); }
  auto end() { return values_.end(); }

 private:
  std::list<T> values_;
};

class global_control {
 public:
  enum parameter { max_allowed_parallelism };
  global_control(parameter, std::size_t) {}
  global_control(const global_control&) = delete;
  global_control& operator=(const global_control&) = delete;
};

class task_arena {
 public:
  static constexpr int automatic = -1;
  explicit task_arena(int = automatic) {}
  template <class Body>
  decltype(auto) execute(Body&& body) {
    return std::forward<Body>(body)();
  }
};

namespace this_task_arena {
inline int max_concurrency() { return 1; }
template <class Body>
decltype(auto) isolate(Body&& body) {
  return std::forward<Body>(body)();
}
}  // namespace this_task_arena

namespace info {
inline int default_concurrency() { return 1; }
}  // namespace info

enum class filter_mode { serial_in_order, parallel };

class flow_control {
 public:
  void stop() { stopped_ = true; }
  bool is_stopped() const { return stopped_; }

 private:
  bool stopped_ = false;
};

template <class In, class Out, class Body>
struct filter {
  Body body;
};

template <class In, class Out, class Body>
filter<In, Out, Body> make_filter(filter_mode, Body body) {
  return {std::move(body)};
}

// After the first filter says stop, what it returned goes no further.
template <class In, class Middle, class Out, class First, class Second>
auto operator&(filter<In, Middle, First> first, filter<Middle, Out, Second> second) {
  auto both = [first = std::move(first.body), second = std::move(second.body)](auto& in) {
    auto middle = first(in);
    if constexpr (std::is_same_v<std::decay_t<decltype(in)>, flow_control> && !std::is_void_v<Out>) {
      return in.is_stopped() ? Out() : Out(second(std::move(middle)));
    } else if constexpr (std::is_same_v<std::decay_t<decltype(in)>, flow_control>) {
      if (!in.is_stopped()) second(std::move(middle));
    } else {
      return second(std::move(middle));
    }
  };
  return filter<In, Out, decltype(both)>{std::move(both)};
}

template <class Body>
void parallel_pipeline(std::size_t, const filter<void, void, Body>& all) {
  for (flow_control control; !control.is_stopped();) all.body(control);
}

}  // namespace tbb
