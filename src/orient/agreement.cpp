// SPDX-License-Identifier: Apache-2.0
#include "orient/agreement.hpp"

#include <tbb/parallel_sort.h>

#include <algorithm>
#include <cmath>
#include <numeric>
#include <queue>
#include <unordered_map>
#include <utility>

namespace pointfair::orient {
namespace {

// Edges at least so sure are taken one by one: neighbours on a smooth surface are. On edges and thin parts, many
// neighbours vote.
constexpr float kSure = 0.9F;

// Groups of nodes, each node with its sign against the node that leads its group.
class Groups {
 public:
  explicit Groups(std::uint32_t nodes) : leader_(nodes), size_(nodes, 1), flipped_(nodes, 0) {
    std::iota(leader_.begin(), leader_.end(), 0U);
  }

  struct Place {
    std::uint32_t leader;
    bool flipped;
  };
  Place find(std::uint32_t node) {
    std::uint32_t top = node;
    bool flipped = false;
    while (leader_[top] != top) {
      flipped = flipped != (flipped_[top] != 0);
      top = leader_[top];
    }
    const Place result{top, flipped};
    while (leader_[node] != top) {  // the way becomes short
      const std::uint32_t next = leader_[node];
      const bool own = flipped_[node] != 0;
      leader_[node] = top;
      flipped_[node] = flipped ? 1 : 0;
      flipped = flipped != own;
      node = next;
    }
    return result;
  }
  /// Joins two leaders' groups; returns the one that leads both.
  std::uint32_t join(std::uint32_t a, std::uint32_t b, bool opposite) {
    if (size_[a] < size_[b] || (size_[a] == size_[b] && b < a)) std::swap(a, b);
    leader_[b] = a;
    flipped_[b] = opposite ? 1 : 0;
    size_[a] += size_[b];
    return a;
  }

 private:
  std::vector<std::uint32_t> leader_, size_;
  std::vector<std::uint8_t> flipped_;
};

bool surer(const Edge& x, const Edge& y) {
  const float a = std::abs(x.agreement), b = std::abs(y.agreement);
  if (a != b) return a > b;
  return x.a != y.a ? x.a < y.a : x.b < y.b;
}

void join_sure_ones(const std::vector<Edge>& edges, Groups& groups) {
  for (const Edge& edge : edges) {
    if (std::abs(edge.agreement) < kSure) return;
    const auto a = groups.find(edge.a), b = groups.find(edge.b);
    if (a.leader != b.leader) groups.join(a.leader, b.leader, (a.flipped != b.flipped) != (edge.agreement < 0));
  }
}

// Between groups: the sums of the edges' votes, to be joined from the greatest on.
class Votes {
 public:
  Votes(const std::vector<Edge>& edges, Groups& groups) : groups_(groups) {
    for (const Edge& edge : edges) {
      const auto a = groups.find(edge.a), b = groups.find(edge.b);
      if (a.leader == b.leader) continue;
      // An unsure edge counts for little against a few sure ones.
      const double agreement = edge.agreement, vote = agreement * agreement * agreement;
      add(a.leader, b.leader, a.flipped != b.flipped ? -vote : vote);
    }
    for (const auto& [a, others] : sums_)
      for (const auto& [b, sum] : others)
        if (a < b) queue_.push({sum, a, b});
  }

  void join_all() {
    while (!queue_.empty()) {
      const Ballot top = queue_.top();
      queue_.pop();
      const auto from = sums_.find(top.a);
      if (from == sums_.end()) continue;
      const auto there = from->second.find(top.b);
      if (there == from->second.end() || there->second != top.sum) continue;  // it has changed since
      join(top);
    }
  }

 private:
  struct Ballot {
    double sum;
    std::uint32_t a, b;  // a < b
    bool operator<(const Ballot& other) const {
      const double mine = std::abs(sum), its = std::abs(other.sum);
      if (mine != its) return mine < its;
      return a != other.a ? a > other.a : b > other.b;
    }
  };

  void add(std::uint32_t a, std::uint32_t b, double vote) {
    sums_[a][b] += vote;
    sums_[b][a] += vote;
  }

  void join(const Ballot& ballot) {
    const bool opposite = ballot.sum < 0;
    const std::uint32_t into = groups_.join(ballot.a, ballot.b, opposite),
                        gone = into == ballot.a ? ballot.b : ballot.a;
    const auto others = std::move(sums_[gone]);
    sums_.erase(gone);
    auto& mine = sums_[into];
    mine.erase(gone);
    for (const auto& [other, sum] : others) {
      if (other == into) continue;
      auto& its = sums_[other];
      its.erase(gone);
      const double total = mine[other] += opposite ? -sum : sum;
      its[into] = total;
      queue_.push({total, std::min(into, other), std::max(into, other)});
    }
  }

  Groups& groups_;
  std::unordered_map<std::uint32_t, std::unordered_map<std::uint32_t, double>> sums_;
  std::priority_queue<Ballot> queue_;
};

}  // namespace

Signs agreeing_signs(std::uint32_t nodes, std::vector<Edge>& edges) {
  tbb::parallel_sort(edges.begin(), edges.end(), surer);
  Groups groups(nodes);
  join_sure_ones(edges, groups);
  Votes(edges, groups).join_all();
  Signs result;
  result.sign.resize(nodes);
  result.part.resize(nodes);
  std::vector<std::uint32_t> number(nodes, nodes);
  for (std::uint32_t node = 0; node < nodes; ++node) {
    const auto [leader, flipped] = groups.find(node);
    if (number[leader] == nodes) number[leader] = result.parts++;
    result.part[node] = number[leader];
    result.sign[node] = flipped ? -1 : 1;
  }
  return result;
}

}  // namespace pointfair::orient
