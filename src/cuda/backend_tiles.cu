// SPDX-License-Identifier: Apache-2.0
// Tiles of a cloud that lies on one card, computed by this card and others.
#include "cuda/backend.cuh"

namespace pointfair::cuda {

void CudaBackend::begin_tiles(int iteration) {
  context_.enter();
  fetched_iteration_ = kNone;
  wait_for_upload();
  const Point* const input = iteration == 0 ? uploaded_.data() : take_input_of(iteration);
  Chain& its = chain(iteration);
  its.join();
  its.faired().resize(uploaded_.size());
  tiles_.begin(input, uploaded_.size(), its.faired().data());
}

std::vector<std::size_t> CudaBackend::gather(std::span<const DeviceTile> tiles) {
  context_.enter();
  return tiles_.gather(tiles);
}

std::vector<std::uint32_t> CudaBackend::gathered(std::size_t tile) {
  context_.enter();
  return tiles_.indices_of(tile);
}

std::vector<TileTally> CudaBackend::scatter() {
  context_.enter();
  return tiles_.scatter();
}

void CudaBackend::connect(DeviceTiles& whole) {
  auto& its = static_cast<CudaBackend&>(whole);
  its.context_.enter();
  if (its.context_.admit(card_)) its.links_.add(card_);
  context_.enter();
  context_.admit(its.card_);
}

void CudaBackend::take(DeviceTiles& whole, std::size_t tile) {
  auto& from = static_cast<CudaBackend&>(whole);
  const GatheredTiles::Share share = from.tiles_.share(tile);
  context_.enter();
  forget_cloud(share.count);
  context_.wait_for(share.there);
  copy_between_cards(uploaded_.data(), card_, share.points, from.card_, share.count * sizeof(Point), context_.stream());
}

void CudaBackend::give(DeviceTiles& whole, std::size_t tile) {
  auto& to = static_cast<CudaBackend&>(whole);
  const GatheredTiles::Share share = to.tiles_.share(tile);
  context_.enter();
  DeviceArray<unsigned char> found(context_);
  found.resize(share.count);
  first_.find_outcomes(share.tile.loaded, found.data());
  first_.join();
  copy_between_cards(share.points, to.card_, first_.faired().data(), card_, share.count * sizeof(Point),
                     context_.stream());
  copy_between_cards(share.outcomes, to.card_, found.data(), card_, share.count, context_.stream());
  deliver();
}

}  // namespace pointfair::cuda
