// SPDX-License-Identifier: GPL-3.0-or-later
#include "distance/triangle_crossings.h"

#include <Eigen/Geometry>
#include <array>

#include "core/parallel.h"
#include "distance/bvh.h"

namespace arapfields {
namespace {

/// Leaves of the hierarchy in one chunk of work.
constexpr Index leaves_at_once = 64;

using Box = Eigen::AlignedBox3d;

/// Pairs of triangles by their boxes, in a hierarchy that is searched leaf by leaf.
class CrossingSearch {
 public:
  CrossingSearch(const Points& vertices, TrianglesIn triangles, const std::vector<std::int32_t>& same,
                 const Progress& progress)
      : vertices_(vertices),
        triangles_(triangles),
        same_(same),
        tree_(build_topology(vertices, triangles, progress)) {}
  std::vector<TriangleCrossing> run(const Progress& progress) const;

 private:
  Vec3 corner(std::int32_t t, int k) const { return vertices_.row(triangles_(t, k)).transpose(); }
  Box box_of(std::int32_t t) const {
    Box box(corner(t, 0));
    return box.extend(corner(t, 1)).extend(corner(t, 2));
  }
  bool are_joined(std::int32_t a, std::int32_t b) const;
  void search(Index leaf, std::vector<TriangleCrossing>& found) const;
  void compare(std::int32_t a, std::int32_t b, std::vector<TriangleCrossing>& found) const;
  void cross(std::int32_t edge_of, std::int32_t through, std::vector<TriangleCrossing>& found) const;

  const Points& vertices_;
  TrianglesIn triangles_;
  const std::vector<std::int32_t>& same_;
  Topology tree_;
};

bool CrossingSearch::are_joined(std::int32_t a, std::int32_t b) const {
  for (int i = 0; i < 3; ++i)
    for (int j = 0; j < 3; ++j)
      if (same_[static_cast<std::size_t>(triangles_(a, i))] ==
          same_[static_cast<std::size_t>(triangles_(b, j))])
        return true;
  return false;
}

/// Adds the edges of one triangle that pass through another. An edge that only touches it does not.
void CrossingSearch::cross(std::int32_t edge_of, std::int32_t through,
                           std::vector<TriangleCrossing>& found) const {
  const Vec3 a = corner(through, 0), b = corner(through, 1), c = corner(through, 2);
  const Vec3 normal = (b - a).cross(c - a);
  std::array<double, 3> side;
  for (int k = 0; k < 3; ++k) side[k] = normal.dot(corner(edge_of, k) - a);
  for (int k = 0; k < 3; ++k) {
    const int next = (k + 1) % 3;
    if (!((side[k] < 0.0 && side[next] > 0.0) || (side[k] > 0.0 && side[next] < 0.0))) continue;
    const Vec3 from = corner(edge_of, k), way = corner(edge_of, next) - from;
    const Vec3 volumes(way.dot((b - from).cross(c - from)), way.dot((c - from).cross(a - from)),
                       way.dot((a - from).cross(b - from)));
    if (!((volumes.array() > 0.0).all() || (volumes.array() < 0.0).all())) continue;
    const double share = side[k] / (side[k] - side[next]);
    Vec3 edge_at = Vec3::Zero();
    edge_at[k] = 1.0 - share;
    edge_at[next] = share;
    found.push_back({edge_of, through, edge_at, volumes / volumes.sum()});
  }
}

void CrossingSearch::compare(std::int32_t a, std::int32_t b, std::vector<TriangleCrossing>& found) const {
  if (are_joined(a, b)) return;
  cross(a, b, found);
  cross(b, a, found);
}

/// Compares the triangles of a leaf with each other, and with those of the leaves behind it.
void CrossingSearch::search(Index number, std::vector<TriangleCrossing>& found) const {
  const Topology::Leaf& own = tree_.leaves[static_cast<std::size_t>(number)];
  const std::int32_t* const mine = tree_.triangles.data() + own.begin;
  std::array<Box, tree_width> boxes;
  Box whole;
  for (int i = 0; i < own.count; ++i) {
    boxes[i] = box_of(mine[i]);
    whole.extend(boxes[i]);
    for (int j = 0; j < i; ++j)
      if (boxes[j].intersects(boxes[i])) compare(mine[j], mine[i], found);
  }
  const Eigen::Array3f low = whole.min().cast<float>().array(), high = whole.max().cast<float>().array();
  const auto meets = [&](const WideNode& node, int child) {
    for (int k = 0; k < 3; ++k)
      if (node.low[k][child] > high[k] || node.high[k][child] < low[k]) return false;
    return true;
  };
  std::vector<std::int32_t> pending{0};
  while (!pending.empty()) {
    const WideNode& node = tree_.nodes[static_cast<std::size_t>(pending.back())];
    pending.pop_back();
    for (int child = 0; child < node.count; ++child) {
      if (!meets(node, child)) continue;
      if (node.child[child] >= 0) {
        pending.push_back(node.child[child]);
        continue;
      }
      if (~node.child[child] <= number) continue;
      const Topology::Leaf& other = tree_.leaves[static_cast<std::size_t>(~node.child[child])];
      for (Index j = other.begin; j < other.begin + other.count; ++j) {
        const std::int32_t t = tree_.triangles[static_cast<std::size_t>(j)];
        const Box box = box_of(t);
        for (int i = 0; i < own.count; ++i)
          if (boxes[i].intersects(box)) compare(mine[i], t, found);
      }
    }
  }
}

std::vector<TriangleCrossing> CrossingSearch::run(const Progress& progress) const {
  const Index leaves = std::ssize(tree_.leaves), chunks = (leaves + leaves_at_once - 1) / leaves_at_once;
  std::vector<std::vector<TriangleCrossing>> found(static_cast<std::size_t>(chunks));
  parallel_jobs(chunks, [&](Index chunk) {
    progress.check();
    for (Index leaf = chunk * leaves_at_once; leaf < std::min(leaves, (chunk + 1) * leaves_at_once); ++leaf)
      search(leaf, found[static_cast<std::size_t>(chunk)]);
  });
  std::vector<TriangleCrossing> all;
  for (const std::vector<TriangleCrossing>& some : found) all.insert(all.end(), some.begin(), some.end());
  return all;
}

}  // namespace

std::vector<TriangleCrossing> triangle_crossings(const Points& vertices, TrianglesIn triangles,
                                                 const std::vector<std::int32_t>& same,
                                                 const Progress& progress) {
  if (triangles.rows() < 2) return {};
  return CrossingSearch(vertices, triangles, same, progress).run(progress);
}

}  // namespace arapfields
