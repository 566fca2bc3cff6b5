// SPDX-License-Identifier: Apache-2.0
// Points that lie on the card.
#include "cuda/backend.cuh"

namespace pointfair::cuda {

Origin CudaBackend::upload(const DevicePoints& points, DeviceStream stream, const ChooseOrigin& choose,
                           IndexOrder expected) {
  context_.enter();
  require_on_card(points.data, points.count, points.type, points.card, card_);
  forget_cloud(points.count);
  let_wait(stream);
  callers_.await_points();
  Origin origin{};  // as it mostly is: the index begins before the sample is there
  take(points, origin, expected);
  callers_.start_sample(points);
  if (const Origin chosen = choose(callers_.sample(points)); chosen != origin) {
    origin = chosen;
    take(points, origin, expected);
  }
  for (const cudaEvent_t seen : {callers_turn_.get(), callers_.sampled()})
    check(cudaStreamWaitEvent(static_cast<cudaStream_t>(stream.handle), seen), "ordering work");
  return origin;
}

OutlierCounts CudaBackend::download(int iteration, const DeviceOutput& points, DeviceStream stream,
                                    const DisplacementLimits& limits, std::span<std::uint8_t> outliers) {
  Chain& from = chain(iteration);
  const cudaEvent_t start = start_stage();
  require_on_card(points.data, points.count, points.type, points.card, card_);
  leaving_.begin();
  from.join();
  let_wait(stream);
  const ShownCopies shown(*this, from);
  if (Leaving::holds_back(iteration, limits)) {
    DeviceArray<Point> limited(context_);
    leaving_.hold_back(uploaded_, from, limits, outliers, limited);
    callers_.give(uploaded_.data(), limited.data(), points);
  } else {
    std::fill(outliers.begin(), outliers.end(), std::uint8_t(0));
    callers_.give(uploaded_.data(), from.faired().data(), points);
  }
  finish_download(from, start, iteration);
  return leaving_.held_back();
}

void CudaBackend::download_normals(int iteration, const DeviceOutput& normals, DeviceStream stream) {
  Chain& from = chain(iteration);
  context_.enter();
  require_on_card(normals.data, normals.count, normals.type, normals.card, card_);
  DeviceArray<Point> restored(context_);
  restored.resize(normals.count);
  from.restore_normals(restored.data());
  copies_.follow(restored.data());
  let_wait(stream);
  callers_.give_plain(restored.data(), normals);
  deliver();
}

void CudaBackend::let_wait(DeviceStream stream) {
  callers_turn_.record(static_cast<cudaStream_t>(stream.handle));
  context_.wait_for(callers_turn_.get());
}

void CudaBackend::take(const DevicePoints& points, const Origin& origin, IndexOrder expected) {
  is_index_begun_ = false;
  callers_.take(points, origin, uploaded_.data());
  callers_turn_.record(context_.stream());
  if (expected != IndexOrder::fastest) return;
  begin_first_index(std::nullopt, nullptr, {});
  is_index_begun_ = true;
}

}  // namespace pointfair::cuda
