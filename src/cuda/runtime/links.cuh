// SPDX-License-Identifier: Apache-2.0
// Other cards' links to the host. A card reaches the host at the pace of its own link only, so cards that reach its
// memory carry shares of a cloud over theirs: through two small buffers of their own, part by part.
// Memory: kPieces pieces on each of these cards.
#pragma once

#include <functional>
#include <list>
#include <span>

#include "cuda/runtime/memory.cuh"
#include "pointfair/cloud.hpp"

namespace pointfair::cuda {

// Between cards, or on one, in the order of `stream`, which is of one of them.
void copy_between_cards(void* to, int to_card, const void* from, int from_card, std::size_t bytes, cudaStream_t stream);

class Links {
 public:
  static constexpr std::size_t kPiece = 1 << 18, kPieces = 2;  // points, and pieces of a card

  // `context` is of the card that holds the clouds.
  explicit Links(const Context& context);
  Links(const Links&) = delete;
  Links& operator=(const Links&) = delete;

  // This card's link too, which reaches the other one's memory. Nothing happens where it is known already.
  void add(int card);
  bool any() const { return !lanes_.empty(); }

  // Each card's share has a thread. They begin after all that the context's stream still has to do, and return when the
  // last share is there.
  void upload(std::span<const Point> from, Point* to);
  void download(const Point* from, std::span<Point> to);

 private:
  struct Lane {
    explicit Lane(int its_card);
    ~Lane();
    Lane(const Lane&) = delete;
    Lane& operator=(const Lane&) = delete;

    int card;
    Stream link, between;  // to the host, and to the other card
    Point* pieces = nullptr;
    Event full[kPieces], empty[kPieces];
  };

  void upload_share(Lane& lane, std::span<const Point> from, Point* to);
  void download_share(Lane& lane, const Point* from, std::span<Point> to);
  // body(lane, first, last) for each share of so many points; no lane: the card that holds the cloud.
  void share(std::size_t points, const std::function<void(Lane*, std::size_t, std::size_t)>& body);

  const Context& context_;
  Stream own_;
  Event begun_;
  std::list<Lane> lanes_;  // which do not move
};

}  // namespace pointfair::cuda
