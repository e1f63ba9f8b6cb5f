// SPDX-License-Identifier: GPL-3.0-or-later
#include "solve/radial/self_contact.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "core/errors.h"
#include "core/parallel.h"
#include "sampling/sample_choice.h"

namespace arapfields {
namespace {

/// Places whose distance inside the shape is less, in cube units, do not meet: no field parts the sides of a
/// crease or the web between two fingers, which its functions reach over.
constexpr double far_inside = 0.15;
/// Cosine of two normals below which their places face each other.
constexpr double facing = -0.1;
/// Gaps at rest are looked for up to here, in cube units.
constexpr double near_at_rest = 0.05;
/// What a way that starts at a solved shape may have as overlap, in cube units.
constexpr double shallow = 0.01;
/// Samples that are farther aside than so many spacings do not face each other.
constexpr double spacings_aside = 2.0;
/// Places where winding numbers are taken, and by how much more than at rest these are inside another part.
constexpr Index most_probes = 500;
constexpr double inside_another = 0.6;

}  // namespace

SelfContact::SelfContact(const RadialProblem& problem, const std::vector<Index>& rows, double kept) {
  const SurfaceSamples& samples = problem.samples;
  require(samples.normals.rows() == samples.size(), "itself", "samples without normals",
          "normals are needed");
  const Points places = rows_of(samples.points, rows), normals = rows_of(samples.normals, rows);
  const auto n = places.rows();
  inside_ = RowMatrix<double>::Zero(n, 6);
  inside_.leftCols(3) = places;
  if (problem.basis.embedding) {
    Points embedded(n, 3);
    problem.basis.embedding->evaluate(places, {embedded.data(), n, JetOrder::value});
    inside_.rightCols(3) = embedded;
  }
  if (!samples.mesh_indices.empty())
    for (const Index row : rows) meshes_.push_back(samples.mesh_indices[static_cast<std::size_t>(row)]);
  widths_ = 2.0 * problem.shape->thickness->at(places);
  const PointGrid grid(places, near_at_rest);  // about a square of the surface lies in each cell
  const double share = static_cast<double>(grid.size()) / static_cast<double>(n);
  aside_ = spacings_aside * near_at_rest * std::sqrt(share);
  least_ = Vector::Constant(n, kept);
  Vector at_rest = least_;
  for (const FacingPair& pair : search(places, [&] { return normals; }, near_at_rest, Beyond::all))
    for (const Index i : {pair.first, pair.second})
      at_rest[i] = std::min(at_rest[i], std::max(0.0, pair.gap));
  least_ = at_rest;
  for (Index i = 0; i < n; i += std::max<Index>(1, n / most_probes)) probes_.push_back(i);
  windings_ = windings(places, normals);
  Vector sorted = windings_;
  const Index half = sorted.size() / 2;
  std::nth_element(sorted.begin(), sorted.begin() + half, sorted.end());
  share_ = 1.0 / std::max(sorted[half], 1e-12);  // most probes are inside once
  windings_ *= share_;
  begin(places, [&] { return normals; });
}

bool SelfContact::is_far(Index i, Index j, double distance) const {
  if (!meshes_.empty() && meshes_[static_cast<std::size_t>(i)] != meshes_[static_cast<std::size_t>(j)])
    return true;
  return (inside_.row(i) - inside_.row(j)).squaredNorm() > distance * distance;
}

/// Whether what is beyond a sample came through it: it faced the same part before, or was before it.
bool SelfContact::came_through(Index i, Index j, const Vec3& normal) const {
  const Index before = ways_.faced[static_cast<std::size_t>(i)];
  return (before >= 0 && !is_far(before, j, far_inside)) ||
         (ways_.seen.row(i) - ways_.seen.row(j)).dot(normal.transpose()) >= 0.0;
}

/// For each cell the cells near it that hold a sample which may be far from one of its own inside the shape.
std::vector<std::vector<Index>> SelfContact::near_parts(const PointGrid& grid) const {
  using Box = Eigen::Array<double, 7, 1>;
  std::vector<Box> low(static_cast<std::size_t>(grid.size())), high;
  for (Index c = 0; c < grid.size(); ++c) {
    Box least = Box::Constant(std::numeric_limits<double>::infinity()), most = -least;
    for (const Index i : grid.rows(c)) {
      Box at;
      at << inside_.row(i).transpose(), meshes_.empty() ? 0.0 : meshes_[static_cast<std::size_t>(i)];
      least = least.min(at);
      most = most.max(at);
    }
    low[static_cast<std::size_t>(c)] = least;
    high.push_back(most);
  }
  std::vector<std::vector<Index>> result(low.size());
  for (std::size_t c = 0; c < low.size(); ++c)
    grid.near(static_cast<Index>(c), [&](Index other) {
      const auto o = static_cast<std::size_t>(other);
      const Box size = high[c].max(high[o]) - low[c].min(low[o]);
      if (size.head(6).matrix().squaredNorm() > far_inside * far_inside || size[6] > 0.0)
        result[c].push_back(other);
    });
  return result;
}

std::vector<FacingPair> SelfContact::search(PointsIn places, const Normals& normals_at, double near,
                                            Beyond beyond) const {
  const Index n = places.rows();
  const PointGrid grid(places, near);
  const std::vector<std::vector<Index>> parts = near_parts(grid);
  if (std::all_of(parts.begin(), parts.end(), [](const auto& p) { return p.empty(); })) return {};
  const Points normals = normals_at().rowwise().normalized();
  std::vector<Index> second(static_cast<std::size_t>(n), -1);
  const auto visit = [&](Index i, const std::vector<Index>& cells) {
    if (least_[i] <= 0.0) return;
    const Vec3 place = places.row(i).transpose(), normal = normals.row(i).transpose();
    double nearest = near * near;
    for (const Index cell : cells)
      for (const Index j : grid.rows(cell)) {
        const Vec3 arm = place - places.row(j).transpose();
        const double square = arm.squaredNorm();
        if (square >= nearest) continue;
        const Vec3 other = normals.row(j).transpose();
        if (normal.dot(other) > facing || least_[j] <= 0.0 || !is_far(i, j, far_inside)) continue;
        const double gap = arm.dot(other);
        if (square - gap * gap > aside_ * aside_ || -gap > std::min(widths_[i], widths_[j])) continue;
        const double least = beyond == Beyond::shallow ? -shallow : 0.0;
        if (gap < least && beyond != Beyond::all && !(beyond == Beyond::as_came && came_through(i, j, other)))
          continue;
        nearest = square;
        second[static_cast<std::size_t>(i)] = j;
      }
  };
  parallel_for(0, grid.size(), 16, [&](Index first_cell, Index last_cell) {
    for (Index c = first_cell; c < last_cell; ++c)
      if (!parts[static_cast<std::size_t>(c)].empty())
        for (const Index i : grid.rows(c)) visit(i, parts[static_cast<std::size_t>(c)]);
  });
  std::vector<FacingPair> pairs;
  for (Index i = 0; i < n; ++i) {
    const Index j = second[static_cast<std::size_t>(i)];
    if (j < 0) continue;
    const Vec3 normal = normals.row(j).transpose();
    pairs.push_back({i, j, normal, normal.dot((places.row(i) - places.row(j)).transpose()),
                     std::min(least_[i], least_[j])});
  }
  return pairs;
}

/// Winding numbers a little below the probes, by the samples as dipoles (Barill et al. 2018, Fast winding
/// numbers for soups and clouds).
Vector SelfContact::windings(PointsIn places, PointsIn normals) const {
  Vector result(std::ssize(probes_));
  parallel_for(0, result.size(), 16, [&](Index first, Index last) {
    for (Index k = first; k < last; ++k) {
      const Index row = probes_[static_cast<std::size_t>(k)];
      const double depth = std::min(aside_, 0.5 * widths_[row]);
      const Eigen::RowVector3d at = places.row(row) - depth * normals.row(row).normalized();
      double sum = 0.0;
      for (Index i = 0; i < places.rows(); ++i) {
        const Eigen::RowVector3d arm = places.row(i) - at;
        const double square = arm.squaredNorm() + 0.25 * aside_ * aside_;
        sum += arm.dot(normals.row(i)) / (square * std::sqrt(square));
      }
      result[k] = share_ * sum;
    }
  });
  return result;
}

bool SelfContact::overlaps(PointsIn places, PointsIn normals) const {
  return (windings(places, normals) - windings_).array().maxCoeff() > inside_another;
}

void SelfContact::remember(PointsIn places, const std::vector<FacingPair>& pairs) {
  ways_.seen = places;
  ways_.faced.assign(static_cast<std::size_t>(places.rows()), -1);
  for (const FacingPair& pair : pairs) ways_.faced[static_cast<std::size_t>(pair.first)] = pair.second;
}

void SelfContact::begin(PointsIn places, const Normals& normals) {
  remember(places, search(places, normals, near_at_rest, Beyond::shallow));
}

std::vector<FacingPair> SelfContact::find(PointsIn places, const Normals& normals, double near, bool jumped) {
  std::vector<FacingPair> pairs = search(places, normals, near, jumped ? Beyond::all : Beyond::as_came);
  remember(places, pairs);
  return pairs;
}

}  // namespace arapfields
