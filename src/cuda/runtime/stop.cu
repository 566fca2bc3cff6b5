// SPDX-License-Identifier: Apache-2.0
#include "cuda/runtime/stop.cuh"

namespace pointfair::cuda {

Stop StopLine::listen(const std::stop_token& stop, unsigned call) {
  if (!stop.stop_possible()) return {};
  if (heard_.size() == 0) {
    heard_.resize(1);
    heard_.clear("preparing a stop");
  }
  if (!callback_ || token_ != stop) {
    clear();
    token_ = stop;
    callback_.emplace(stop, Ask{asked_.get()});
  }
  return {asked_.get(), heard_.data(), call};
}

unsigned StopLine::given_up() { return is_asked() ? heard_.first("asking for a stop") : 0; }

void StopLine::clear() {
  callback_.reset();
  if (!is_asked()) return;
  heard_.clear("clearing a stop");
  context_.finish();
  set_asked(0);
}

}  // namespace pointfair::cuda
