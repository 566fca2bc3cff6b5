// SPDX-License-Identifier: Apache-2.0
// The baselines of a build without CUDA.
#include <stdexcept>

#include "paper/baselines.hpp"

namespace paper {

struct CudaBaseline::State {
  StageTimes times;
};

CudaBaseline::CudaBaseline() { throw std::runtime_error("this program was built without CUDA"); }
CudaBaseline::~CudaBaseline() = default;
void CudaBaseline::run(std::span<const pointfair::Point>, const Settings&, std::span<pointfair::Point>) {}
const StageTimes& CudaBaseline::times() const { return state_->times; }
std::vector<std::uint32_t> CudaBaseline::neighbors() const { return {}; }
bool CudaBaseline::fits(std::span<const pointfair::Point>, int) { return false; }

}  // namespace paper
