// SPDX-License-Identifier: Apache-2.0
// Neighbour lists of all points: the fast search for leaves together (group_search.cuh), the exact one for single
// queries (single_search.cuh), the constrained rule, and the area weight's mean distances.
#pragma once

#include "cuda/runtime/memory.cuh"
#include "cuda/runtime/stop.cuh"
#include "cuda/search/lists.cuh"

namespace pointfair::cuda {

inline constexpr int kLargestGroupList = 64;
inline constexpr int kLargestList = 1024;

struct NearestQuery {
  int k;
  float squared_limit;  // infinite for none
};

// A leaf that is left to the exact searches.
struct HardLeaf {
  Index leaf;
  unsigned undecided;  // a bit for each of its queries whose list is not known
};

// Room for the leaves and the queries that the fast search leaves to the exact ones: each may be all of them.
struct Retries {
  HardLeaf* leaves;
  Index* queries;
};

// The k nearest other points of every point. state->leaf_retries and state->retries must be 0. After a stop some lists
// of more than kLargestGroupList are empty.
void find_nearest(Context& context, const Tree& tree, CloudState* state, NearestQuery query, Index* list,
                  Retries retries, const Stop& stop);

// The same for k <= kLargestGroupList and the points of some leaves, among those that the tree holds, in two steps that
// may be on different streams: the fast search, then those that it leaves.
void find_nearest_of(Context& context, const Tree& tree, CloudState* state, LeafRange leaves, NearestQuery query,
                     Index* list, Retries retries);
void find_nearest_of_left(Context& context, const Tree& tree, LeafRange leaves, NearestQuery query, Index* list,
                          Retries retries);

// The first step again for those of these leaves that may have nearer points in `later`, a tree of points that were
// missing then.
void find_nearest_again(Context& context, const Tree& tree, const Tree& later, CloudState* state, LeafRange leaves,
                        NearestQuery query, Index* list, Retries retries);

// Grows constrained neighbourhoods of k points over the nearest that `candidates` holds, at least k, and over as many
// more as it takes. Adds to state->short_neighborhoods. `mean_distance`, if not null, becomes that of
// measure_mean_distances(). After a stop some neighbourhoods are smaller.
void grow_neighborhoods(Context& context, const Tree& tree, CloudState* state, NearestQuery query, float reach,
                        Lists candidates, Index* list, Index* retries, float* mean_distance, const Stop& stop);

// Mean distance to the first five listed.
void measure_mean_distances(Context& context, const Tree& tree, Lists lists, float* mean_distance);

}  // namespace pointfair::cuda
