// SPDX-License-Identifier: Apache-2.0
#include <algorithm>

#include "cuda/runtime/transfer.cuh"
#include "seam/host_copy.hpp"

namespace pointfair::cuda {
namespace {

constexpr std::size_t kPieces = 4;  // on their way

// Of points: small enough that a card soon has one to copy, large enough for all threads.
std::size_t piece_of(std::size_t points) {
  constexpr std::size_t kMany = std::size_t(1) << 22;
  return std::size_t(1) << (points < kMany ? 17 : 19);
}

bool is_pageable(const Point* memory) {
  cudaPointerAttributes its{};
  check(cudaPointerGetAttributes(&its, memory), "looking at memory");
  return its.type == cudaMemoryTypeUnregistered;
}

void copy(Point* to, const Point* from, std::size_t points, cudaMemcpyKind kind, cudaStream_t stream) {
  const bool in = kind == cudaMemcpyHostToDevice;
  if (points > 0)
    check(cudaMemcpyAsync(to, from, points * sizeof(Point), kind, stream),
          in ? "uploading points" : "downloading points");
}

}  // namespace

// Whether there are enough points, and page-locked memory for the pieces.
bool Staging::stages(const Point* host, std::size_t points) {
  constexpr std::size_t kWorth = std::size_t(1) << 18;
  if (points < kWorth || !is_pageable(host)) return false;
  for (std::size_t number = 0; number < kPieces; ++number) wait_for(number);  // of the call before
  try {
    pieces_.resize(kPieces * piece_of(points));
  } catch (const Error& error) {
    if (error.kind() != ErrorKind::memory) throw;
    return false;
  }
  return true;
}

void Staging::wait_for(std::size_t number) {
  check(cudaEventSynchronize(done_.at(number % kPieces).get()), "copying points");
}

void Staging::upload(std::span<const Point> from, Point* to, cudaStream_t stream) {
  if (!stages(from.data(), from.size())) return copy(to, from.data(), from.size(), cudaMemcpyHostToDevice, stream);
  const std::size_t piece = piece_of(from.size());
  for (std::size_t begin = 0, number = 0; begin < from.size(); begin += piece, ++number) {
    const std::size_t count = std::min(piece, from.size() - begin);
    Point* const its = pieces_.get() + number % kPieces * piece;
    wait_for(number);
    copy_by_all_threads(from.subspan(begin, count), its);
    copy(to + begin, its, count, cudaMemcpyHostToDevice, stream);
    done_.record(number % kPieces, stream);
  }
}

void Staging::download(const Point* from, std::span<Point> to, cudaStream_t stream) {
  if (!stages(to.data(), to.size())) return copy(to.data(), from, to.size(), cudaMemcpyDeviceToHost, stream);
  const std::size_t piece = piece_of(to.size()), pieces = (to.size() + piece - 1) / piece;
  const auto place = [&](std::size_t number) { return pieces_.get() + number % kPieces * piece; };
  const auto size = [&](std::size_t number) { return std::min(piece, to.size() - number * piece); };
  const auto start = [&](std::size_t number) {
    copy(place(number), from + number * piece, size(number), cudaMemcpyDeviceToHost, stream);
    done_.record(number % kPieces, stream);
  };
  for (std::size_t number = 0; number < std::min(pieces, kPieces); ++number) start(number);
  for (std::size_t number = 0; number < pieces; ++number) {
    wait_for(number);
    copy_by_all_threads({place(number), size(number)}, to.data() + number * piece);
    if (number + kPieces < pieces) start(number + kPieces);
  }
}

Upload::Upload(const Context& context, Staging& staging) : staging_(staging), side_(context) {}

Arrival Upload::start(std::span<const Point> from, Parts parts, Point* to) {
  side_.fork();
  parts_ = parts.count();
  there_.clear();
  events_.record(0, side_.stream());
  for (std::size_t part = 0; part < parts_; ++part) {
    const std::size_t begin = parts.begin(part), size = parts.size(part);
    staging_.upload(from.subspan(begin, size), to + begin, side_.stream());
    events_.record(part + 1, side_.stream());
    there_.push_back(events_[part + 1]);
  }
  return {std::move(parts), there_, events_[0]};
}

void Upload::finish() const {
  if (parts_ > 0) check(cudaEventSynchronize(events_[parts_]), "uploading points");
}

}  // namespace pointfair::cuda
