// SPDX-License-Identifier: Apache-2.0
#include "cuda/runtime/stop.cuh"

namespace pointfair::cuda {

Stop StopLine::listen(const std::stop_token& stop, unsigned call) {
  if (!stop.stop_possible()) return {};
  if (heard_.size() == 0) {
    heard_.resize(1);
    check(cudaMemsetAsync(heard_.data(), 0, sizeof(unsigned), context_.stream()), "preparing a stop");
  }
  if (!callback_ || token_ != stop) {
    clear();
    token_ = stop;
    callback_.emplace(stop, Ask{asked_.get()});
  }
  return {asked_.get(), heard_.data(), call};
}

unsigned StopLine::given_up() {
  if (!is_asked()) return 0;
  unsigned call = 0;
  check(cudaMemcpyAsync(&call, heard_.data(), sizeof(call), cudaMemcpyDeviceToHost, context_.stream()),
        "asking for a stop");
  context_.finish();
  return call;
}

void StopLine::clear() {
  callback_.reset();
  if (!is_asked()) return;
  check(cudaMemsetAsync(heard_.data(), 0, sizeof(unsigned), context_.stream()), "clearing a stop");
  context_.finish();
  set_asked(0);
}

}  // namespace pointfair::cuda
