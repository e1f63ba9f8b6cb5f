// SPDX-License-Identifier: GPL-3.0-or-later
#include "sharpen/sharpen.h"

#include <algorithm>
#include <cmath>

#include "core/errors.h"
#include "core/memory.h"
#include "core/parallel.h"
#include "core/smoothstep.h"
#include "core/types.h"
#include "energies/gauss.h"
#include "mesh/outward_triangles.h"
#include "sharpen/contact_limits.h"
#include "sharpen/fold_repair.h"
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
/// Rings of triangles whose mean normal chooses between preferred ones, but for details: by their own normals
/// alone triangles where two faces of the style meet fall to either side, and edges become serrated.
constexpr int rings_around = 2;
/// Share of the diagonal within which normals are averaged; cosines of a triangle's own to the average below
/// which it is part of a detail, and from which on it is not; and the share of the style's weight for
/// details.
constexpr double detail_reach = 0.02, on_detail = 0.85, off_detail = 0.96, detail_weight = 0.1;
/// Share of the last step by which the next one starts ahead: twelve steps then do as well as sixteen at 0.6.
constexpr double momentum = 0.8;
/// Share of the diagonal around folds that cannot be opened, where the surface goes back at first.
constexpr double first_reach = 0.05;
/// Residual of a global step's system, relative to that at its start: a tenth of this does no better.
constexpr double solve_tolerance = 0.2;
/// Bytes that a vertex takes with its two triangles, at most.
constexpr double bytes_per_vertex = 2000.0;
constexpr Index sharpen_grain = 4096;

/// The style at a surface's triangles.
struct StyleAtTriangles {
  Points preferred;         // (k,3), or
  Points targets;           // (m',3) of an object
  Vector factors;           // (m') of the weight
  double share;             // of the weight at this strength
  double lead = 1.0;        // of the nearest preferred normal's cosine, from which on it pulls wholly
  Eigen::MatrixXd cosines;  // (k,k) between the preferred normals

  StyleAtTriangles(const Style& style, const WeldedSurface& surface, const SharpenOptions& options) {
    Points normals;
    surface.normals(surface.rest(), normals);
    const StyleAtSamples at = StyleAtSamples::of(style, unit_rows(normals), options.sharpness);
    factors = at.weights;
    share = at.share(options.strength);
    targets = at.targets;
    if (!at.preference) return;
    preferred = at.preference->normals;
    cosines = preferred * preferred.transpose();
    double cosine = -1.0;  // of neighbouring faces of the style
    for (Index i = 0; i < cosines.size(); ++i)
      if (const double other = cosines.data()[i]; other < one_face) cosine = std::max(cosine, other);
    lead = clear_lead * (1.0 - cosine);
    factors *= at.preference->balance;
    if (options.sharpness > 0.0) {
      const double softened = std::min(1.0, options.sharpness / style_sharpness(preferred));
      factors *= softened * softened;
    }
  }

  /// The direction that pulls at a triangle of this unit normal, and how much, from 0 to 1; `around`: the
  /// normal of the surface around it, which chooses between preferred ones.
  std::pair<Vec3, double> direction(Index triangle, const Vec3& normal, const Vec3& around) const {
    const auto pull = [](double cosine) {
      return std::clamp((cosine - no_pull) / (full_pull - no_pull), 0.0, 1.0);
    };
    if (targets.rows() > 0) return {targets.row(triangle), pull(targets.row(triangle).dot(normal))};
    Index nearest = 0;
    double best = -INFINITY, second = -1.0;
    for (Index k = 0; k < preferred.rows(); ++k)
      if (const double cosine = preferred.row(k).dot(around); cosine > best) {
        best = cosine;
        nearest = k;
      }
    for (Index k = 0; k < preferred.rows(); ++k)
      if (cosines(k, nearest) < one_face) second = std::max(second, preferred.row(k).dot(around));
    const double own = preferred.row(nearest).dot(normal);
    return {preferred.row(nearest), pull(own) * std::min(1.0, (best - second) / lead)};
  }
};

/// (k,3) unit normals at the nodes: Σ of those of the triangles around, (m',3) by area.
void normals_at_nodes(const WeldedSurface& surface, const Points& normals, Points& result) {
  result.resize(surface.nodes(), 3);
  parallel_for(0, surface.nodes(), sharpen_grain, [&](Index begin, Index end) {
    for (Index i = begin; i < end; ++i) {
      Eigen::RowVector3d sum = Eigen::RowVector3d::Zero();
      surface.around(i, [&](Index t, int) { sum += normals.row(t); });
      result.row(i) = sum.normalized();
    }
  });
}

/// (m',3) unit normals of the surface around each triangle, some rings far, from those by area; `at_nodes`:
/// room for those at the nodes.
void normals_around(const WeldedSurface& surface, const Points& normals, Points& at_nodes, Points& result) {
  result.resize(surface.triangles(), 3);
  for (int ring = 0; ring < rings_around; ++ring) {
    normals_at_nodes(surface, ring == 0 ? normals : result, at_nodes);
    parallel_for(0, surface.triangles(), sharpen_grain, [&](Index begin, Index end) {
      for (Index t = begin; t < end; ++t) {
        Eigen::RowVector3d sum = Eigen::RowVector3d::Zero();
        for (int k = 0; k < 3; ++k) sum += at_nodes.row(surface.corners()(t, k));
        result.row(t) = (ring + 1 < rings_around ? normals.row(t).norm() : 1.0) * sum.normalized();
      }
    });
  }
}

/// (m') 1 where triangles at rest face as the surface around them does on average, down to 0 for those of
/// details that the style's faces would flatten.
Vector plainness(const WeldedSurface& surface, const Progress& progress) {
  Points normals, at_nodes;
  surface.normals(surface.rest(), normals);
  normals_at_nodes(surface, normals, at_nodes);
  Vector areas = Vector::Zero(surface.nodes());
  parallel_for(0, surface.nodes(), sharpen_grain, [&](Index begin, Index end) {
    for (Index i = begin; i < end; ++i)
      surface.around(i, [&](Index t, int) { areas[i] += normals.row(t).norm() / 6.0; });
  });
  const double reach = detail_reach * diagonal_of(surface.rest());
  const Vector bound = areas / (reach * reach);
  const std::vector<char> none(surface.nodes(), 0);
  SurfaceLaplacian laplacian(surface, Vector::Ones(surface.triangles()), none, progress, bound);
  Points residual(surface.nodes(), 3), smoothed = at_nodes;
  parallel_for(0, surface.nodes(), sharpen_grain, [&](Index begin, Index end) {
    for (Index i = begin; i < end; ++i) {
      Vec3 sum = Vec3::Zero();
      surface.edges(
          i, [&](Index j, const auto& edge) { sum += edge.weight * (at_nodes.row(j) - at_nodes.row(i)); });
      residual.row(i) = sum;
    }
  });
  laplacian.solve(residual, at_nodes, solve_tolerance, smoothed);
  Vector result(surface.triangles());
  parallel_for(0, surface.triangles(), sharpen_grain, [&](Index begin, Index end) {
    for (Index t = begin; t < end; ++t) {
      Eigen::RowVector3d mean = Eigen::RowVector3d::Zero();
      for (int k = 0; k < 3; ++k) mean += smoothed.row(surface.corners()(t, k)) / 3.0;
      const double cosine = mean.normalized().dot(normals.row(t).normalized());
      result[t] = smoothstep(on_detail, off_detail, cosine);
    }
  });
  return result;
}

/// One mesh's state: positions, and what its steps need.
class Finish {
 public:
  Finish(const WeldedSurface& surface, Points start, const StyleAtTriangles& style, const Vector& factors,
         const Vector& plain, const std::vector<char>& held, const Contact& contact, const Progress& progress)
      : surface_(surface),
        style_(style),
        factors_(factors),
        plain_(plain),
        held_(held),
        start_(std::move(start)),
        positions_(start_),
        limits_(contact, start_, progress),
        laplacian_(surface, (factors.array() + 2.0).matrix(), held, progress),
        progress_(progress) {
    surface_.rotations(start_, rotations_);
  }

  void step() {
    if (before_.rows() > 0) {
      before_ = positions_ + momentum * (positions_ - before_);
      std::swap(before_, positions_);
      surface_.rotations(positions_, rotations_);
    } else {
      before_ = positions_;
    }
    set_residual();
    laplacian_.solve(residual_, start_, solve_tolerance, positions_);
    if (!limits_.any()) return;
    // What has come to an obstacle stays there, and the rest gives way.
    const Points solution = positions_;
    std::vector<char> kept = limits_.keep(positions_);
    if (std::find(kept.begin(), kept.end(), 1) == kept.end()) return;
    for (std::size_t i = 0; i < kept.size(); ++i) kept[i] = kept[i] || held_[i];
    laplacian_.solve_further(solution, kept, solve_tolerance, positions_);
    limits_.keep(positions_);
  }

  /// Takes start and result this share of the way from rest.
  void go_part_way(double share) {
    start_ = surface_.rest() + share * (start_ - surface_.rest());
    positions_ = surface_.rest() + share * (positions_ - surface_.rest());
  }

  /// Moves the whole along a unit vector so that its lowest node keeps its height.
  void stand(const Vec3& up) {
    const double sunk = (start_ * up).minCoeff() - (positions_ * up).minCoeff();
    positions_.rowwise() += sunk * up.transpose();
    limits_.keep(positions_);
  }

  /// Opens triangles that are folded. Around those that cannot be opened and are not folded at the start, the
  /// surface goes back there, within twice the distance each time.
  void spare_folds() {
    FoldRepair repair(surface_, start_, held_, limits_, progress_);
    const Points finished = positions_;
    std::vector<Eigen::RowVector3d> places;
    const double size = diagonal_of(surface_.rest());
    for (double reach = first_reach * size; !repair.open_folds(positions_); reach *= 2.0) {
      if (reach > size) {
        positions_ = start_;
        return;
      }
      for (const std::int32_t t : repair.folded())
        places.emplace_back(surface_.rest().row(surface_.corners()(t, 0)));
      parallel_for(0, surface_.nodes(), sharpen_grain, [&](Index begin, Index end) {
        for (Index i = begin; i < end; ++i) {
          double nearest = INFINITY;
          for (const auto& place : places)
            nearest = std::min(nearest, (surface_.rest().row(i) - place).norm());
          const double share = smoothstep(0.5 * reach, reach, nearest);
          positions_.row(i) = start_.row(i) + share * (finished.row(i) - start_.row(i));
        }
      });
      if (limits_.any()) limits_.keep(positions_);
    }
  }

  const Points& positions() const { return positions_; }

 private:
  /// Of the global step at these positions: Σ of each node's edges of w ((R_i + R_j) e − 2 d), d the edge
  /// now, and of its triangles' of −λ w (d·p) p, p the direction that pulls.
  void set_residual() {
    surface_.normals(positions_, normals_);
    normals_around(surface_, normals_, at_nodes_, around_);
    pulls_.resize(surface_.triangles(), 3);  // the directions, by the root of how much they pull
    along_.resize(surface_.triangles(), 3);  // and how far, at each corner
    parallel_for(0, surface_.triangles(), sharpen_grain, [&](Index begin, Index end) {
      for (Index t = begin; t < end; ++t) {
        const Vec3 own = normals_.row(t).normalized(), mean = around_.row(t);
        const auto [pulling, pull] = style_.direction(t, own, (own + plain_[t] * (mean - own)).normalized());
        const Vec3 along = std::sqrt(pull) * pulling;
        Vec3 heights;
        for (int k = 0; k < 3; ++k) heights[k] = positions_.row(surface_.corners()(t, k)) * along;
        const Vec3 weights = factors_[t] * surface_.weights().row(t);
        pulls_.row(t) = along;
        for (int k = 0; k < 3; ++k) {
          const int next = (k + 1) % 3, last = (k + 2) % 3;
          along_(t, k) =
              weights[last] * (heights[k] - heights[next]) + weights[next] * (heights[k] - heights[last]);
        }
      }
    });
    residual_.resize(surface_.nodes(), 3);
    parallel_for(0, surface_.nodes(), sharpen_grain, [&](Index begin, Index end) {
      for (Index i = begin; i < end; ++i) {
        const Vec3 own = positions_.row(i);
        Vec3 sum = Vec3::Zero(), rest = Vec3::Zero();
        surface_.edges(i, [&](Index j, const auto& edge) {
          sum += rotations_[j] * edge.rest + 2.0 * edge.weight * (positions_.row(j).transpose() - own);
          rest += edge.rest;
        });
        sum += rotations_[i] * rest;
        surface_.around(i, [&](Index t, int k) { sum -= along_(t, k) * pulls_.row(t); });
        residual_.row(i) = sum;
      }
    });
  }

  const WeldedSurface& surface_;
  const StyleAtTriangles& style_;
  const Vector &factors_, &plain_;
  const std::vector<char>& held_;
  Points start_;
  Points positions_, before_;
  std::vector<Mat3> rotations_;
  ContactLimits limits_;
  SurfaceLaplacian laplacian_;
  Points normals_, at_nodes_, around_, pulls_, along_, residual_;  // of the global step
  const Progress& progress_;
};

}  // namespace

Points sharpen(PointsIn vertices, TrianglesIn triangles, PointsIn moved, const Style& style,
               const SharpenOptions& options, const Progress& progress, const Vector& weights,
               const std::optional<Vec3>& up, const Contact& contact, bool alone) {
  options.validate();
  validate(vertices, triangles);
  require_moved(vertices, moved);
  require(weights.size() == 0 || weights.size() == vertices.rows(), "weights",
          std::to_string(weights.size()) + " numbers",
          "one for each of the " + std::to_string(vertices.rows()) + " vertices is needed");
  require(weights.size() == 0 || (weights.allFinite() && weights.minCoeff() >= 0.0), "weights",
          "some are negative or not finite", "all must be 0 or larger");
  require(!up || (up->allFinite() && up->norm() > 0.0), "up", "zero or not finite", "a direction is needed");
  require_contact(contact);
  require(!contact.itself, "contact", "a surface's contact with itself",
          "obstacles and the ground are allowed");
  require_memory("vertices", bytes_per_vertex * static_cast<double>(vertices.rows()));
  const ThreadScope threads(options.threads);
  const CancelScope cancel(progress);

  progress.report(0.0, "sharpening");
  const TriangleMesh mesh = facing_outwards({vertices, triangles});
  progress.check();
  const WeldedSurface surface(mesh, moved, progress);
  const StyleAtTriangles at(style, surface, options);
  const bool part_way = alone && !contact.any() && options.strength < 1.0;
  const double weight = options.style_weight * (part_way ? 1.0 : at.share) / options.rigidity;
  Vector factors = weight * at.factors, plain = Vector::Ones(surface.triangles());
  if (weight > 0.0 && surface.triangles() > 0) plain = plainness(surface, progress);
  factors.array() *= detail_weight + (1.0 - detail_weight) * plain.array();
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
  if (options.strength == 0.0 || surface.triangles() == 0 || options.iterations == 0 ||
      !(factors.maxCoeff() > 0.0))
    return result;

  Points start = surface.at_nodes(moved);
  if (part_way) start = surface.rest() + (start - surface.rest()) / options.strength;
  Finish finish(surface, std::move(start), at, factors, plain, held, contact, progress);
  for (Index step = 0; step < options.iterations; ++step) {
    progress.report(0.1 + 0.85 * static_cast<double>(step) / static_cast<double>(options.iterations),
                    "sharpening");
    finish.step();
  }
  progress.report(0.95, "sharpening");
  if (up && std::find(held.begin(), held.end(), 1) == held.end()) finish.stand(up->normalized());
  if (part_way) finish.go_part_way(options.strength);
  finish.spare_folds();
  for (Index v = 0; v < vertices.rows(); ++v)
    if (const std::int32_t node = surface.node_of()[v]; node >= 0) {
      if (!held[node]) result.row(v) = finish.positions().row(node);
    }
  progress.report(1.0, "sharpening");
  return result;
}

}  // namespace arapfields
