// SPDX-License-Identifier: GPL-3.0-or-later
#include "energies/shared_motion.h"

#include <algorithm>
#include <vector>

#include "energies/alignment.h"

namespace arapfields {
namespace {

/// Places of a handle that are looked at.
constexpr Index most_places = 8;
/// Fewer places than these turn a shape only by chance: two keep their distance somewhere on many ways.
constexpr Index least_turned = 3;

/// Some places of a handle, and where it takes them.
struct Places {
  Points from, to;
  double weight;  ///< of the handle
  double held;    ///< weight of all that it holds

  bool follow(const Mat4& motion) const {
    const Points there = (from * motion.topLeftCorner<3, 3>().transpose()).rowwise() +
                         motion.topRightCorner<3, 1>().transpose();
    return (there - to).rowwise().norm().maxCoeff() <= shared_within;
  }
};

std::vector<Places> places_of(const BoundHandles& handles) {
  std::vector<Places> result;
  for (Index i = 0; i < handles.count(); ++i) {
    const Index rows = handles.begin(i + 1) - handles.begin(i), count = std::min(rows, most_places);
    const double weight = handles.handle(i).weight;
    Places places{Points(count, 3), Points(count, 3), weight, weight * static_cast<double>(rows)};
    for (Index k = 0; k < count; ++k) {
      const Index row = handles.begin(i) + k * rows / count;
      places.from.row(k) = handles.sources().row(row);
      places.to.row(k) = handles.targets().row(row);
    }
    result.push_back(std::move(places));
  }
  return result;
}

/// The rigid motion of some handles' places together, and of their reflections.
Mat4 motion_of(const std::vector<const Places*>& some, int axis) {
  Index count = 0;
  for (const Places* places : some) count += places->from.rows();
  Points from(count, 3), to(count, 3);
  Index row = 0;
  for (const Places* places : some) {
    from.middleRows(row, places->from.rows()) = places->from;
    to.middleRows(row, places->to.rows()) = places->to;
    row += places->from.rows();
  }
  if (axis >= 0) {
    from = from.replicate(2, 1).eval();
    to = to.replicate(2, 1).eval();
    from.bottomRows(count).col(axis) *= -1.0;
    to.bottomRows(count).col(axis) *= -1.0;
  }
  if (count >= least_turned) return rigid_motion(from, to);
  Mat4 moved = Mat4::Identity();
  moved.topRightCorner<3, 1>() = (to - from).colwise().mean().transpose();
  return moved;
}

}  // namespace

Mat4 shared_motion(const BoundHandles& handles, Index samples, int axis) {
  const std::vector<Places> every = places_of(handles);
  double weight = 0.0, held = 0.0;
  std::vector<const Places*> all;
  for (const Places& places : every) {
    if (places.follow(Mat4::Identity())) return Mat4::Identity();
    weight += places.weight;
    held += places.held;
    all.push_back(&places);
  }
  if (every.size() == 1)
    return 2 * handles.sources().rows() > samples ? motion_of(all, axis) : Mat4(Mat4::Identity());
  const auto is_shared = [&](const Mat4& motion) {
    double of_weight = 0.0, of_held = 0.0;
    for (const Places& places : every)
      if (places.follow(motion)) of_weight += places.weight, of_held += places.held;
    return 2.0 * of_weight > weight && 2.0 * of_held > held;
  };
  if (const Mat4 motion = motion_of(all, axis); is_shared(motion)) return motion;
  for (const Places& one : every) {
    if (const Mat4 motion = motion_of({&one}, axis); is_shared(motion)) return motion;
    std::vector<const Places*> others;
    for (const Places* places : all)
      if (places != &one) others.push_back(places);
    if (const Mat4 motion = motion_of(others, axis); is_shared(motion)) return motion;
  }
  return Mat4::Identity();
}

}  // namespace arapfields
