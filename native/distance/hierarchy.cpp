// SPDX-License-Identifier: GPL-3.0-or-later
#include "distance/hierarchy.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <numbers>

#include "core/errors.h"
#include "core/parallel.h"
#include "distance/bvh.h"
#include "mesh/triangle_mesh.h"

namespace arapfields {
namespace {

/// Half extent of a disk along a unit direction, by its cosine with the disk's normal.
double half_extent_along(double height, double radius, double cosine) {
  return height * std::abs(cosine) + radius * std::sqrt(std::max(0.0, 1.0 - cosine * cosine));
}

}  // namespace

Disk disk_around(const Disk* parts, int count, const Vec3& direction) {
  Disk disk;
  const double length = direction.norm();
  if (length > 0.0) disk.normal = direction / length;
  Mat3 axes;  // rows: two tangents and the normal
  axes.row(0) = disk.normal.unitOrthogonal().transpose();
  axes.row(1) = disk.normal.cross(axes.row(0).transpose()).transpose();
  axes.row(2) = disk.normal.transpose();
  Vec3 low = Vec3::Constant(INFINITY), high = -low;
  for (int i = 0; i < count; ++i) {
    const Vec3 center = axes * parts[i].center, cosines = axes * parts[i].normal;
    for (int k = 0; k < 3; ++k) {
      const double extent = half_extent_along(parts[i].height, parts[i].radius, cosines[k]);
      low[k] = std::min(low[k], center[k] - extent);
      high[k] = std::max(high[k], center[k] + extent);
    }
  }
  const Vec3 middle = 0.5 * (low + high);
  disk.center = axes.transpose() * middle;
  disk.height = 0.5 * (high[2] - low[2]);
  for (int i = 0; i < count; ++i) {
    const double offset = (axes * parts[i].center - middle).head<2>().norm();
    const double cosine = disk.normal.dot(parts[i].normal);
    const double sine = std::sqrt(std::max(0.0, 1.0 - cosine * cosine));
    disk.radius = std::max(disk.radius, offset + parts[i].radius + parts[i].height * sine);
  }
  return disk;
}

void store(const Disk& disk, WideNode& node, int lane) {
  for (int k = 0; k < 3; ++k) {
    node.disk_center[k][lane] = static_cast<float>(disk.center[k]);
    node.disk_normal[k][lane] = static_cast<float>(disk.normal[k]);
  }
  node.disk_height[lane] = static_cast<float>(disk.height * (1.0 + 1e-6) + 1e-6);
  node.disk_radius[lane] = static_cast<float>(disk.radius * (1.0 + 1e-6) + 1e-6);
}

namespace {

/// Adds `part`, moved to the center of `sum`.
void add_shifted(const Multipole& part, Multipole& sum) {
  const Vec3 s = part.center - sum.center;
  sum.radius = std::max(sum.radius, s.norm() + part.radius);
  sum.dipole += part.dipole;
  sum.quadrupole += part.quadrupole + s * part.dipole.transpose();
  for (int k = 0; k < 3; ++k) {
    const Vec3 q = part.quadrupole.col(k);
    sum.octupole[k] +=
        part.octupole[k] + s * q.transpose() + q * s.transpose() + s * s.transpose() * part.dipole[k];
  }
}

}  // namespace

Multipole multipole_of(const Vec3* corners, int triangle_count) {
  Multipole sum;
  Vec3 plain_mean = Vec3::Zero();
  for (int t = 0; t < triangle_count; ++t) {
    const Vec3 *v = corners + 3 * t, centroid = (v[0] + v[1] + v[2]) / 3.0;
    const double area = 0.5 * (v[1] - v[0]).cross(v[2] - v[0]).norm();
    sum.area += area;
    sum.center += area * centroid;
    plain_mean += centroid / triangle_count;
  }
  sum.center = sum.area > 0.0 ? Vec3(sum.center / sum.area) : plain_mean;
  for (int t = 0; t < triangle_count; ++t) {
    const Vec3 *v = corners + 3 * t, centroid = (v[0] + v[1] + v[2]) / 3.0;
    const Vec3 area_normal = 0.5 * (v[1] - v[0]).cross(v[2] - v[0]);
    const Vec3 g = centroid - sum.center;
    // Second moments of a triangle about its centroid: A/12 Σ (v − centroid)(v − centroid)ᵀ.
    Mat3 second = g * g.transpose();
    for (int k = 0; k < 3; ++k) {
      const Vec3 d = v[k] - centroid;
      second += d * d.transpose() / 12.0;
      sum.radius = std::max(sum.radius, (v[k] - sum.center).norm());
    }
    sum.dipole += area_normal;
    sum.quadrupole += g * area_normal.transpose();
    for (int k = 0; k < 3; ++k) sum.octupole[k] += second * area_normal[k];
  }
  return sum;
}

Multipole multipole_of(const Multipole* parts, int count) {
  Multipole sum;
  Vec3 plain_mean = Vec3::Zero();
  for (int i = 0; i < count; ++i) {
    sum.area += parts[i].area;
    sum.center += parts[i].area * parts[i].center;
    plain_mean += parts[i].center / count;
  }
  sum.center = sum.area > 0.0 ? Vec3(sum.center / sum.area) : plain_mean;
  for (int i = 0; i < count; ++i) add_shifted(parts[i], sum);
  return sum;
}

void store(const Multipole& m, NodeMoments& moments, int lane) {
  constexpr double solid = 1.0 / (4.0 * std::numbers::pi);
  for (int k = 0; k < 3; ++k) moments.center[k][lane] = static_cast<float>(m.center[k]);
  const double radius = m.radius * (1.0 + 1e-6);  // the center moved when it was rounded
  moments.radius_squared[lane] = static_cast<float>(radius * radius);
  moments.area[lane] = static_cast<float>(solid * m.area);
  for (int k = 0; k < 3; ++k) moments.dipole[k][lane] = static_cast<float>(solid * m.dipole[k]);

  // −3 (sym Q − tr Q / 3 I)
  Mat3 q = 0.5 * (m.quadrupole + m.quadrupole.transpose());
  q -= q.trace() / 3.0 * Mat3::Identity();
  const double quadrupole[5] = {q(0, 0), q(1, 1), 2 * q(0, 1), 2 * q(0, 2), 2 * q(1, 2)};
  for (int k = 0; k < 5; ++k) moments.quadrupole[k][lane] = static_cast<float>(-3.0 * solid * quadrupole[k]);

  // 15/2 (sym T − 3/5 sym(δ t)), t_i = Σ_j (sym T)_ijj
  const auto sym = [&](int i, int j, int k) {
    return (m.octupole[k](i, j) + m.octupole[j](i, k) + m.octupole[i](j, k)) / 3.0;
  };
  Vec3 trace;
  for (int i = 0; i < 3; ++i) trace[i] = sym(i, 0, 0) + sym(i, 1, 1) + sym(i, 2, 2);
  const auto s = [&](int i, int j, int k) {
    return sym(i, j, k) -
           0.2 * ((i == j ? trace[k] : 0.0) + (i == k ? trace[j] : 0.0) + (j == k ? trace[i] : 0.0));
  };
  const double octupole[7] = {s(0, 0, 0), s(1, 1, 1), 3 * s(0, 0, 1), 3 * s(0, 1, 1),
                              s(0, 0, 2), s(1, 1, 2), 6 * s(0, 1, 2)};
  for (int k = 0; k < 7; ++k) moments.octupole[k][lane] = static_cast<float>(7.5 * solid * octupole[k]);
}

void store_nothing(NodeMoments& moments, int lane) {
  store(Multipole{}, moments, lane);
  moments.center[0][lane] = 1e3f;  // away from every query, so that nothing is divided by zero
  moments.radius_squared[lane] = -1.0f;
}

namespace {

/// A triangle in its own plane, as TrianglePacket stores it.
struct Planar {
  Vec3 origin, x, y, z;
  double bx, cx, cy;
};

Vec3 any_perpendicular(const Vec3& unit) {
  int smallest = 0;
  unit.cwiseAbs().minCoeff(&smallest);
  return unit.cross(Vec3::Unit(smallest)).normalized();
}

/// The x axis is along the longest side: if a needle's plane is lost to rounding, no point of it moves by
/// more than the rounding error of that side.
Planar in_its_plane(const Vec3* v) {
  int start = 0;
  double longest = -1.0;
  for (int k = 0; k < 3; ++k) {
    const double length = (v[(k + 1) % 3] - v[k]).squaredNorm();
    if (length > longest) {
      longest = length;
      start = k;
    }
  }
  const Vec3 a = v[start], ab = v[(start + 1) % 3] - a, ac = v[(start + 2) % 3] - a;
  const double length = ab.norm();
  const Vec3 x = length > 0.0 ? Vec3(ab / length) : Vec3(Vec3::UnitX());
  const double along = x.dot(ac);
  const Vec3 across = ac - along * x;
  double height = across.norm();
  Vec3 y;
  if (height > 4.0 * std::numeric_limits<double>::epsilon() * length) {
    y = across / height;
    y = (y - y.dot(x) * x).normalized();
  } else {
    y = any_perpendicular(x);
    height = 0.0;
  }
  return {a, x, y, x.cross(y), length, along, height};
}

double inverse_square(double x, double y) {
  const double square = x * x + y * y;
  return square > 1e-300 ? 1.0 / square : 0.0;
}

void store(const Planar& planar, std::int32_t number, TrianglePacket& packet, int lane) {
  for (int k = 0; k < 3; ++k) {
    packet.origin[k][lane] = planar.origin[k];
    packet.axis_x[k][lane] = planar.x[k];
    packet.axis_y[k][lane] = planar.y[k];
    packet.axis_z[k][lane] = planar.z[k];
  }
  packet.bx[lane] = planar.bx;
  packet.cx[lane] = planar.cx;
  packet.cy[lane] = planar.cy;
  packet.inverse_ac[lane] = inverse_square(planar.cx, planar.cy);
  packet.inverse_bc[lane] = inverse_square(planar.bx - planar.cx, planar.cy);
  packet.triangle[lane] = number;
}

}  // namespace

void fill(TrianglePacket& packet, const Vec3* corners, const std::int32_t* numbers, int count) {
  for (int lane = 0; lane < count; ++lane) {
    store(in_its_plane(corners + 3 * lane), numbers[lane], packet, lane);
  }
  const Planar point{corners[0], Vec3::UnitX(), Vec3::UnitY(), Vec3::UnitZ(), 0.0, 0.0, 0.0};
  for (int lane = count; lane < tree_width; ++lane) store(point, numbers[0], packet, lane);
}

Vec3 closest_point(const TrianglePacket& p, int lane, const Vec3& point) {
  Vec3 origin, axis_x, axis_y;
  for (int k = 0; k < 3; ++k) {
    origin[k] = p.origin[k][lane];
    axis_x[k] = p.axis_x[k][lane];
    axis_y[k] = p.axis_y[k][lane];
  }
  const double x = axis_x.dot(point - origin), y = axis_y.dot(point - origin);
  const double bx = p.bx[lane], cx = p.cx[lane], cy = p.cy[lane], ex = cx - bx;
  const auto on_plane = [&](double u, double v) { return Vec3(origin + u * axis_x + v * axis_y); };
  if (y > 0.0 && x * cy - y * cx > 0.0 && y * ex - (x - bx) * cy > 0.0) return on_plane(x, y);
  const double ab = std::clamp(x, 0.0, bx);
  const double ac = std::clamp((x * cx + y * cy) * p.inverse_ac[lane], 0.0, 1.0);
  const double bc = std::clamp(((x - bx) * ex + y * cy) * p.inverse_bc[lane], 0.0, 1.0);
  const Eigen::Vector2d candidates[3] = {{ab, 0.0}, {ac * cx, ac * cy}, {bx + bc * ex, bc * cy}};
  const Eigen::Vector2d* best = candidates;
  for (const auto& candidate : candidates)
    if ((candidate - Eigen::Vector2d(x, y)).squaredNorm() < (*best - Eigen::Vector2d(x, y)).squaredNorm())
      best = &candidate;
  return on_plane(best->x(), best->y());
}

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
