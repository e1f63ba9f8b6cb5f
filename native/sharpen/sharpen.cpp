// SPDX-License-Identifier: GPL-3.0-or-later
#include "sharpen/sharpen.h"

#include <algorithm>
#include <cmath>
#include <unordered_set>

#include "core/errors.h"
#include "core/memory.h"
#include "core/parallel.h"
#include "core/unit_rows.h"
#include "energies/gauss.h"
#include "energies/rotation.h"
#include "mesh/outward_triangles.h"
#include "sharpen/folded_triangles.h"
#include "sharpen/surface_laplacian.h"

namespace arapfields {
namespace {

/// Cosines of the angles to a preferred normal beyond which it does not pull, and within which it pulls
/// fully.
constexpr double no_pull = 0.5, full_pull = 0.7;
/// By how much the cosine to a preferred normal must exceed that to the next one for the whole pull, relative
/// to that at the preferred normal itself: triangles between two become the edge of neither. Normals within
/// 15° of each other belong to one curved face.
constexpr double clear_lead = 0.15, one_face = 0.9659258262890683;
/// Share of the diagonal within which normals are averaged; cosines of a triangle's own to the average below
/// which it is part of a detail, and from which on it is not; and the share of the style's weight for
/// details.
constexpr double detail_reach = 0.02, on_detail = 0.85, off_detail = 0.96, detail_weight = 0.1;
/// Residual of a global step's system, relative to that at its start.
constexpr double solve_tolerance = 0.05;
/// Rounds in which folded triangles are opened, and in which what lies around them gets its shape back, a
/// ring more after some rounds, in sweeps; and the share of the whole that is taken back by half at last.
constexpr int most_openings = 8, most_relaxations = 40, rounds_a_ring = 4, relaxing_sweeps = 8;
constexpr double least_share = 0.1;
/// Bytes that a vertex takes with its two triangles, at most.
constexpr double bytes_per_vertex = 2000.0;
constexpr Index sharpen_grain = 4096;

/// The style at a surface's triangles.
struct StyleAtTriangles {
  Points preferred;   // (k,3), or
  Points targets;     // (m',3) of an object
  Vector factors;     // (m') of the weight
  double share;       // of the weight at this strength
  double lead = 1.0;  // of the nearest preferred normal's cosine, from which on it pulls wholly

  StyleAtTriangles(const Style& style, const WeldedSurface& surface, const SharpenOptions& options) {
    const StyleAtSamples at =
        StyleAtSamples::of(style, unit_rows(surface.normals(surface.rest())), options.sharpness);
    factors = at.weights;
    share = at.share(options.strength);
    targets = at.targets;
    if (!at.preference) return;
    preferred = at.preference->normals;
    double cosine = -1.0;  // of neighbouring faces of the style
    for (Index i = 0; i < preferred.rows(); ++i)
      for (Index j = 0; j < i; ++j)
        if (const double other = preferred.row(i).dot(preferred.row(j)); other < one_face)
          cosine = std::max(cosine, other);
    lead = clear_lead * (1.0 - cosine);
    factors *= at.preference->balance;
    if (options.sharpness > 0.0) {
      const double softened = std::min(1.0, options.sharpness / style_sharpness(preferred));
      factors *= softened * softened;
    }
  }

  /// The direction that pulls at a triangle of this unit normal, and how much, from 0 to 1.
  std::pair<Vec3, double> direction(Index triangle, const Vec3& normal) const {
    const auto pull = [](double cosine) {
      return std::clamp((cosine - no_pull) / (full_pull - no_pull), 0.0, 1.0);
    };
    if (targets.rows() > 0) return {targets.row(triangle), pull(targets.row(triangle).dot(normal))};
    Index nearest = 0;
    const double best = (preferred * normal).maxCoeff(&nearest);
    double second = -1.0;
    for (Index k = 0; k < preferred.rows(); ++k)
      if (preferred.row(k).dot(preferred.row(nearest)) < one_face)
        second = std::max(second, preferred.row(k).dot(normal));
    return {preferred.row(nearest), pull(best) * std::min(1.0, (best - second) / lead)};
  }
};

/// (m') shares of a style's weight, less where the surface at rest has details that the style's faces would
/// flatten: where triangles face elsewhere than the surface around them does on average.
Vector relief_shares(const WeldedSurface& surface, const Progress& progress) {
  const Points normals = surface.normals(surface.rest());
  Vector areas = Vector::Zero(surface.nodes());
  Points at_nodes(surface.nodes(), 3);
  parallel_for(0, surface.nodes(), sharpen_grain, [&](Index begin, Index end) {
    for (Index i = begin; i < end; ++i) {
      Eigen::RowVector3d sum = Eigen::RowVector3d::Zero();
      surface.around(i, [&](Index t, int) {
        sum += normals.row(t);
        areas[i] += normals.row(t).norm() / 6.0;
      });
      at_nodes.row(i) = sum;
    }
  });
  at_nodes = unit_rows(at_nodes);
  const double reach = detail_reach * diagonal_of(surface.rest());
  const Vector bound = areas / (reach * reach);
  const std::vector<char> none(surface.nodes(), 0);
  const SurfaceLaplacian laplacian(surface, Vector::Ones(surface.triangles()), none, progress, bound);
  Points smoothed = at_nodes;
  laplacian.solve(Points::Zero(surface.nodes(), 3), at_nodes, solve_tolerance, smoothed);
  Vector result(surface.triangles());
  for (Index t = 0; t < surface.triangles(); ++t) {
    Eigen::RowVector3d mean = Eigen::RowVector3d::Zero();
    for (int k = 0; k < 3; ++k) mean += smoothed.row(surface.corners()(t, k)) / 3.0;
    const double cosine = mean.normalized().dot(normals.row(t).normalized());
    const double share = std::clamp((cosine - on_detail) / (off_detail - on_detail), 0.0, 1.0);
    result[t] = detail_weight + (1.0 - detail_weight) * share * share * (3.0 - 2.0 * share);
  }
  return result;
}

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
  /// not help, gives what lies around them its shape at the start, in more and more rings; at last takes the
  /// whole back.
  void spare_folds() {
    const std::vector<char> before = folded(start_, surface_.rotations(start_));
    double share = 1.0;
    for (int round = 0;; ++round) {
      const std::vector<double> turns = surface_.rotations(positions_);
      std::vector<char> now = folded(positions_, turns);
      Index found = 0;
      for (Index t = 0; t < surface_.triangles(); ++t) {
        now[t] = now[t] && !before[t];
        found += now[t];
      }
      if (found == 0) return;
      if (round < most_openings) {
        for (Index t = 0; t < surface_.triangles(); ++t)
          if (now[t]) open(t, turns);
      } else if (round < most_openings + most_relaxations) {
        for (Index t = 0; t < surface_.triangles(); ++t)
          if (now[t]) relax(nodes_around(t, 1 + (round - most_openings) / rounds_a_ring));
      } else {
        const double smaller = share > least_share ? 0.5 * share : 0.0;
        positions_ = start_ + smaller / share * (positions_ - start_);
        share = smaller;
      }
    }
  }

  const Points& positions() const { return positions_; }

 private:
  /// Nodes within that many rings of a triangle.
  std::vector<std::int32_t> nodes_around(Index triangle, int rings) const {
    std::vector<std::int32_t> result;
    std::unordered_set<std::int32_t> reached;
    const auto reach = [&](Index t) {
      for (int k = 0; k < 3; ++k)
        if (const std::int32_t node = surface_.corners()(t, k); reached.insert(node).second)
          result.push_back(node);
    };
    reach(triangle);
    for (std::size_t from = 0, ring = 1; ring < static_cast<std::size_t>(rings); ++ring)
      for (const std::size_t end = result.size(); from < end; ++from)
        surface_.around(result[from], [&](Index t, int) { reach(t); });
    return result;
  }

  /// Gives nodes, turned as one, the shape that they have at the start, as far as what is around them lets.
  void relax(const std::vector<std::int32_t>& nodes) {
    const auto edges = [&](std::int32_t node, auto&& visit) {
      surface_.around(node, [&](Index t, int k) {
        for (int other = 1; other < 3; ++other) {
          const int l = (k + other) % 3;
          visit(surface_.corners()(t, l), surface_.weights()(t, 3 - k - l));
        }
      });
    };
    Mat3 spread = Mat3::Zero();
    for (const std::int32_t node : nodes)
      edges(node, [&](Index j, double weight) {
        spread += weight * (positions_.row(j) - positions_.row(node)).transpose() *
                  (start_.row(j) - start_.row(node));
      });
    const Mat3 turn = closest_rotation(spread);
    for (int sweep = 0; sweep < relaxing_sweeps; ++sweep)
      for (const std::int32_t node : nodes) {
        if (held_[node]) continue;
        Vec3 sum = Vec3::Zero();
        double weights = 0.0;
        edges(node, [&](Index j, double weight) {
          const Vec3 edge = start_.row(node) - start_.row(j), place = positions_.row(j);
          sum += weight * (place + turn * edge);
          weights += weight;
        });
        positions_.row(node) = sum / weights;
      }
  }

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
        const auto [pulling, pull] = style_.direction(t, normals.row(t));
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

  std::vector<char> folded(const Points& positions, const std::vector<double>& turns) const {
    const Points expected = turned_normals(surface_, turns);
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
  const double weight = options.style_weight * at.share / options.rigidity;
  Vector factors = weight * at.factors;
  if (weight > 0.0 && surface.triangles() > 0)
    factors = factors.cwiseProduct(relief_shares(surface, progress));
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
