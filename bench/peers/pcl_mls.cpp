// SPDX-License-Identifier: Apache-2.0
// Peer: PCL's MovingLeastSquares (order 2, OpenMP). It knows a radius and no k, so the radius that holds k points for
// the median point is measured while preparing, which is not counted.
#include <pcl/pcl_config.h>
#include <pcl/point_types.h>
#include <pcl/search/kdtree.h>
#include <pcl/surface/mls.h>

#include <cmath>

#include "peer.hpp"

namespace {

using Cloud = pcl::PointCloud<pcl::PointXYZ>;

Cloud::Ptr cloud_of(const std::vector<peer::Point>& points) {
  const Cloud::Ptr cloud(new Cloud);
  cloud->reserve(points.size());
  for (const peer::Point& p : points) cloud->push_back(pcl::PointXYZ(p.x, p.y, p.z));
  return cloud;
}

double median_radius(const Cloud::Ptr& cloud, int k) {
  constexpr std::size_t kSamples = 1000;
  pcl::search::KdTree<pcl::PointXYZ> tree;
  tree.setInputCloud(cloud);
  std::vector<double> radii;
  for (std::size_t i = 0; i < cloud->size(); i += std::max<std::size_t>(1, cloud->size() / kSamples)) {
    pcl::Indices found;
    std::vector<float> squared_distances;
    tree.nearestKSearch((*cloud)[i], k, found, squared_distances);
    radii.push_back(std::sqrt(squared_distances.back()));
  }
  return peer::median(radii);
}

peer::Outcome run(const std::vector<peer::Point>& points, double radius, unsigned threads) {
  pcl::MovingLeastSquares<pcl::PointXYZ, pcl::PointXYZ> filter;
  filter.setInputCloud(cloud_of(points));
  filter.setSearchMethod(pcl::search::KdTree<pcl::PointXYZ>::Ptr(new pcl::search::KdTree<pcl::PointXYZ>));
  filter.setSearchRadius(radius);
  filter.setNumberOfThreads(threads);
  Cloud smooth;
  filter.process(smooth);
  peer::Outcome outcome;
  outcome.points.reserve(smooth.size());
  for (const pcl::PointXYZ& p : smooth) outcome.points.push_back({p.x, p.y, p.z});
  return outcome;
}

peer::Run prepare(const std::vector<peer::Point>& points, const peer::Arguments& arguments) {
  const double radius = median_radius(cloud_of(points), arguments.k);
  return [&points, radius, threads = arguments.threads] { return run(points, radius, threads); };
}

}  // namespace

int main(int argc, char** argv) { return peer::peer_main(argc, argv, "pcl_mls", "PCL " PCL_VERSION_PRETTY, prepare); }
