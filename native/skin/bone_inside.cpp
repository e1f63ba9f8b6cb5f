// SPDX-License-Identifier: GPL-3.0-or-later
#include "skin/bone_inside.h"

#include <algorithm>
#include <cmath>

namespace arapfields {
namespace {

/// Bounds of the number of view points along a bone.
constexpr Index least_places = 5, most_places = 40;
/// A bone that no surface encloses may be in one that covers at least so many directions on average.
constexpr int least_sides = 14;
/// Least fraction of a bone's view points, up to the last inside of a surface, that are inside of a surface
/// for the bone to be in it.
constexpr double share_inside = 0.4;

}  // namespace

std::vector<double> shares_along(double length, double spacing) {
  const Index count = std::clamp(static_cast<Index>(std::ceil(length / spacing)), least_places, most_places);
  std::vector<double> shares;
  for (Index k = 0; k < count; ++k)
    shares.push_back((static_cast<double>(k) + 0.5) / static_cast<double>(count));
  return shares;
}

BoneSurroundings::BoneSurroundings(const PiecePoints& given, const std::vector<Index>& given_slots,
                                   Index slot_count, double node_spacing)
    : surfaces(given), slots(given_slots), count(slot_count), spacing(node_spacing) {
  low = surfaces.points.colwise().minCoeff().transpose().array() - spacing;
  high = surfaces.points.colwise().maxCoeff().transpose().array() + spacing;
}

BoneInside::Segment::Segment(const BonePart& given, const std::vector<double>& shares,
                             const BoneSurroundings& around)
    : runs(static_cast<std::size_t>(around.count), {0, 0}), all(given) {
  for (const double share : shares)
    views.emplace_back(around.surfaces, around.slots, around.count,
                       all.start + share * (all.end - all.start));
  for (Index slot = 0; slot < around.count; ++slot) {
    auto& [first, last] = runs[static_cast<std::size_t>(slot)];
    const auto encloses = [&](const BoneSight& view) { return view.sides(slot) >= enough_sides; };
    const auto begin = std::ranges::find_if(views, encloses);
    first = static_cast<std::size_t>(begin - views.begin());
    last = static_cast<std::size_t>(std::find_if_not(begin, views.end(), encloses) - views.begin());
  }
}

bool BoneInside::Segment::is_inside(std::size_t view) const {
  return std::ranges::any_of(runs, [&](const auto& run) { return run.first <= view && view < run.second; });
}

void BoneInside::Segment::leave() {
  std::size_t inside = 0;
  while (inside < views.size() && is_inside(inside)) ++inside;
  for (auto& [first, last] : runs) {
    first = std::min(first, inside);
    last = std::min(last, inside);
  }
}

std::size_t BoneInside::Segment::length(Index slot) const {
  const auto& [first, last] = runs[static_cast<std::size_t>(slot)];
  return last - first;
}

BonePart BoneInside::Segment::part(Index slot) const {
  const auto& [first, last] = runs[static_cast<std::size_t>(slot)];
  const auto at = [&](std::size_t k) {
    const double share = static_cast<double>(k) / static_cast<double>(views.size());
    return Vec3((1.0 - share) * all.start + share * all.end);
  };
  return {at(first), at(last)};
}

BoneInside::BoneInside(const Skeleton& skeleton, Index bone, const BoneSurroundings& around)
    : around_(around), head_(skeleton.bone(bone).head), contains_(static_cast<std::size_t>(around.count), 0) {
  find_segments(skeleton, bone);
  find_surfaces();
}

bool BoneInside::sees(const Vec3& point, Index slot) const {
  if (slot < 0 || contains_[static_cast<std::size_t>(slot)] == 0) return false;
  for (const Segment& segment : segments_) {
    const auto& [first, last] = segment.runs[static_cast<std::size_t>(slot)];
    for (std::size_t k = first; k < last; ++k)
      if (segment.views[k].sees(point, slot, 0.5 * around_.spacing)) return true;
  }
  return false;
}

/// The segment from the head towards a place, up to the end of the box.
BoneInside::Segment BoneInside::towards(const Vec3& end) const {
  double within = 1.0;
  for (int k = 0; k < 3; ++k)
    if (const double along = end[k] - head_[k]; along != 0.0)
      within = std::min(within, ((along > 0.0 ? around_.high : around_.low)[k] - head_[k]) / along);
  const BonePart all{head_, within > 0.0 && within < 1.0 ? Vec3(head_ + within * (end - head_)) : end};
  return {all, shares_along((all.end - head_).norm(), around_.spacing), around_};
}

void BoneInside::find_segments(const Skeleton& skeleton, Index bone) {
  const Vec3& tail = skeleton.bone(bone).tail;
  Segment main = towards(tail);
  for (const Vec3& joint : skeleton.joints(bone))
    if (Segment way = towards(joint); way.is_inside(0)) segments_.push_back(std::move(way));
  if (main.all.end != tail || !main.is_inside(main.views.size() - 1)) {
    if (!segments_.empty()) return;
    main.leave();
  }
  const auto is_inside = [](const Segment& one) {
    return std::ranges::any_of(one.runs, [](const auto& run) { return run.first < run.second; });
  };
  if (!is_inside(main)) {  // the shape may be thinner than the distance of view points
    const double half = 0.5 / static_cast<double>(main.views.size());
    Segment start({head_, head_ + half * (main.all.end - head_)}, {0.0}, around_);
    if (is_inside(start)) main = std::move(start);
  }
  segments_.insert(segments_.begin(), std::move(main));
}

/// Finds the surfaces that contain the bone, and its parts inside of them.
void BoneInside::find_surfaces() {
  std::size_t all = 0;
  for (const Segment& segment : segments_) {
    std::size_t last = segment.views.size();
    while (last > 0 && !segment.is_inside(last - 1)) --last;
    all += last;
  }
  if (all == 0) return take_most_covering();
  for (Index slot = 0; slot < around_.count; ++slot) {
    std::size_t inside = 0;
    for (const Segment& segment : segments_) inside += segment.length(slot);
    if (static_cast<double>(inside) < share_inside * static_cast<double>(all)) continue;
    contains_[static_cast<std::size_t>(slot)] = 1;
    for (const Segment& segment : segments_)
      if (segment.length(slot) > 0) parts_.push_back(segment.part(slot));
  }
}

/// A bone that no surface encloses is in the one that covers the most directions about it, if they are many.
void BoneInside::take_most_covering() {
  int most = 0;
  std::size_t best = 0;
  for (Index slot = 0; slot < around_.count; ++slot) {
    int sides = 0;
    for (const BoneSight& view : segments_.front().views) sides += view.sides(slot);
    if (sides > most) most = sides, best = static_cast<std::size_t>(slot);
  }
  Segment& whole = segments_.front();
  if (most == 0 || most < least_sides * static_cast<int>(whole.views.size())) return;
  contains_[best] = 1;
  whole.runs[best] = {0, whole.views.size()};
}

}  // namespace arapfields
