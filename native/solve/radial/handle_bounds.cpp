// SPDX-License-Identifier: GPL-3.0-or-later
#include "solve/radial/handle_bounds.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <tuple>

#include "fields/radial_evaluator.h"
#include "sampling/oriented_points.h"
#include "sampling/sample_choice.h"
#include "solve/radial/contact_forces.h"
#include "solve/radial/handle_motion.h"

namespace arapfields {
namespace {

/// Most bounds in a set (no translation may fulfil all), most sweeps of Hildreth's method for each set, and
/// the tolerance of bounds, in cube units.
constexpr std::size_t most_active = 40;
constexpr int most_sweeps = 200;
constexpr double bound_tolerance = 1e-6;
/// A contact point is under a point handle if it is no farther from it than `under` at rest, nor than `aside`
/// perpendicular to the plane's normal now, in widths of the shape there.
constexpr double under = 1.5, aside = 0.35;
/// Motion of a handle, in cube units, below which its weight no longer grows.
constexpr double unmoved = 1e-3;
/// Searches for the thickest part of the shape near a point handle, which may lie at a thin edge.
constexpr int thicker = 3;
/// Planes of curved solids are linearised anew, at most so many times, until the translation changes by less
/// than `unchanged`, in cube units.
constexpr int most_times = 6;
constexpr double unchanged = 1e-4;
/// A plane is linearised anew if the translated point is within `near_bound` of it, in cube units, and the
/// cosine of the new normal with the old one is at least `least_turned`.
constexpr double near_bound = 0.05, least_turned = 0.0;

/// Weight of each handle: its number of points over its mean squared motion.
Vector masses_of(const BoundHandles& handles) {
  Vector masses(handles.count());
  for (Index i = 0; i < handles.count(); ++i) {
    const Index begin = handles.begin(i), rows = handles.begin(i + 1) - begin;
    const Points motion =
        handles.targets().middleRows(begin, rows) - handles.sources().middleRows(begin, rows);
    masses[i] = static_cast<double>(rows) / (motion.rowwise().squaredNorm().mean() + unmoved * unmoved);
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
    for (int search = 0; search < thicker; ++search) {
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

}  // namespace

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
  if (length > under * pin.width || (arm - along * normal).norm() > aside * pin.width)
    return -std::numeric_limits<double>::infinity();
  const double longer = arm.norm() > 0.0 ? length / arm.norm() : 1.0;
  return offset - normal.dot(pin.target) - longer * along;
}

Vec3 HandleBounds::reflected(Vec3 arm, bool mirrored) const {
  if (mirrored) arm[state_.problem.mirror->axis] *= -1.0;
  return arm;
}

HandleBounds::Place HandleBounds::place_of(Index row, bool mirrored) const {
  Index sample = state_.contact.sample_of(row);
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
    double most = bound_tolerance;
    std::size_t worst = bounds.size();
    for (std::size_t k = 0; k < bounds.size(); ++k)
      if (const double depth = bounds[k].depth - bounds[k].normal.dot(translation); depth > most)
        most = depth, worst = k;
    if (worst == bounds.size() || active.size() == most_active ||
        std::find(active.begin(), active.end(), worst) != active.end())
      break;
    active.push_back(worst);
    double change = bound_tolerance;
    for (int sweep = 0; sweep < most_sweeps && change >= bound_tolerance; ++sweep) {
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
    const BarrierSurface& surface = s.contact.surfaces()[static_cast<std::size_t>(k)];
    if (surface.is_ground() || surface.is_sheet()) continue;
    std::vector<Bound*> of;
    for (Bound& bound : bounds)
      if (bound.surface == k && bound.target && bound.depth > -length &&
          bound.normal.dot(translation) - bound.depth < near_bound)
        of.push_back(&bound);
    if (of.empty()) continue;
    Points places(std::ssize(of), 3);
    for (std::size_t m = 0; m < of.size(); ++m)
      places.row(static_cast<Index>(m)) =
          reflected(*of[m]->target + translation, of[m]->mirrored).transpose();
    const BarrierSurface::Nearest there = surface.nearest(places);
    for (std::size_t m = 0; m < of.size(); ++m) {
      const auto row = static_cast<Index>(m);
      const Vec3 normal = reflected(there.normals.row(row).transpose(), of[m]->mirrored);
      if (normal.dot(of[m]->normal) < least_turned) continue;
      of[m]->normal = normal;
      of[m]->depth =
          normal.dot(translation) - there.distances[row] + surface.margin() + ContactTerms::safety_distance;
      any = true;
    }
  }
  return any;
}

std::pair<Vec3, Index> HandleBounds::least_translation(Index handle) {
  std::vector<Bound>& bounds = bounds_of(handle);
  auto [translation, surface] = solve(bounds);
  for (int times = 0; surface >= 0 && times < most_times && linearise_anew(bounds, translation); ++times) {
    const Vec3 last = translation;
    std::tie(translation, surface) = solve(bounds);
    if ((translation - last).norm() < unchanged) break;
  }
  return {translation, surface};
}

}  // namespace arapfields
