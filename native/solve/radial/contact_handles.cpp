// SPDX-License-Identifier: GPL-3.0-or-later
#include "solve/radial/contact_handles.h"

#include <cmath>

#include "solve/radial/contact_forces.h"
#include "solve/radial/handle_bounds.h"
#include "solve/radial/handle_motion.h"

namespace arapfields {
namespace {

/// Root mean square distance, in cube units, of a handle that self-contact holds back from its target:
/// neighbouring handles that are held back by different amounts would squash the shape between them.
constexpr double longest_pull = 0.01;
/// Mean distance of a handle from its target, in cube units, above which it is reported as held back.
constexpr double held_back = 0.02;

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
    if (length > longest_pull)
      targets.middleRows(first, last - first) =
          values.middleRows(first, last - first) + longest_pull / length * left;
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
    if (distance < held_back || !s.contact.has_planes()) continue;
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
