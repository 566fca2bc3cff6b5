// SPDX-License-Identifier: Apache-2.0
// Work without the interpreter's lock, which Python's signals can stop.
#pragma once

#include <nanobind/nanobind.h>

#include <functional>

#include "array_pipeline.hpp"

namespace pointfair::python {

/// About how many visits of neighbours a run takes; what follows from the data is held to be usual.
std::size_t cost_of(const Params& params, std::size_t points);
inline constexpr std::size_t kAlwaysStoppable = ~std::size_t{0};

/// Calls `work` without the interpreter's lock. From a `cost` of some ten milliseconds on, or with
/// `progress`, the work runs on another thread, while this one looks for signals (Ctrl-C) every 50 ms and calls
/// `progress(share, stage)`. A signal or an exception of `progress` stops the work and is passed on.
void run_interruptible(std::size_t cost, nanobind::handle progress, const std::function<void(const Watch&)>& work);

}  // namespace pointfair::python
