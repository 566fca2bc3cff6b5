// SPDX-License-Identifier: Apache-2.0
#include "seam/cloud_sample.hpp"

#include <cmath>
#include <limits>

#include "portable.hpp"

namespace pointfair {
namespace {

// By hash, then by position.
bool comes_before(const SampleCandidate& a, const SampleCandidate& b) {
  return a.hash != b.hash ? a.hash < b.hash : point::lies_before(to_vec3(a.point), to_vec3(b.point));
}
bool same_cell(const SampleCandidate& a, const SampleCandidate& b) { return a.hash == b.hash; }

constexpr int kMostRefinements = 4;  // cells are then 2^48 along the cloud
constexpr std::uint32_t kAll = std::numeric_limits<std::uint32_t>::max();

}  // namespace

// Hashes spread evenly, so that buckets of equal width hold one or two each: O(N).
void order_candidates(std::vector<SampleCandidate>& candidates) {
  if (candidates.size() < 2) return;
  const std::size_t buckets = candidates.size();
  std::uint64_t most = 0;
  for (const SampleCandidate& candidate : candidates) most = std::max<std::uint64_t>(most, candidate.hash);
  const auto bucket_of = [&](const SampleCandidate& candidate) {
    return std::size_t(candidate.hash * std::uint64_t(buckets) / (most + 1));
  };
  std::vector<std::uint32_t> next(buckets + 1, 0);
  for (const SampleCandidate& candidate : candidates) ++next[bucket_of(candidate) + 1];
  for (std::size_t bucket = 0; bucket < buckets; ++bucket) next[bucket + 1] += next[bucket];
  std::vector<SampleCandidate> ordered(candidates.size());
  for (const SampleCandidate& candidate : candidates) ordered[next[bucket_of(candidate)]++] = candidate;
  std::uint32_t begin = 0;
  for (std::size_t bucket = 0; bucket < buckets; ++bucket) {  // now next[] is where each ends
    if (next[bucket] - begin > 1) std::sort(ordered.begin() + begin, ordered.begin() + next[bucket], comes_before);
    begin = next[bucket];
  }
  ordered.erase(std::unique(ordered.begin(), ordered.end(), same_cell), ordered.end());
  candidates = std::move(ordered);
}

double diagonal_of(const Bounds& b) {
  return portable::hypot(double(b.max.x) - b.min.x, double(b.max.y) - b.min.y, double(b.max.z) - b.min.z);
}

double float_step_of(const Bounds& b, const std::array<double, 3>& origin) {
  if (origin == std::array<double, 3>{}) return 0;
  float farthest = 0;
  for (const Point& corner : {b.min, b.max})
    farthest = std::max({farthest, std::abs(corner.x), std::abs(corner.y), std::abs(corner.z)});
  return double(std::nextafter(farthest, std::numeric_limits<float>::infinity())) - double(farthest);
}

Candidates first_candidates(std::uint64_t valid, std::size_t count) {
  const double share = (double(count) + 64) * 1.1 / double(valid);
  return {share < 1 ? std::uint32_t(share * kAll) : kAll, 0};
}

Candidates with_more(Candidates wanted) {
  return {wanted.limit > kAll / 16 ? kAll : 16 * wanted.limit, wanted.refinement};
}
Candidates refined(Candidates wanted) { return {wanted.limit, wanted.refinement + 1}; }

CloudSample draw_sample(const Bounds& bounds, std::size_t count, const Collect& collect) {
  if (bounds.valid == 0 || count == 0) return {bounds, {}, {}};
  const auto expected = std::size_t(std::min<std::uint64_t>(count, bounds.valid));
  std::vector<SampleCandidate> candidates;
  for (Candidates wanted = first_candidates(bounds.valid, count);;) {
    candidates = collect(wanted);
    order_candidates(candidates);
    if (candidates.size() >= expected) break;
    if (candidates.size() < expected / 2 && wanted.refinement < kMostRefinements) {
      wanted = refined(wanted);  // most of the cloud may share few cells, since some points lie far from it
    } else if (wanted.limit < kAll) {
      wanted = with_more(wanted);  // many points share places
    } else {
      break;
    }
  }
  candidates.resize(std::min(candidates.size(), count));
  CloudSample sample{bounds, {}, {}};
  sample.points.reserve(candidates.size());
  sample.indices.reserve(candidates.size());
  for (const SampleCandidate& candidate : candidates) {
    sample.points.push_back(candidate.point);
    sample.indices.push_back(candidate.index);
  }
  return sample;
}

}  // namespace pointfair
