// SPDX-License-Identifier: Apache-2.0
// The first step: a chunk of the input, sorted by leaf.
#pragma once

#include <filesystem>
#include <stop_token>

#include "scale/leaf_tree.hpp"
#include "scale/plan.hpp"

namespace pointfair::scale {

/// Writes the valid points of the chunk relative to the middles of their zones, without those that are ignored, and
/// what they show of the cloud's origin and zones. Memory: kBytesOfChunkPoint a point.
void ingest(const std::shared_ptr<Source>& source, const InputChunk& chunk, const Plan& plan, const LeafTree& tree,
            unsigned threads, const std::filesystem::path& path, const std::stop_token& stop);

/// What all points together show: the origin that a whole file is read with, and the zones.
Zones zones_of(const std::vector<std::filesystem::path>& ingested, const Plan& plan);

}  // namespace pointfair::scale
