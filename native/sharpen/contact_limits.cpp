// SPDX-License-Identifier: GPL-3.0-or-later
#include "sharpen/contact_limits.h"

#include <algorithm>

#include "core/parallel.h"

namespace arapfields {
namespace {

/// In the frame: what counts as no nearer, and the distance from a sheet, which has no margin of its own.
constexpr double slack = 1e-6, off_a_sheet = 1e-3;
/// Rounds in which a node goes to its distance, those after them in which it goes half of the way back to its
/// start, and all of them: in the last one it goes to its start.
constexpr int outward_rounds = 6, all_rounds = 12;
constexpr Index nodes_at_once = 16384;

}  // namespace

ContactLimits::ContactLimits(const Contact& contact, const Points& start, const Progress& progress)
    : start_(start) {
  if (!contact.any()) return;
  frame_ = Frame::around(start);
  std::vector<bool> known;  // whether the distance is one
  for (const Obstacle& obstacle : contact.obstacles) {
    sides_.push_back({ContactSurface(obstacle, frame_), {}, {}});
    known.push_back(obstacle.function->gradient_bound() == 1.0);
  }
  if (contact.ground) {
    sides_.push_back({ContactSurface::ground({*contact.ground, contact.up}, frame_), {}, {}});
    known.push_back(true);
  }
  const Points places = frame_.to_cube(start);
  for (std::size_t s = 0; s < sides_.size(); ++s) {
    Side& side = sides_[s];
    side.room = Vector::Zero(places.rows());
    for (Index begin = 0; begin < places.rows(); begin += nodes_at_once) {
      progress.check();
      const Index rows = std::min(nodes_at_once, places.rows() - begin);
      side.room.segment(begin, rows) = side.surface.distances(places.middleRows(begin, rows));
    }
    const double margin = side.surface.margin();
    side.least = side.room.cwiseMin(side.surface.is_sheet() ? std::max(margin, off_a_sheet) : margin);
    side.room -= side.least;
    if (!known[s]) side.room.setZero();
  }
}

std::vector<char> ContactLimits::keep(Points& positions) const {
  std::vector<char> kept(start_.rows(), 0);
  bool beyond = any();
  for (int round = 0; beyond && round < all_rounds; ++round) {
    beyond = false;
    for (const Side& side : sides_) beyond = keep(side, round, positions, kept) || beyond;
  }
  return kept;
}

bool ContactLimits::keep(const Side& side, int round, Points& positions, std::vector<char>& kept) const {
  std::vector<Index> near;
  for (Index i = 0; i < start_.rows(); ++i)
    if ((positions.row(i) - start_.row(i)).norm() > frame_.scale * side.room[i]) near.push_back(i);
  if (near.empty()) return false;
  const Points from = frame_.to_cube(start_(near, Eigen::all)),
               now = frame_.to_cube(positions(near, Eigen::all));
  Points places = now;
  if (side.surface.is_sheet()) {
    const auto hits = side.surface.first_hits(from, now);
    for (std::size_t k = 0; k < near.size(); ++k)
      if (hits[k].parameter <= 1.0)
        places.row(k) = (hits[k].place + side.least[near[k]] * hits[k].normal).transpose();
  }
  const ContactSurface::Nearest nearest = side.surface.nearest(places);
  bool beyond = false;
  for (std::size_t k = 0; k < near.size(); ++k) {
    const Index i = near[k], row = static_cast<Index>(k);
    const double lacks = side.least[i] - nearest.distances[row];
    if (lacks > slack) places.row(row) += lacks * nearest.normals.row(row);
    if ((places.row(row) - now.row(row)).norm() <= slack) continue;
    beyond = true;
    kept[i] = 1;
    if (round < outward_rounds)
      positions.row(i) = (frame_.center + frame_.scale * places.row(row).transpose()).transpose();
    else
      positions.row(i) =
          round + 1 < all_rounds ? (0.5 * (positions.row(i) + start_.row(i))).eval() : start_.row(i).eval();
  }
  return beyond;
}

}  // namespace arapfields
