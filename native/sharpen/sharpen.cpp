// SPDX-License-Identifier: GPL-3.0-or-later
#include "sharpen/sharpen.h"

#include <algorithm>
#include <cmath>
#include <unordered_set>

#include "core/errors.h"
#include "core/memory.h"
#include "core/parallel.h"
#include "core/types.h"
#include "energies/gauss.h"
#include "energies/rotation.h"
#include "mesh/outward_triangles.h"
#include "sharpen/contact_limits.h"
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
/// Residual of a global step's system, relative to that at its start.
constexpr double solve_tolerance = 0.05;
/// Rounds in which folded triangles are opened, and in which what lies around them gets its shape back, in
/// sweeps: after some rounds they are opened again, and a ring more follows. And rings in which what is still
/// folded gets its shape at rest, at first and at most: twice as many each time.
constexpr int most_openings = 8, most_relaxations = 16, rounds_a_ring = 4, relaxing_sweeps = 8;
constexpr int first_rings_at_rest = 4, most_rings_at_rest = 64;
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
    Points normals;
    surface.normals(surface.rest(), normals);
    const StyleAtSamples at = StyleAtSamples::of(style, unit_rows(normals), options.sharpness);
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

  /// The direction that pulls at a triangle of this unit normal, and how much, from 0 to 1; `around`: the
  /// normal of the surface around it, which chooses between preferred ones.
  std::pair<Vec3, double> direction(Index triangle, const Vec3& normal, const Vec3& around) const {
    const auto pull = [](double cosine) {
      return std::clamp((cosine - no_pull) / (full_pull - no_pull), 0.0, 1.0);
    };
    if (targets.rows() > 0) return {targets.row(triangle), pull(targets.row(triangle).dot(normal))};
    Index nearest = 0;
    const double best = (preferred * around).maxCoeff(&nearest);
    double second = -1.0;
    for (Index k = 0; k < preferred.rows(); ++k)
      if (preferred.row(k).dot(preferred.row(nearest)) < one_face)
        second = std::max(second, preferred.row(k).dot(around));
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
      surface.edges(i, [&](Index j, double half) { sum += half * (at_nodes.row(j) - at_nodes.row(i)); });
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
      const double share = std::clamp((cosine - on_detail) / (off_detail - on_detail), 0.0, 1.0);
      result[t] = share * share * (3.0 - 2.0 * share);
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

  /// Opens triangles that are folded, one vertex of each at a time; where that does not help, gives what lies
  /// around them its former shape, in more and more rings by turns with the former. What then is folded
  /// gets its shape at rest, in wider and wider rings by turns with openings. If that leaves what was not
  /// folded at the start, all goes back there.
  void spare_folds() {
    surface_.rotations(positions_, rotations_);
    std::vector<std::int32_t> found = folded();
    int rings = first_rings_at_rest;
    for (int round = 0; !found.empty(); ++round) {
      progress_.check();
      std::vector<std::int32_t> moved;
      const bool relaxes = round < most_openings + most_relaxations;
      if (round < most_openings || (round % rounds_a_ring == 0) == relaxes) {
        for (const std::int32_t t : found)
          if (const std::int32_t node = open(t); node >= 0) moved.push_back(node);
      } else if (relaxes) {
        for (const std::int32_t t : found) {
          const std::vector<std::int32_t> nodes =
              nodes_around(t, 1 + (round - most_openings) / rounds_a_ring);
          relax(nodes, shape_of(t));
          moved.insert(moved.end(), nodes.begin(), nodes.end());
        }
      } else {
        if (rings > most_rings_at_rest) {
          const auto before = [&](std::int32_t t) { return is_folded(surface_, t, start_); };
          if (!std::all_of(found.begin(), found.end(), before)) positions_ = start_;
          return;
        }
        for (const std::int32_t t : found) {
          const std::vector<std::int32_t> nodes = set_back(t, rings);
          moved.insert(moved.end(), nodes.begin(), nodes.end());
        }
        rings *= 2;
      }
      if (limits_.any()) {
        const std::vector<char> kept = limits_.keep(positions_);
        for (Index i = 0; i < surface_.nodes(); ++i)
          if (kept[i]) moved.push_back(static_cast<std::int32_t>(i));
      }
      found = folded(moved, found);
    }
  }

  const Points& positions() const { return positions_; }

 private:
  /// The shape that a triangle gets back: that at the start, or where it is folded there, at rest.
  const Points& shape_of(Index triangle) const {
    return is_folded(surface_, triangle, start_) ? surface_.rest() : start_;
  }

  std::vector<std::int32_t> folded() const {
    const std::vector<char> now = all_folded(surface_, positions_, rotations_);
    std::vector<std::int32_t> result;
    for (Index t = 0; t < surface_.triangles(); ++t)
      if (now[t]) result.push_back(static_cast<std::int32_t>(t));
    return result;
  }

  /// The same after these nodes have moved since it was `found`.
  std::vector<std::int32_t> folded(const std::vector<std::int32_t>& moved,
                                   const std::vector<std::int32_t>& found) {
    const auto sorted = [](std::vector<std::int32_t> list) {
      std::sort(list.begin(), list.end());
      list.erase(std::unique(list.begin(), list.end()), list.end());
      return list;
    };
    std::vector<std::int32_t> turned = moved, near = found, result;
    for (const std::int32_t i : sorted(moved))
      turned.insert(turned.end(), surface_.neighbours().begin() + surface_.first_neighbour()[i],
                    surface_.neighbours().begin() + surface_.first_neighbour()[i + 1]);
    for (const std::int32_t i : sorted(std::move(turned))) {
      rotations_[i] = surface_.rotation(i, positions_);
      surface_.around(i, [&](Index t, int) { near.push_back(static_cast<std::int32_t>(t)); });
    }
    for (const std::int32_t t : sorted(std::move(near)))
      if (is_folded(surface_, t, positions_, rotations_)) result.push_back(t);
    return result;
  }

  /// Nodes within that many rings of a triangle, from the inner ones on; `first_of_ring`: of the second one
  /// on, where each begins.
  std::vector<std::int32_t> nodes_around(Index triangle, int rings,
                                         std::vector<std::size_t>* first_of_ring = nullptr) const {
    std::vector<std::int32_t> result;
    std::unordered_set<std::int32_t> reached;
    const auto reach = [&](Index t) {
      for (int k = 0; k < 3; ++k)
        if (const std::int32_t node = surface_.corners()(t, k); reached.insert(node).second)
          result.push_back(node);
    };
    reach(triangle);
    std::size_t from = 0;
    for (int ring = 1; ring < rings && from < result.size(); ++ring) {
      const std::size_t end = result.size();
      if (first_of_ring) first_of_ring->push_back(end);
      for (; from < end; ++from) surface_.around(result[from], [&](Index t, int) { reach(t); });
    }
    return result;
  }

  /// The rotation that fits the edges of nodes best, from this shape on.
  Mat3 turn_of(const std::vector<std::int32_t>& nodes, const Points& shape) const {
    Mat3 spread = Mat3::Zero();
    for (const std::int32_t node : nodes)
      surface_.edges(node, [&](Index j, double weight) {
        spread += weight * (positions_.row(j) - positions_.row(node)).transpose() *
                  (shape.row(j) - shape.row(node));
      });
    return closest_rotation(spread);
  }

  /// Gives a triangle its shape at rest, moved as a whole, and what is around it the less of it the
  /// farther it is, in this many rings. Returns the nodes.
  std::vector<std::int32_t> set_back(Index triangle, int rings) {
    std::vector<std::size_t> first_of_ring;
    const std::vector<std::int32_t> nodes = nodes_around(triangle, rings, &first_of_ring);
    const Mat3 turn = turn_of(nodes, surface_.rest());
    Vec3 before = Vec3::Zero(), now = Vec3::Zero();
    for (const std::int32_t node : nodes) {
      before += surface_.rest().row(node) / static_cast<double>(nodes.size());
      now += positions_.row(node) / static_cast<double>(nodes.size());
    }
    std::size_t ring = 0;
    for (std::size_t at = 0; at < nodes.size(); ++at) {
      while (ring < first_of_ring.size() && at >= first_of_ring[ring]) ++ring;
      if (held_[nodes[at]]) continue;
      const Vec3 place = now + turn * (surface_.rest().row(nodes[at]).transpose() - before);
      positions_.row(nodes[at]) +=
          (1.0 - static_cast<double>(ring) / rings) * (place.transpose() - positions_.row(nodes[at]));
    }
    return nodes;
  }

  /// Gives nodes, turned as one, this shape, as far as what is around them lets.
  void relax(const std::vector<std::int32_t>& nodes, const Points& shape) {
    const Mat3 turn = turn_of(nodes, shape);
    for (int sweep = 0; sweep < relaxing_sweeps; ++sweep)
      for (const std::int32_t node : nodes) {
        if (held_[node]) continue;
        Vec3 sum = Vec3::Zero();
        double weights = 0.0;
        surface_.edges(node, [&](Index j, double weight) {
          const Vec3 edge = shape.row(node) - shape.row(j), place = positions_.row(j);
          sum += weight * (place + turn * edge);
          weights += weight;
        });
        positions_.row(node) = sum / weights;
      }
  }

  /// Gives a triangle the height over its longest edge that it has in its former shape: of a thin triangle
  /// the vertex there hardly moves. Returns its node; −1 where none moves.
  std::int32_t open(Index t) {
    const Points& shape = shape_of(t);
    int apex = 0;
    double longest = -1.0;
    const auto corner = [&](int k) { return surface_.corners()(t, k % 3); };
    for (int k = 0; k < 3; ++k) {
      const double length = (shape.row(corner(k + 1)) - shape.row(corner(k + 2))).squaredNorm();
      if (length > longest && !held_[corner(k)]) {
        longest = length;
        apex = k;
      }
    }
    if (!(longest > 0.0)) return -1;
    const auto from = corner(apex + 1), to = corner(apex + 2);
    const Vec3 base = shape.row(to) - shape.row(from), side = shape.row(corner(apex)) - shape.row(from);
    const double along = side.dot(base) / longest;
    const Vec3 height = side - along * base, edge = positions_.row(to) - positions_.row(from);
    // The height lies across the edge in the plane that the triangle should have.
    Mat3 turn = Mat3::Zero();
    for (int k = 0; k < 3; ++k) turn += rotations_[corner(k)];
    const Vec3 rest[3] = {surface_.rest().row(from), surface_.rest().row(to),
                          surface_.rest().row(corner(apex))};
    const Vec3 normal = turn * (rest[1] - rest[0]).cross(rest[2] - rest[0]);
    const Vec3 across = normal.cross(edge);
    if (!(across.norm() > 0.0)) return -1;
    positions_.row(corner(apex)) =
        positions_.row(from) + (along * edge + height.norm() / across.norm() * across).transpose();
    return corner(apex);
  }

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
        Vec3 sum = Vec3::Zero();
        surface_.edges(i, [&](Index j, double half) {
          const Vec3 rest = surface_.rest().row(i) - surface_.rest().row(j);
          const Vec3 now = positions_.row(i) - positions_.row(j);
          sum += half * ((rotations_[i] + rotations_[j]) * rest - 2.0 * now);
        });
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
