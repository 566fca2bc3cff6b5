// SPDX-License-Identifier: Apache-2.0
#include "cuda/stages/mesh_on_card.cuh"

namespace pointfair::cuda {
namespace {

constexpr int kBlock = 256;

__global__ void __launch_bounds__(kBlock)
    place_vertices(const __grid_constant__ Tree tree, MeshView mesh, Index* place) {
  const std::size_t at = std::size_t(blockIdx.x) * kBlock + threadIdx.x;
  if (at >= std::size_t(tree.leaves) * kLeafSize || !tree.holds(at)) return;
  const Index point = original_of(tree.points[at]), vertex = mesh.vertex[point];
  if (mesh.first[vertex] == point) place[vertex] = static_cast<Index>(at);
}

__global__ void __launch_bounds__(kBlock) place_neighbors(MeshView mesh, const Index* place, Index* there) {
  const std::size_t n = std::size_t(blockIdx.x) * kBlock + threadIdx.x;
  if (n < mesh.edge_ends) there[n] = place[mesh.neighbors[n]];
}

__global__ void __launch_bounds__(kBlock)
    find_ends(const __grid_constant__ Tree tree, MeshView mesh, const Index* place, SortedEnds* ends) {
  const std::size_t at = std::size_t(blockIdx.x) * kBlock + threadIdx.x;
  if (at >= std::size_t(tree.leaves) * kLeafSize) return;
  SortedEnds its{0, 0, point::kNoNeighbor};
  if (tree.holds(at)) {
    const Index vertex = mesh.vertex[original_of(tree.points[at])];
    const std::uint64_t begin = mesh.begin[vertex];
    its = {begin, static_cast<unsigned>(mesh.begin[vertex + 1] - begin), place[vertex]};
  }
  ends[at] = its;
}

__global__ void __launch_bounds__(kBlock) put_boundary_back(const __grid_constant__ Tree tree, MeshView mesh,
                                                            Normals normals, Point* faired, unsigned long long* held) {
  const std::size_t at = std::size_t(blockIdx.x) * kBlock + threadIdx.x;  // whole leaves, so whole warps
  if (at >= std::size_t(tree.leaves) * kLeafSize) return;
  bool counts = false;
  if (tree.holds(at)) {
    const float4 p = tree.points[at];
    const Index point = original_of(p);
    if (mesh.is_boundary[mesh.vertex[point]] != 0) {
      faired[point] = {p.x, p.y, p.z};
      const Vec normal = normals.at(at);
      counts = normal.x != 0 || normal.y != 0 || normal.z != 0;  // others are counted by their reason
    }
  }
  const unsigned those = __ballot_sync(kAllLanes, counts);
  if (lane_number() == 0 && those != 0) atomicAdd(held, static_cast<unsigned long long>(__popc(those)));
}

}  // namespace

MeshOnCard::MeshOnCard(Context& context)
    : vertex_(context), first_(context), neighbors_(context), begin_(context), is_boundary_(context) {}

MeshView MeshOnCard::of(const std::shared_ptr<const MeshEdges>& edges) {
  if (edges != edges_) {
    edges_.reset();  // if memory is short
    vertex_.upload(edges->vertex, "uploading edges");
    first_.upload(edges->first, "uploading edges");
    begin_.upload(edges->begin, "uploading edges");
    neighbors_.upload(edges->neighbors, "uploading edges");
    is_boundary_.upload(edges->is_boundary, "uploading edges");
    edges_ = edges;
  }
  return {vertex_.data(),      first_.data(),     begin_.data(),    neighbors_.data(),
          is_boundary_.data(), edges->vertices(), neighbors_.size()};
}

SortedEdgesView SortedEdges::find(const Tree& tree, const MeshView& mesh) {
  const std::size_t places = std::size_t(tree.leaves) * kLeafSize;
  const cudaStream_t stream = context_.stream();
  of_.resize(places);
  there_.resize(mesh.edge_ends);
  place_.resize(mesh.vertices);
  if (places == 0) return {of_.data(), there_.data()};
  if (mesh.vertices > 0)
    check(cudaMemsetAsync(place_.data(), 0xff, mesh.vertices * sizeof(Index), stream), "finding vertices");
  place_vertices<<<blocks_for(places, kBlock), kBlock, 0, stream>>>(tree, mesh, place_.data());
  place_neighbors<<<blocks_for(mesh.edge_ends, kBlock), kBlock, 0, stream>>>(mesh, place_.data(), there_.data());
  launch(context_, "finding vertices", find_ends, blocks_for(places, kBlock), kBlock, tree, mesh, place_.data(),
         of_.data());
  return {of_.data(), there_.data()};
}

void keep_boundary(Context& context, const Tree& tree, const MeshView& mesh, Normals normals, Point* faired,
                   unsigned long long* held) {
  launch(context, "keeping the boundary", put_boundary_back, blocks_for(std::size_t(tree.leaves) * kLeafSize, kBlock),
         kBlock, tree, mesh, normals, faired, held);
}

}  // namespace pointfair::cuda
