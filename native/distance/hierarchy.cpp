// SPDX-License-Identifier: GPL-3.0-or-later
#include "distance/hierarchy.h"

#include <algorithm>
#include <array>
#include <cmath>

#include "core/errors.h"
#include "core/parallel.h"
#include "distance/bvh_topology.h"
#include "distance/disk.h"
#include "distance/multipole.h"
#include "distance/triangle_packet.h"
#include "mesh/triangle_mesh.h"

namespace arapfields {
namespace {

/// The bounds and moments of a child, from which those of its parent are made.
struct Summary {
  Disk disk;
  Multipole multipole;
};

/// Fills in packets, disks and moments from the leaves up.
class Summarizer {
 public:
  Summarizer(const Points& vertices, TrianglesIn triangles, const Topology& topology, WideNode* nodes,
             NodeMoments* moments, TrianglePacket* packets)
      : vertices_(vertices),
        triangles_(triangles),
        topology_(topology),
        nodes_(nodes),
        moments_(moments),
        packets_(packets),
        finished_(topology.subtrees.size()) {}

  void run(const Progress& progress) {
    parallel_jobs(static_cast<Index>(finished_.size()), [&](Index job) {
      progress.check();
      finished_[job] = node(topology_.subtrees[job]);
    });
    top(0);
  }

 private:
  Summary leaf(std::int32_t number) {
    const Topology::Leaf& leaf = topology_.leaves[number];
    const std::int32_t* triangles = topology_.triangles.data() + leaf.begin;
    std::array<Vec3, 3 * tree_width> corners;
    std::array<Disk, 3 * tree_width> points;
    for (int i = 0; i < 3 * leaf.count; ++i) {
      corners[i] = vertices_.row(triangles_(triangles[i / 3], i % 3)).transpose();
      points[i].center = corners[i];
    }
    fill(packets_[number], corners.data(), triangles, leaf.count);
    const Multipole multipole = multipole_of(corners.data(), leaf.count);
    return {disk_around(points.data(), 3 * leaf.count, multipole.dipole), multipole};
  }

  template <class SummaryOf>
  Summary summarize(std::int32_t number, const SummaryOf& summary_of) {
    WideNode& wide = nodes_[number];
    std::array<Multipole, tree_width> multipoles;
    std::array<Disk, tree_width> disks;
    for (int i = 0; i < wide.count; ++i) {
      const Summary child = summary_of(wide.child[i]);
      multipoles[i] = child.multipole;
      disks[i] = child.disk;
      store(child.disk, wide, i);
      store(child.multipole, moments_[number], i);
    }
    for (int i = wide.count; i < tree_width; ++i) store_nothing(moments_[number], i);
    const Multipole sum = multipole_of(multipoles.data(), wide.count);
    return {disk_around(disks.data(), wide.count, sum.dipole), sum};
  }

  Summary node(std::int32_t number) {
    return summarize(number, [&](std::int32_t child) { return child < 0 ? leaf(~child) : node(child); });
  }

  /// Summarises a node at or above the roots of the subtrees, which are done already.
  Summary top(std::int32_t number) {
    return summarize(number, [&](std::int32_t child) {
      if (child < 0) return leaf(~child);
      const auto subtree = std::lower_bound(topology_.subtrees.begin(), topology_.subtrees.end(), child);
      if (subtree == topology_.subtrees.end() || *subtree != child) return top(child);
      return finished_[subtree - topology_.subtrees.begin()];
    });
  }

  const Points& vertices_;
  TrianglesIn triangles_;
  const Topology& topology_;
  WideNode* nodes_;
  NodeMoments* moments_;
  TrianglePacket* packets_;
  std::vector<Summary> finished_;
};

}  // namespace

Hierarchy::Hierarchy(PointsIn vertices, TrianglesIn triangles, const Progress& progress) {
  const Points used = used_vertices(vertices, triangles);
  const Vec3 low = used.colwise().minCoeff(), high = used.colwise().maxCoeff();
  require((high - low).allFinite(), "vertices", "their bounding box is too large for floating point",
          "its sides must be finite");
  center_ = 0.5 * low + 0.5 * high;
  const double half = (high - center_).maxCoeff();
  if (half > 0.0) factor_ = std::ldexp(1.0, std::clamp(-std::ilogb(half) - 1, -1000, 1000));
  const Points normalized_vertices = (vertices.rowwise() - center_.transpose()) * factor_;

  progress.check();
  Topology topology = build_topology(normalized_vertices, triangles, progress);
  nodes_ = std::move(topology.nodes);
  moments_.resize(nodes_.size());
  packet_count_ = static_cast<std::int32_t>(topology.leaves.size());
  packets_.reset(new TrianglePacket[topology.leaves.size()]);
  Summarizer(normalized_vertices, triangles, topology, nodes_.data(), moments_.data(), packets_.get())
      .run(progress);
}

HierarchyView Hierarchy::view() const {
  return {nodes_.data(), moments_.data(), packets_.get(), packet_count_};
}

}  // namespace arapfields
