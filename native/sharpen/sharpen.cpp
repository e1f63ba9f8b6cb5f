// SPDX-License-Identifier: GPL-3.0-or-later
#include "sharpen/sharpen.h"

#include <algorithm>
#include <cmath>

#include "core/errors.h"
#include "core/memory.h"
#include "core/parallel.h"
#include "core/unit_rows.h"
#include "energies/gauss.h"
#include "mesh/outward_triangles.h"
#include "sharpen/folded_triangles.h"
#include "sharpen/surface_laplacian.h"

namespace arapfields {
namespace {

/// Cosines of the angles to a preferred normal beyond which it does not pull, and within which it pulls
/// fully.
constexpr double no_pull = 0.5, full_pull = 0.7;
/// Residual of a global step's system, relative to that at its start.
constexpr double solve_tolerance = 0.05;
/// Rounds in which folded triangles are opened; times that the whole is then taken back by half, before it is
/// taken back wholly.
constexpr int most_openings = 40, most_halvings = 4;
/// Bytes that a vertex takes with its two triangles, at most.
constexpr double bytes_per_vertex = 2000.0;
constexpr Index sharpen_grain = 4096;

/// The style at a surface's triangles.
struct StyleAtTriangles {
  Points preferred;  // (k,3), or
  Points targets;    // (m',3) of an object
  Vector factors;    // (m') of the weight

  StyleAtTriangles(const Style& style, const WeldedSurface& surface, const SharpenOptions& options) {
    const StyleAtSamples at =
        StyleAtSamples::of(style, unit_rows(surface.normals(surface.rest())), options.sharpness);
    factors = at.weights;
    targets = at.targets;
    if (!at.preference) return;
    preferred = at.preference->normals;
    factors *= at.preference->balance;
    if (options.sharpness > 0.0) {
      const double softened = std::min(1.0, options.sharpness / style_sharpness(preferred));
      factors *= softened * softened;
    }
  }

  /// The direction that pulls at a triangle of this unit normal.
  Vec3 direction(Index triangle, const Vec3& normal) const {
    if (targets.rows() > 0) return targets.row(triangle);
    Index nearest = 0;
    (preferred * normal).maxCoeff(&nearest);
    return preferred.row(nearest);
  }
};

/// One mesh's state: positions, and what its steps need.
class Finish {
 public:
  Finish(const WeldedSurface& surface, Points start, const StyleAtTriangles& style, const Vector& factors,
         const std::vector<char>& held, const Progress& progress)
      : surface_(surface),
        style_(style),
        factors_(factors),
        held_(held),
        start_(std::move(start)),
        positions_(start_),
        rotations_(surface.rotations(start_)),
        laplacian_(surface, (factors.array() + 2.0).matrix(), held, progress) {}

  void step() {
    laplacian_.solve(right_hand_side(), start_, solve_tolerance, positions_);
    rotations_ = surface_.rotations(positions_);
  }

  /// Opens triangles that are folded but were not at the start, one vertex of each at a time; where that does
  /// not help, takes the whole back as far as it must.
  void spare_folds() {
    const std::vector<char> before = folded(start_);
    double share = 1.0;
    for (int round = 0;; ++round) {
      const std::vector<char> now = folded(positions_);
      const std::vector<double> turns = surface_.rotations(positions_);
      bool found = false;
      for (Index t = 0; t < surface_.triangles(); ++t) {
        if (!now[t] || before[t]) continue;
        found = true;
        if (round < most_openings) open(t, turns);
      }
      if (!found) return;
      if (round < most_openings) continue;
      const double smaller = round < most_openings + most_halvings ? 0.5 * share : 0.0;
      positions_ = start_ + smaller / share * (positions_ - start_);
      share = smaller;
    }
  }

  const Points& positions() const { return positions_; }

 private:
  /// Gives a triangle the height over its longest edge that it has at the start: of a thin triangle the
  /// vertex there hardly moves.
  void open(Index t, const std::vector<double>& turns) {
    int apex = 0;
    double longest = -1.0;
    const auto corner = [&](int k) { return surface_.corners()(t, k % 3); };
    for (int k = 0; k < 3; ++k) {
      const double length = (start_.row(corner(k + 1)) - start_.row(corner(k + 2))).squaredNorm();
      if (length > longest && !held_[corner(k)]) {
        longest = length;
        apex = k;
      }
    }
    if (!(longest > 0.0)) return;
    const auto from = corner(apex + 1), to = corner(apex + 2);
    const Vec3 base = start_.row(to) - start_.row(from), side = start_.row(corner(apex)) - start_.row(from);
    const double along = side.dot(base) / longest;
    const Vec3 height = side - along * base, edge = positions_.row(to) - positions_.row(from);
    // The height lies across the edge in the plane that the triangle should have.
    Mat3 turn = Mat3::Zero();
    for (int k = 0; k < 3; ++k) turn += rotation_at(turns, corner(k));
    const Vec3 rest[3] = {surface_.rest().row(from), surface_.rest().row(to),
                          surface_.rest().row(corner(apex))};
    const Vec3 normal = turn * (rest[1] - rest[0]).cross(rest[2] - rest[0]);
    const Vec3 across = normal.cross(edge);
    if (!(across.norm() > 0.0)) return;
    positions_.row(corner(apex)) =
        positions_.row(from) + (along * edge + height.norm() / across.norm() * across).transpose();
  }

  /// Of the global step: Σ of each node's edges of w ((R_i + R_j) e + λ p), p an edge without its part along
  /// the direction that pulls.
  Points right_hand_side() const {
    RowMatrix<double> edges(surface_.triangles(), 9);  // of each triangle, the edge opposite each corner
    const Points normals = unit_rows(surface_.normals(positions_));
    parallel_for(0, surface_.triangles(), sharpen_grain, [&](Index begin, Index end) {
      for (Index t = begin; t < end; ++t) {
        const Vec3 normal = normals.row(t), pulling = style_.direction(t, normal);
        const double pull = std::clamp((normal.dot(pulling) - no_pull) / (full_pull - no_pull), 0.0, 1.0);
        Mat3 turns[3];
        for (int k = 0; k < 3; ++k) turns[k] = rotation_at(rotations_, surface_.corners()(t, k));
        for (int k = 0; k < 3; ++k) {
          const int from = (k + 1) % 3, to = (k + 2) % 3;
          const Index i = surface_.corners()(t, from), j = surface_.corners()(t, to);
          const Vec3 rest = surface_.rest().row(j) - surface_.rest().row(i);
          Vec3 edge = positions_.row(j) - positions_.row(i);
          edge -= pull * edge.dot(pulling) * pulling;
          edges.row(t).segment<3>(3 * k) =
              surface_.weights()(t, k) * ((turns[from] + turns[to]) * rest + factors_[t] * edge).transpose();
        }
      }
    });
    Points result(surface_.nodes(), 3);
    parallel_for(0, surface_.nodes(), sharpen_grain, [&](Index begin, Index end) {
      for (Index i = begin; i < end; ++i) {
        Eigen::RowVector3d sum = Eigen::RowVector3d::Zero();
        surface_.around(i, [&](Index t, int k) {
          sum += edges.row(t).segment<3>(3 * ((k + 1) % 3)) - edges.row(t).segment<3>(3 * ((k + 2) % 3));
        });
        result.row(i) = sum;
      }
    });
    return result;
  }

  std::vector<char> folded(const Points& positions) const {
    const Points expected = turned_normals(surface_, surface_.rotations(positions));
    const Points normals = surface_.normals(positions);
    std::vector<char> result(surface_.triangles());
    for (Index t = 0; t < surface_.triangles(); ++t) result[t] = expected.row(t).dot(normals.row(t)) < 0.0;
    return result;
  }

  const WeldedSurface& surface_;
  const StyleAtTriangles& style_;
  const Vector& factors_;
  const std::vector<char>& held_;
  const Points start_;
  Points positions_;
  std::vector<double> rotations_;
  SurfaceLaplacian laplacian_;
};

}  // namespace

Points sharpen(PointsIn vertices, TrianglesIn triangles, PointsIn moved, const Style& style,
               const SharpenOptions& options, const Progress& progress, const Vector& weights,
               const std::optional<Vec3>& up) {
  options.validate();
  validate(vertices, triangles);
  require_moved(vertices, moved);
  require(weights.size() == 0 || weights.size() == vertices.rows(), "weights",
          std::to_string(weights.size()) + " numbers",
          "one for each of the " + std::to_string(vertices.rows()) + " vertices is needed");
  require(weights.size() == 0 || (weights.allFinite() && weights.minCoeff() >= 0.0), "weights",
          "some are negative or not finite", "all must be 0 or larger");
  require(!up || (up->allFinite() && up->norm() > 0.0), "up", "zero or not finite", "a direction is needed");
  require_memory("vertices", bytes_per_vertex * static_cast<double>(vertices.rows()));
  const ThreadScope threads(options.threads);
  const CancelScope cancel(progress);

  progress.report(0.0, "sharpening");
  const WeldedSurface surface(facing_outwards({vertices, triangles}), moved);
  const StyleAtTriangles at(style, surface, options);
  const double weight = options.style_weight * options.strength / options.rigidity;
  Vector factors = weight * at.factors;
  std::vector<char> held(surface.nodes(), 0);
  if (weights.size() > 0) {
    Vector of_nodes = Vector::Constant(surface.nodes(), INFINITY);
    for (Index v = 0; v < vertices.rows(); ++v)
      if (const std::int32_t node = surface.node_of()[v]; node >= 0)
        of_nodes[node] = std::min(of_nodes[node], weights[v]);
    for (Index i = 0; i < surface.nodes(); ++i) held[i] = of_nodes[i] == 0.0;
    for (Index t = 0; t < surface.triangles(); ++t)
      factors[t] *= (of_nodes[surface.corners()(t, 0)] + of_nodes[surface.corners()(t, 1)] +
                     of_nodes[surface.corners()(t, 2)]) /
                    3.0;
  }
  Points result = moved;
  if (surface.triangles() == 0 || options.iterations == 0 || !(factors.maxCoeff() > 0.0)) return result;

  Finish finish(surface, surface.at_nodes(moved), at, factors, held, progress);
  for (Index step = 0; step < options.iterations; ++step) {
    progress.report(0.1 + 0.85 * static_cast<double>(step) / static_cast<double>(options.iterations),
                    "sharpening");
    finish.step();
  }
  progress.report(0.95, "sharpening");
  finish.spare_folds();
  for (Index v = 0; v < vertices.rows(); ++v)
    if (const std::int32_t node = surface.node_of()[v]; node >= 0) {
      if (!held[node]) result.row(v) = finish.positions().row(node);
    }
  if (up && std::find(held.begin(), held.end(), 1) == held.end()) {
    const Vec3 direction = up->normalized();
    const double sunk = (moved * direction).minCoeff() - (result * direction).minCoeff();
    result.rowwise() += sunk * direction.transpose();
  }
  progress.report(1.0, "sharpening");
  return result;
}

}  // namespace arapfields
