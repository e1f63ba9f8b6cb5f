// SPDX-License-Identifier: GPL-3.0-or-later
#include "solve/contact/handles.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <optional>
#include <tuple>
#include <utility>

#include "fields/radial_evaluator.h"
#include "sampling/oriented_points.h"
#include "sampling/sample_choice.h"
#include "solve/contact/forces.h"
#include "solve/radial/handle_motion.h"

namespace arapfields {
namespace {

using P = ContactParameters;

/// Weight of each handle: its number of points over its mean squared motion.
Vector masses_of(const BoundHandles& handles) {
  Vector masses(handles.count());
  for (Index i = 0; i < handles.count(); ++i) {
    const Index begin = handles.begin(i), rows = handles.begin(i + 1) - begin;
    const Points motion =
        handles.targets().middleRows(begin, rows) - handles.sources().middleRows(begin, rows);
    masses[i] = static_cast<double>(rows) / (motion.rowwise().squaredNorm().mean() + P::unmoved * P::unmoved);
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

/// Width of the shape at each point: twice the greatest thickness within that distance.
Vector widths_at(const RadialProblem& problem, const Points& points) {
  const Vector thickness = problem.shape->thickness->at(problem.surface());
  Vector widths = 2.0 * problem.shape->thickness->at(points);
  for (Index k = 0; k < points.rows(); ++k) {
    const Vector squares = (problem.surface().rowwise() - points.row(k)).rowwise().squaredNorm();
    for (int search = 0; search < P::thickness_searches; ++search) {
      const double square = widths[k] * widths[k];
      for (Index i = 0; i < squares.size(); ++i)
        if (squares[i] < square) widths[k] = std::max(widths[k], 2.0 * thickness[i]);
    }
  }
  return widths;
}

/// The sample nearest to each sample's reflection.
const std::vector<Index>& mirror_samples(RadialState& s) {
  return s.mirrored.get({1}, [&] {
    const Points& samples = s.problem.surface();
    const Points alike = Points::Zero(samples.rows(), 3);
    return OrientedPoints(samples, alike).nearest(s.problem.mirror->reflected(samples), alike, 0.0);
  });
}

/// Contact constraints on the translations of handles: a translation is feasible if it brings all points that
/// the handle holds, moved rigidly by the handle's motion, to the feasible side of the contact planes.
class HandleBounds {
 public:
  HandleBounds(RadialState& state, const std::vector<Mat4>& motions);
  /// The feasible translation t of least norm, and the surface of the largest multiplier; −1: t is zero.
  std::pair<Vec3, Index> least_translation(Index handle);

 private:
  /// The constraint normal·t ≥ depth on a translation t.
  struct Bound {
    Vec3 normal;
    double depth;
    Index surface;
    std::optional<Vec3> target = std::nullopt;  ///< the point's position under the motion; none: fixed normal
    bool mirrored = false;                      ///< of the plane's reflection (symmetric fields)
  };
  /// A point handle. The shape between it and the contact planes below keeps its width.
  struct Pin {
    Index handle;
    Vec3 rest;
    Vec3 now;
    Vec3 target;
    double width;  ///< of the shape at the handle, in cube units
  };
  /// A point of a contact plane, or its reflection, and the handle that holds it; −1: none.
  struct Place {
    Vec3 rest;
    Vec3 now;
    Index holder;
  };

  static std::pair<Vec3, Index> solve(const std::vector<Bound>& bounds);
  static double depth_of(const Pin& pin, const Vec3& normal, double offset, const Place& place);
  std::vector<Pin> pins() const;
  Vec3 reflected(Vec3 arm, bool mirrored) const;
  Place place_of(Index row, bool mirrored) const;
  Vec3 target_of(const Place& place) const;
  void bind(const ContactPlane& plane, bool mirrored);
  void bind_to_surface(const ContactPlane& plane, const Vec3& normal, const Place& place, bool mirrored);
  void bind_to_itself(const ContactPlane& plane, const Vec3& normal, const Place& first, const Place& second);
  std::vector<Bound>& bounds_of(Index handle) { return bounds_[static_cast<std::size_t>(handle)]; }
  bool linearise_anew(std::vector<Bound>& bounds, const Vec3& translation) const;

  RadialState& state_;
  const std::vector<Mat4>& motions_;
  const std::vector<Index>& holders_;
  Vector masses_;  // weight of each handle: of two that meet, the lighter one moves more
  std::vector<Pin> pins_;
  Points places_;  // current positions of the contact set's points; empty without pins
  std::vector<std::vector<Bound>> bounds_;
};

HandleBounds::HandleBounds(RadialState& state, const std::vector<Mat4>& motions)
    : state_(state), motions_(motions), holders_(holders(state)), bounds_(motions.size()) {
  if (state.contact.itself()) masses_ = masses_of(state.handles.bound());
  pins_ = pins();
  if (!pins_.empty()) places_ = contact_places(state);
  for (const ContactPlane& plane : state.contact.found().planes) {
    bind(plane, false);
    // A symmetric field satisfies the reflections of its constraints as well.
    if (state.problem.mirror) bind(plane, true);
  }
}

std::vector<HandleBounds::Pin> HandleBounds::pins() const {
  RadialState& s = state_;
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
    const Mat4& motion = motions_[static_cast<std::size_t>(of[k])];
    result.push_back(
        {of[k], rest.row(row), now.row(row), affine_image(rest.row(row), motion).row(0), widths[row]});
  }
  return result;
}

/// Depth of the bound on a pin that keeps the rest distance between it and a contact point under it; −∞: the
/// point is not under it.
double HandleBounds::depth_of(const Pin& pin, const Vec3& normal, double offset, const Place& place) {
  const double length = (place.rest - pin.rest).norm();
  const Vec3 arm = place.now - pin.now;
  const double along = normal.dot(arm);
  if (length > P::under_pin * pin.width || (arm - along * normal).norm() > P::aside_of_pin * pin.width)
    return -std::numeric_limits<double>::infinity();
  const double longer = arm.norm() > 0.0 ? length / arm.norm() : 1.0;
  return offset - normal.dot(pin.target) - longer * along;
}

Vec3 HandleBounds::reflected(Vec3 arm, bool mirrored) const {
  if (mirrored) arm[state_.problem.mirror->axis] *= -1.0;
  return arm;
}

HandleBounds::Place HandleBounds::place_of(Index row, bool mirrored) const {
  Index sample = state_.contact.found().samples[static_cast<std::size_t>(row)];
  if (mirrored) sample = mirror_samples(state_)[static_cast<std::size_t>(sample)];
  return {reflected(state_.contact.found().places.row(row), mirrored),
          pins_.empty() ? Vec3(Vec3::Zero()) : reflected(places_.row(row), mirrored),
          holders_[static_cast<std::size_t>(sample)]};
}

Vec3 HandleBounds::target_of(const Place& place) const {
  return affine_image(place.rest.transpose(), motions_[static_cast<std::size_t>(place.holder)]).row(0);
}

void HandleBounds::bind(const ContactPlane& plane, bool mirrored) {
  const Vec3 normal = reflected(plane.normal, mirrored);
  const Place first = place_of(plane.first, mirrored);
  if (plane.second < 0) return bind_to_surface(plane, normal, first, mirrored);
  bind_to_itself(plane, normal, first, place_of(plane.second, mirrored));
}

void HandleBounds::bind_to_surface(const ContactPlane& plane, const Vec3& normal, const Place& place,
                                   bool mirrored) {
  for (const Pin& pin : pins_)
    if (const double depth = depth_of(pin, normal, plane.offset, place); depth > -pin.width)
      bounds_of(pin.handle).push_back({normal, depth, plane.obstacle});
  if (place.holder < 0) return;
  const Vec3 target = target_of(place);
  bounds_of(place.holder)
      .push_back({normal, plane.offset - normal.dot(target), plane.obstacle, target, mirrored});
}

/// Splits the constraint on two handles that meet in inverse proportion to their weights.
void HandleBounds::bind_to_itself(const ContactPlane& plane, const Vec3& normal, const Place& first,
                                  const Place& second) {
  if (first.holder < 0 || second.holder < 0 || first.holder == second.holder) return;
  const double depth = plane.offset - normal.dot(target_of(first) - target_of(second));
  const double own = masses_[second.holder] / (masses_[first.holder] + masses_[second.holder]);
  bounds_of(first.holder).push_back({normal, own * depth, plane.obstacle});
  bounds_of(second.holder).push_back({-normal, (1.0 - own) * depth, plane.obstacle});
}

/// The least translation within bounds, a quadratic program: Hildreth's method (1957) for a growing set of
/// bounds, to which the most violated one is added until none is violated.
std::pair<Vec3, Index> HandleBounds::solve(const std::vector<Bound>& bounds) {
  Vec3 translation = Vec3::Zero();
  std::vector<double> multipliers(bounds.size(), 0.0);
  std::vector<std::size_t> active;
  for (;;) {
    double most = P::bound_tolerance;
    std::size_t worst = bounds.size();
    for (std::size_t k = 0; k < bounds.size(); ++k)
      if (const double depth = bounds[k].depth - bounds[k].normal.dot(translation); depth > most)
        most = depth, worst = k;
    if (worst == bounds.size() || active.size() == P::most_bounds ||
        std::find(active.begin(), active.end(), worst) != active.end())
      break;
    active.push_back(worst);
    double change = P::bound_tolerance;
    for (int sweep = 0; sweep < P::bound_sweeps && change >= P::bound_tolerance; ++sweep) {
      change = 0.0;
      for (const std::size_t k : active) {
        const double next =
            std::max(0.0, multipliers[k] + bounds[k].depth - bounds[k].normal.dot(translation));
        translation += (next - multipliers[k]) * bounds[k].normal;
        change = std::max(change, std::abs(next - multipliers[k]));
        multipliers[k] = next;
      }
    }
  }
  const auto most = std::max_element(multipliers.begin(), multipliers.end());
  return {translation, most == multipliers.end() || *most == 0.0
                           ? -1
                           : bounds[static_cast<std::size_t>(most - multipliers.begin())].surface};
}

/// Linearises the bounds of curved solids anew at the translated points. Returns whether any was changed.
bool HandleBounds::linearise_anew(std::vector<Bound>& bounds, const Vec3& translation) const {
  const RadialState& s = state_;
  const double length = translation.norm();  // no point comes nearer by more
  bool any = false;
  for (Index k = 0; k < std::ssize(s.contact.surfaces()); ++k) {
    const ContactSurface& surface = s.contact.surfaces()[static_cast<std::size_t>(k)];
    if (surface.is_ground() || surface.is_sheet()) continue;
    std::vector<Bound*> of;
    for (Bound& bound : bounds)
      if (bound.surface == k && bound.target && bound.depth > -length &&
          bound.normal.dot(translation) - bound.depth < P::linearised_distance)
        of.push_back(&bound);
    if (of.empty()) continue;
    Points places(std::ssize(of), 3);
    for (std::size_t m = 0; m < of.size(); ++m)
      places.row(static_cast<Index>(m)) =
          reflected(*of[m]->target + translation, of[m]->mirrored).transpose();
    const ContactSurface::Nearest there = surface.nearest(places);
    for (std::size_t m = 0; m < of.size(); ++m) {
      const auto row = static_cast<Index>(m);
      const Vec3 normal = reflected(there.normals.row(row).transpose(), of[m]->mirrored);
      if (normal.dot(of[m]->normal) < 0.0) continue;
      of[m]->normal = normal;
      of[m]->depth = normal.dot(translation) - there.distances[row] + surface.margin() + P::safety_distance;
      any = true;
    }
  }
  return any;
}

std::pair<Vec3, Index> HandleBounds::least_translation(Index handle) {
  std::vector<Bound>& bounds = bounds_of(handle);
  auto [translation, surface] = solve(bounds);
  for (int times = 0; surface >= 0 && times < P::most_linearisations && linearise_anew(bounds, translation);
       ++times) {
    const Vec3 last = translation;
    std::tie(translation, surface) = solve(bounds);
    if ((translation - last).norm() < P::linearisation_tolerance) break;
  }
  return {translation, surface};
}

}  // namespace

std::vector<Index> hold_back(RadialState& s, std::vector<Mat4>& motions) {
  std::vector<Index> by(motions.size(), -1);
  if (motions.empty() || !s.contact.has_planes()) return by;
  HandleBounds bounds(s, motions);
  for (std::size_t i = 0; i < motions.size(); ++i) {
    const auto [translation, surface] = bounds.least_translation(static_cast<Index>(i));
    motions[i].topRightCorner<3, 1>() += translation;
    by[i] = surface;
  }
  return by;
}

std::vector<Index> set_reachable_targets(RadialState& s, std::vector<Mat4> motions, Pull pull) {
  const std::vector<Index> by = hold_back(s, motions);
  Points targets = s.handles.targets_at(motions);
  RadialObjective<float>& objective = *s.fast.objective.latest();
  const bool pulls_short = pull != Pull::full && s.contact.itself() && s.handles.any();
  const Index own = pulls_short ? s.handles.own_count() : 0;
  const Index itself = s.contact.surface_count() - 1;
  const Points values = objective.handle_values(s.measurements(s.fast)).cast<double>();
  for (Index first = 0, last = 0; first < own; first = last) {
    const Index handle = s.handles.handle_of(first);
    while (last < own && s.handles.handle_of(last) == handle) ++last;
    if (pull != Pull::short_for_all && by[static_cast<std::size_t>(handle)] != itself) continue;
    const Points left = (targets - values).middleRows(first, last - first);
    const double length = std::sqrt(left.rowwise().squaredNorm().mean());
    if (length > P::longest_pull)
      targets.middleRows(first, last - first) =
          values.middleRows(first, last - first) + P::longest_pull / length * left;
  }
  objective.set_targets(targets);
  return by;
}

std::vector<HeldBack> held_back_handles(RadialState& s, const std::vector<Index>& by) {
  std::vector<HeldBack> result;
  const RadialObjective<float>& objective = s.objective(s.fast);  // with the planes of the last search
  const Points values = objective.handle_values(s.measurements(s.fast)).cast<double>();
  const Points& targets = s.handles.pairs().targets;
  const Index own = s.handles.any() ? s.handles.own_count() : 0;
  Points places;  // of the planes
  for (Index first = 0, last = 0; first < own; first = last) {
    const Index handle = s.handles.handle_of(first);
    while (last < own && s.handles.handle_of(last) == handle) ++last;
    const Points left = (targets - values).middleRows(first, last - first);
    const double distance = left.rowwise().norm().mean();
    if (distance < P::held_back || !s.contact.has_planes()) continue;
    if (places.rows() == 0) places = contact_places(s);
    const Vec3 middle = values.middleRows(first, last - first).colwise().mean();
    const Vector along = s.contact.found().forces_at(middle, places.data(), s.contact.surface_count()) *
                         left.colwise().mean().transpose();
    Index most = 0;
    const bool pressed = along.minCoeff(&most) < 0.0;
    const Index back = by[static_cast<std::size_t>(handle)];
    if (back >= 0 || pressed)
      result.push_back(
          {handle, s.contact.name_of(back >= 0 ? back : most), s.problem.frame().scale * distance});
  }
  return result;
}

}  // namespace arapfields
