// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <future>
#include <vector>

#include "cuda/runtime/links.cuh"

namespace pointfair::cuda {

void copy_between_cards(void* to, int to_card, const void* from, int from_card, std::size_t bytes,
                        cudaStream_t stream) {
  if (bytes == 0) return;
  check(to_card == from_card ? cudaMemcpyAsync(to, from, bytes, cudaMemcpyDeviceToDevice, stream)
                             : cudaMemcpyPeerAsync(to, to_card, from, from_card, bytes, stream),
        "copying between cards");
}

namespace {

void copy(Point* to, const Point* from, std::size_t points, cudaMemcpyKind kind, cudaStream_t stream) {
  if (points > 0) check(cudaMemcpyAsync(to, from, points * sizeof(Point), kind, stream), "copying a card's share");
}

void let_wait(cudaStream_t stream, const Event& event) {
  check(cudaStreamWaitEvent(stream, event.get()), "ordering work");
}

// Nobody may read or write the host's memory after a call that failed.
class Finished {
 public:
  explicit Finished(cudaStream_t stream) : stream_(stream) {}
  ~Finished() { cudaStreamSynchronize(stream_); }
  Finished(const Finished&) = delete;
  Finished& operator=(const Finished&) = delete;
  void now() const { check(cudaStreamSynchronize(stream_), "copying a card's share"); }

 private:
  cudaStream_t stream_;
};

}  // namespace

Links::Links(const Context& context) : context_(context) {
  check(cudaStreamCreateWithFlags(own_.place(), cudaStreamNonBlocking), "making a stream");
}

Links::Lane::Lane(int its_card) : card(its_card) {
  check(cudaStreamCreateWithFlags(link.place(), cudaStreamNonBlocking), "making a stream");
  check(cudaStreamCreateWithFlags(between.place(), cudaStreamNonBlocking), "making a stream");
  check(cudaMalloc(&pieces, kPieces * kPiece * sizeof(Point)), "allocating a card's share");
}

Links::Lane::~Lane() { cudaFree(pieces); }

void Links::add(int card) {
  if (card == context_.card()) return;
  for (const Lane& lane : lanes_)
    if (lane.card == card) return;
  check(cudaSetDevice(card), "choosing the card");
  lanes_.emplace_back(card);
}

void Links::share(std::size_t points, const std::function<void(Lane*, std::size_t, std::size_t)>& body) {
  begun_.record(context_.main_stream());
  const std::size_t shares = lanes_.size() + 1;
  const auto end_of = [&](std::size_t number) { return points / shares * number + points % shares * number / shares; };
  std::vector<std::future<void>> others;
  std::size_t number = 1;
  for (Lane& lane : lanes_) {
    others.push_back(std::async(std::launch::async, [&body, &lane, first = end_of(number), last = end_of(number + 1)] {
      check(cudaSetDevice(lane.card), "choosing the card");
      body(&lane, first, last);
    }));
    ++number;
  }
  body(nullptr, 0, end_of(1));
  for (std::future<void>& other : others) other.get();
}

void Links::upload(std::span<const Point> from, Point* to) {
  share(from.size(), [&](Lane* lane, std::size_t first, std::size_t last) {
    const std::span<const Point> its = from.subspan(first, last - first);
    if (lane != nullptr) return upload_share(*lane, its, to + first);
    const Finished copied(own_.get());
    let_wait(own_.get(), begun_);
    copy(to, its.data(), its.size(), cudaMemcpyHostToDevice, own_.get());
    copied.now();
  });
}

void Links::download(const Point* from, std::span<Point> to) {
  share(to.size(), [&](Lane* lane, std::size_t first, std::size_t last) {
    const std::span<Point> its = to.subspan(first, last - first);
    if (lane != nullptr) return download_share(*lane, from + first, its);
    const Finished copied(own_.get());
    let_wait(own_.get(), begun_);
    copy(its.data(), from, its.size(), cudaMemcpyDeviceToHost, own_.get());
    copied.now();
  });
}

void Links::upload_share(Lane& lane, std::span<const Point> from, Point* to) {
  const Finished sent(lane.between.get()), taken(lane.link.get());
  let_wait(lane.between.get(), begun_);
  for (std::size_t begin = 0, number = 0; begin < from.size(); begin += kPiece, ++number) {
    const std::size_t count = std::min(kPiece, from.size() - begin), place = number % kPieces;
    Point* const piece = lane.pieces + place * kPiece;
    if (number >= kPieces) let_wait(lane.link.get(), lane.empty[place]);
    copy(piece, from.data() + begin, count, cudaMemcpyHostToDevice, lane.link.get());
    lane.full[place].record(lane.link.get());
    let_wait(lane.between.get(), lane.full[place]);
    copy_between_cards(to + begin, context_.card(), piece, lane.card, count * sizeof(Point), lane.between.get());
    lane.empty[place].record(lane.between.get());
  }
  taken.now();
  sent.now();
}

void Links::download_share(Lane& lane, const Point* from, std::span<Point> to) {
  const Finished sent(lane.between.get()), taken(lane.link.get());
  let_wait(lane.between.get(), begun_);
  for (std::size_t begin = 0, number = 0; begin < to.size(); begin += kPiece, ++number) {
    const std::size_t count = std::min(kPiece, to.size() - begin), place = number % kPieces;
    Point* const piece = lane.pieces + place * kPiece;
    if (number >= kPieces) let_wait(lane.between.get(), lane.empty[place]);
    copy_between_cards(piece, lane.card, from + begin, context_.card(), count * sizeof(Point), lane.between.get());
    lane.full[place].record(lane.between.get());
    let_wait(lane.link.get(), lane.full[place]);
    copy(to.data() + begin, piece, count, cudaMemcpyDeviceToHost, lane.link.get());
    lane.empty[place].record(lane.link.get());
  }
  sent.now();
  taken.now();
}

}  // namespace pointfair::cuda
