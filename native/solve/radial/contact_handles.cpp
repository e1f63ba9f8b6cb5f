// SPDX-License-Identifier: GPL-3.0-or-later
// Handles give way: what they hold stays beyond the planes that were found, as it is, and is not squashed.
#include "solve/radial/contact_handles.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <optional>
#include <tuple>

#include "fields/radial_evaluator.h"
#include "sampling/oriented_points.h"
#include "sampling/sample_choice.h"
#include "solve/radial/contact_forces.h"
#include "solve/radial/handle_motion.h"

namespace arapfields {
namespace {

/// Sweeps over the planes of a handle, and the change, in cube units, below which these end.
constexpr int most_sweeps = 200;
constexpr double settled = 1e-6;
/// What lies under a point handle, in widths of the shape there: no farther from it at rest, nor aside of it
/// as seen along a plane's normal.
constexpr double under = 1.5, aside = 0.35;
/// A handle that has moved less than that, in cube units, is as good as at rest.
constexpr double unmoved = 1e-3;
/// What the shape itself holds back is pulled by no more than from so far, in cube units: neighbours, held
/// back in unlike ways, would squash what is between them.
constexpr double longest_pull = 0.01;
/// Handles farther from their targets against a force, in cube units, are held back.
constexpr double held_back = 0.02;
/// Searches for the thickest part of the shape beside a point handle, which may lie at an edge.
constexpr int thicker = 3;

/// Planes of solids turn as long as the translation changes by more, in cube units, but so many times at
/// most.
constexpr int most_turns = 6;
constexpr double turned_enough = 1e-4;
/// Those that it ends so far from, in cube units, stay; so do those whose normal would be of another side.
constexpr double near_bound = 0.05, same_side = 0.0;

/// A translation moves a part along `normal` by `depth` or more.
struct Bound {
  Vec3 normal;
  double depth;
  Index surface;
  std::optional<Vec3> target = std::nullopt;  ///< of the place that stays outside of a solid
  bool over = false;                          ///< by its reflection
};

/// The least translation within the bounds, and the surface that asks for the most of it, by the method of
/// Hildreth (1957).
std::pair<Vec3, Index> least_translation(const std::vector<Bound>& bounds) {
  Vec3 way = Vec3::Zero();
  std::vector<double> pushes(bounds.size(), 0.0);
  double change = settled;
  for (int sweep = 0; sweep < most_sweeps && change >= settled; ++sweep) {
    change = 0.0;
    for (std::size_t k = 0; k < bounds.size(); ++k) {
      const double next = std::max(0.0, pushes[k] + bounds[k].depth - bounds[k].normal.dot(way));
      way += (next - pushes[k]) * bounds[k].normal;
      change = std::max(change, std::abs(next - pushes[k]));
      pushes[k] = next;
    }
  }
  const auto most = std::max_element(pushes.begin(), pushes.end());
  return {way, most == pushes.end() || *most == 0.0
                   ? -1
                   : bounds[static_cast<std::size_t>(most - pushes.begin())].surface};
}

/// Where a translation would take what a handle holds, curved solids have other planes than where it is now.
/// Whether any bound has become another one.
bool turn_bounds(const RadialState& s, const Vec3& way, std::vector<Bound>& bounds) {
  const auto turned = [&](Vec3 x, bool over) {
    if (over) x[s.problem.mirror->axis] *= -1.0;
    return x;
  };
  bool any = false;
  for (Index k = 0; k < std::ssize(s.contact.surfaces()); ++k) {
    const BarrierSurface& surface = s.contact.surfaces()[static_cast<std::size_t>(k)];
    if (surface.is_flat() || surface.is_sheet()) continue;
    std::vector<Bound*> of;
    for (Bound& bound : bounds)
      if (bound.surface == k && bound.target && bound.normal.dot(way) - bound.depth < near_bound)
        of.push_back(&bound);
    if (of.empty()) continue;
    Points places(std::ssize(of), 3);
    for (std::size_t m = 0; m < of.size(); ++m)
      places.row(static_cast<Index>(m)) = turned(*of[m]->target + way, of[m]->over).transpose();
    const BarrierSurface::Nearest there = surface.nearest(places);
    for (std::size_t m = 0; m < of.size(); ++m) {
      const auto row = static_cast<Index>(m);
      const Vec3 normal = turned(there.normals.row(row).transpose(), of[m]->over);
      if (normal.dot(of[m]->normal) < same_side) continue;
      of[m]->normal = normal;
      of[m]->depth = normal.dot(way) - there.distances[row] + surface.margin() + ContactTerms::kept;
      any = true;
    }
  }
  return any;
}

/// How little each handle gives way to others: what holds more, and what has moved less.
Vector masses_of(const BoundHandles& handles) {
  Vector masses(handles.count());
  for (Index i = 0; i < handles.count(); ++i) {
    const Index begin = handles.begin(i), rows = handles.begin(i + 1) - begin;
    const Points way = handles.targets().middleRows(begin, rows) - handles.sources().middleRows(begin, rows);
    masses[i] = static_cast<double>(rows) / (way.rowwise().squaredNorm().mean() + unmoved * unmoved);
  }
  return masses;
}

/// The handle that holds each of the problem's samples; −1: none.
const std::vector<Index>& holders(RadialState& s) {
  return s.holders.get({s.handles.revision()}, [&] {
    const BoundHandles& handles = s.handles.bound();
    std::vector<Index> result(static_cast<std::size_t>(s.problem.samples.size()), -1);
    for (Index i = 0; i < handles.count(); ++i)
      for (Index pair = handles.begin(i); pair < handles.begin(i + 1); ++pair)
        if (const Index sample = handles.members()[static_cast<std::size_t>(pair)]; sample >= 0)
          result[static_cast<std::size_t>(sample)] = i;
    return result;
  });
}

/// A handle at one point, beneath which the shape keeps its width.
struct Pin {
  Index handle;
  Vec3 rest, now, target;
  double width;
};

/// Twice the thickness of what is no farther than that from each of the points.
Vector widths_at(const RadialProblem& problem, const Points& points) {
  const Vector thickness = problem.shape->thickness->at(problem.surface());
  Vector widths = 2.0 * problem.shape->thickness->at(points);
  for (Index k = 0; k < points.rows(); ++k) {
    const Vector squares = (problem.surface().rowwise() - points.row(k)).rowwise().squaredNorm();
    for (int search = 0; search < thicker; ++search) {
      const double square = widths[k] * widths[k];
      for (Index i = 0; i < squares.size(); ++i)
        if (squares[i] < square) widths[k] = std::max(widths[k], 2.0 * thickness[i]);
    }
  }
  return widths;
}

std::vector<Pin> pins(RadialState& s, const std::vector<Mat4>& motions) {
  const BoundHandles& handles = s.handles.bound();
  std::vector<Index> rows, of;
  for (Index i = 0; i < handles.count(); ++i)
    if (handles.handle(i).kind == Handle::Kind::point) rows.push_back(handles.begin(i)), of.push_back(i);
  if (rows.empty()) return {};
  const Points rest = rows_of(handles.sources(), rows);
  const Points now = radial_rows(s.problem.basis, rest, JetOrder::value) * s.shape.coefficients;
  const Vector& widths = s.pin_widths.get({s.handles.revision()}, [&] { return widths_at(s.problem, rest); });
  std::vector<Pin> result;
  for (std::size_t k = 0; k < of.size(); ++k) {
    const auto row = static_cast<Index>(k);
    const Mat4& motion = motions[static_cast<std::size_t>(of[k])];
    result.push_back(
        {of[k], rest.row(row), now.row(row), affine_image(rest.row(row), motion).row(0), widths[row]});
  }
  return result;
}

/// A place of a plane, or its reflection, and the handle that holds it; −1: none.
struct Place {
  Vec3 rest, now;
  Index holder;
};

/// How far a pin's target lies beyond a plane for what is under it to keep its length; −∞: not under it.
double beyond(const Pin& pin, const Vec3& normal, double offset, const Place& place) {
  const double length = (place.rest - pin.rest).norm();
  const Vec3 arm = place.now - pin.now;
  const double along = normal.dot(arm);
  if (length > under * pin.width || (arm - along * normal).norm() > aside * pin.width)
    return -std::numeric_limits<double>::infinity();
  const double longer = arm.norm() > 0.0 ? length / arm.norm() : 1.0;
  return offset - normal.dot(pin.target) - longer * along;
}

const std::vector<Index>& mirrored(RadialState& s) {
  return s.mirrored.get({1}, [&] {
    const Points& samples = s.problem.surface();
    const Points alike = Points::Zero(samples.rows(), 3);
    return OrientedPoints(samples, alike).nearest(s.problem.mirror->reflected(samples), alike, 0.0);
  });
}

}  // namespace

std::vector<Index> hold_back(RadialState& s, std::vector<Mat4>& motions) {
  std::vector<Index> by(motions.size(), -1);
  const ContactSet& set = s.contact.found();
  if (motions.empty() || set.planes.empty()) return by;
  const std::vector<Index>& holder = holders(s);
  const Vector masses = s.contact.itself() ? masses_of(s.handles.bound()) : Vector();
  std::vector<std::vector<Bound>> bounds(motions.size());
  const std::vector<Pin> points = pins(s, motions);
  const Points places = points.empty() ? Points() : contact_places(s);
  const auto turned = [&](Vec3 arm, bool over) {
    if (over) arm[s.problem.mirror->axis] *= -1.0;
    return arm;
  };
  const auto place_of = [&](Index row, bool over) -> Place {
    Index sample = s.contact.sample_of(row);
    if (over) sample = mirrored(s)[static_cast<std::size_t>(sample)];
    return {turned(set.places.row(row), over),
            points.empty() ? Vec3(Vec3::Zero()) : turned(places.row(row), over),
            holder[static_cast<std::size_t>(sample)]};
  };
  const auto target = [&](const Place& place) -> Vec3 {
    return affine_image(place.rest.transpose(), motions[static_cast<std::size_t>(place.holder)]).row(0);
  };
  // What a symmetric field keeps beyond a plane, it keeps beyond the plane's reflection.
  const auto bind = [&](const ContactPlane& plane, bool over) {
    const Vec3 normal = turned(plane.normal, over);
    const Place first = place_of(plane.first, over);
    const bool to_itself = plane.second >= 0;
    if (!to_itself)
      for (const Pin& pin : points)
        if (const double depth = beyond(pin, normal, plane.offset, first); depth > -pin.width)
          bounds[static_cast<std::size_t>(pin.handle)].push_back({normal, depth, plane.obstacle});
    const Place second = to_itself ? place_of(plane.second, over) : Place{{}, {}, -1};
    if (first.holder < 0 || first.holder == second.holder || (to_itself && second.holder < 0)) return;
    const Vec3 other = to_itself ? target(second) : Vec3(Vec3::Zero());
    const Vec3 wanted = target(first);
    const double depth = plane.offset - normal.dot(wanted - other);
    const double own = to_itself ? masses[second.holder] / (masses[first.holder] + masses[second.holder])
                                 : 1.0;  // the lighter gives way
    bounds[static_cast<std::size_t>(first.holder)].push_back(
        {normal, own * depth, plane.obstacle, to_itself ? std::nullopt : std::optional(wanted), over});
    if (to_itself)
      bounds[static_cast<std::size_t>(second.holder)].push_back(
          {-normal, (1.0 - own) * depth, plane.obstacle});
  };
  for (const ContactPlane& plane : set.planes) {
    bind(plane, false);
    if (s.problem.mirror) bind(plane, true);
  }
  for (std::size_t i = 0; i < motions.size(); ++i) {
    auto [way, surface] = least_translation(bounds[i]);
    for (int turn = 0; surface >= 0 && turn < most_turns && turn_bounds(s, way, bounds[i]); ++turn) {
      const Vec3 last = way;
      std::tie(way, surface) = least_translation(bounds[i]);
      if ((way - last).norm() < turned_enough) break;
    }
    motions[i].topRightCorner<3, 1>() += way;
    by[i] = surface;
  }
  return by;
}

void set_reachable_targets(RadialState& s, std::vector<Mat4> motions, bool gently) {
  const std::vector<Index> by = hold_back(s, motions);
  Points targets = s.handles.targets_at(motions);
  RadialObjective<float>& objective = *s.fast.objective.latest();
  const Index own = gently && s.contact.itself() && s.handles.any() ? s.handles.own_count() : 0;
  const Index itself = s.contact.surface_count() - 1;
  const Points values = objective.handle_values(s.measurements(s.fast)).cast<double>();
  for (Index first = 0, last = 0; first < own; first = last) {
    const Index handle = s.handles.handle_of(first);
    while (last < own && s.handles.handle_of(last) == handle) ++last;
    if (by[static_cast<std::size_t>(handle)] != itself) continue;
    const Points left = (targets - values).middleRows(first, last - first);
    const double length = std::sqrt(left.rowwise().squaredNorm().mean());
    if (length > longest_pull)
      targets.middleRows(first, last - first) =
          values.middleRows(first, last - first) + longest_pull / length * left;
  }
  objective.set_targets(targets);
}

std::vector<HeldBack> held_back_handles(RadialState& s) {
  std::vector<HeldBack> result;
  const RadialObjective<float>& objective = s.objective(s.fast);  // of the planes that were found last
  const Points places = contact_places(s);
  const Points values = objective.handle_values(s.measurements(s.fast)).cast<double>();
  const Points& targets = s.handles.pairs().targets;
  const Index own = s.handles.any() ? s.handles.own_count() : 0;
  std::vector<Mat4> motions = motions_of(s.handles.bound());
  const std::vector<Index> surfaces = hold_back(s, motions);
  for (Index first = 0, last = 0; first < own; first = last) {
    const Index handle = s.handles.handle_of(first);
    while (last < own && s.handles.handle_of(last) == handle) ++last;
    const Points left = (targets - values).middleRows(first, last - first);
    const double distance = left.rowwise().norm().mean();
    if (distance < held_back) continue;
    const Vec3 middle = values.middleRows(first, last - first).colwise().mean();
    const Vector along = s.contact.found().forces_at(middle, places.data(), s.contact.surface_count()) *
                         left.colwise().mean().transpose();
    Index by = 0;
    const bool pressed = along.minCoeff(&by) < 0.0;
    const Index back = surfaces[static_cast<std::size_t>(handle)];
    if (back >= 0 || pressed)
      result.push_back(
          {handle, s.contact.name_of(back >= 0 ? back : by), s.problem.frame().scale * distance});
  }
  return result;
}

}  // namespace arapfields
