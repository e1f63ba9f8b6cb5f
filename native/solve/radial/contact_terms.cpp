// SPDX-License-Identifier: GPL-3.0-or-later
#include "solve/radial/contact_terms.h"

#include <algorithm>
#include <cmath>

#include "core/errors.h"
#include "core/random.h"
#include "sampling/sample_choice.h"

namespace arapfields {
namespace {

/// Samples that are followed at most; they lie denser than any detail of a radial field.
constexpr Index most_samples = 20000;
/// What is nearer has a plane, in cube units.
constexpr double near = 0.04, near_itself = 0.05;
/// Gaps may be less than kept by so much where nothing presses.
constexpr double slight = 2e-4;
/// Of itself, nothing that is farther is looked at.
constexpr double farthest = 0.12;
/// The cosine above which two normals are of one side of a solid.
constexpr double same_side = 0.3;
/// Distance that is kept beyond each margin, in cube units: what solves leave of a depth is within.
constexpr double kept = 1.5e-3;
/// More from the shape itself, of which the samples of both sides say less.
constexpr double kept_itself = 2.0 * kept;
/// Factor on what a depth adds to a pressure: fewer rounds, and below 2 they converge.
constexpr double relaxed = 1.8;
/// Pressures grow by no deeper gaps, in cube units: a solve that has only begun says little of forces.
constexpr double shallow = 0.01;
/// Forces farther than this from a handle, in cube units, count less.
constexpr double handle_reach = 0.2;

}  // namespace

void ContactTerms::set(const std::optional<Contact>& contact) {
  if (contact) {
    require_contact(*contact);
    require(!problem_.blend, "contact", "beside exact handles", "it needs handles that give way");
  }
  contact_ = contact;
  make_surfaces();
}

bool ContactTerms::set_further_ground(const std::optional<Ground>& ground) {
  if (ground == further_ground_) return false;
  further_ground_ = ground;
  make_surfaces();
  return true;
}

void ContactTerms::make_surfaces() {
  surfaces_.clear();
  const Frame& frame = problem_.frame();
  if (contact_) {
    for (const Obstacle& obstacle : contact_->obstacles) surfaces_.emplace_back(obstacle, frame);
    if (contact_->ground)
      surfaces_.push_back(BarrierSurface::ground({*contact_->ground, contact_->up}, frame));
  }
  if (further_ground_) surfaces_.push_back(BarrierSurface::ground(*further_ground_, frame));
  if (samples_.empty() && (!surfaces_.empty() || (contact_ && contact_->itself))) {
    Random random(static_cast<std::uint64_t>(problem_.options.seed), 3);
    samples_ = stratified(problem_.shape->order, std::min(most_samples, problem_.samples.size()), random);
  }
  self_.reset();
  if (contact_ && contact_->itself) self_.emplace(problem_, samples_, kept_itself);
  begin(problem_.basis.identity());
}

Points ContactTerms::places_at(const RowMatrix<double>& coefficients) {
  const RadialEvaluator<double>& evaluator = evaluator_.get({1}, [&] {
    return RadialEvaluator<double>(problem_.basis, rows_of(problem_.surface(), samples_), JetOrder::value);
  });
  Points places(evaluator.size(), 3);
  evaluator.evaluate(coefficients, {places.data(), places.rows(), JetOrder::value});
  return places;
}

/// Which way the samples face, as long as the surface is stretched.
Points ContactTerms::normals_at(const RowMatrix<double>& coefficients) {
  const RadialEvaluator<float>& evaluator = slopes_.get({1}, [&] {
    return RadialEvaluator<float>(problem_.basis, rows_of(problem_.surface(), samples_), JetOrder::first);
  });
  JetBlock<float> jets(evaluator.size(), JetOrder::first);
  evaluator.evaluate(coefficients, jets.view());
  Points normals = rows_of(problem_.samples.normals, samples_);
  for (Index i = 0; i < normals.rows(); ++i) {
    Mat3 slope;
    for (int k = 0; k < 3; ++k)
      slope.col(k) = Eigen::Map<const Eigen::Vector3f>(jets.view().at(first_column(k), i)).cast<double>();
    const Vec3 rest = normals.row(i).transpose();
    const Vec3 moved = rest[0] * slope.col(1).cross(slope.col(2)) +
                       rest[1] * slope.col(2).cross(slope.col(0)) +
                       rest[2] * slope.col(0).cross(slope.col(1));
    normals.row(i) = moved.transpose();
  }
  return normals;
}

void ContactTerms::release() {
  found_.revision = 0;
  found_.planes.clear();
  found_.places.resize(0, 3);
  pressures_.setZero();
  deepest_ = deepest_outside_ = 0.0;
  touches_itself_ = false;
}

void ContactTerms::begin(const RowMatrix<double>& coefficients) {
  if (!any()) return release();
  places_ = places_at(coefficients);
  if (self_) self_->begin(places_, [&] { return normals_at(coefficients); });
  seen_ = places_;
  const auto count = static_cast<Index>(surfaces_.size());
  clear_.resize(seen_.rows(), count);
  pressures_.resize(seen_.rows(), count + 1);
  for (Index k = 0; k < count; ++k) clear_.col(k) = surfaces_[static_cast<std::size_t>(k)].distances(seen_);
  release();
}

double ContactTerms::fastest(const RowMatrix<double>& rates) {
  return std::sqrt(places_at(rates).rowwise().squaredNorm().maxCoeff());
}

double ContactTerms::find(const RowMatrix<double>& coefficients, double further, bool jumped) {
  further_ = further;
  places_ = places_at(coefficients);
  std::vector<Index> rows;
  for (Index i = 0; i < places_.rows(); ++i) {
    const double way = (places_.row(i) - seen_.row(i)).norm();
    for (Index k = 0; k < clear_.cols(); ++k)
      if (clear_(i, k) - way < near + further_ + surfaces_[static_cast<std::size_t>(k)].margin()) {
        rows.push_back(i);
        break;
      }
  }
  const Points now = rows_of(places_, rows);
  found_.planes.clear();
  deepest_ = 0.0;
  RowMatrix<double> distances(now.rows(), clear_.cols());
  for (Index k = 0; k < clear_.cols(); ++k) distances.col(k) = add_planes(k, rows, now);
  for (Index i = 0; i < now.rows(); ++i) {
    if (distances.row(i).minCoeff() <= 0.0) continue;  // it was last outside before
    const Index row = rows[static_cast<std::size_t>(i)];
    seen_.row(row) = now.row(i);
    clear_.row(row) = distances.row(i);
  }
  deepest_outside_ = deepest_;
  if (self_) add_own_planes(coefficients, jumped);
  gather_places();
  return deepest_;
}

/// Adds the planes of one surface for samples (rows) that are `now` there. Returns their distances from it,
/// negative also beyond what they came through.
Vector ContactTerms::add_planes(Index k, const std::vector<Index>& rows, PointsIn now) {
  const BarrierSurface& surface = surfaces_[static_cast<std::size_t>(k)];
  BarrierSurface::Nearest nearest = surface.nearest(now);
  std::vector<Index> moved;  // those that may have come through
  for (Index i = 0; i < now.rows(); ++i) {
    const Index row = rows[static_cast<std::size_t>(i)];
    const double way = (now.row(i) - seen_.row(row)).norm(), clear = clear_(row, k);
    if (clear > 0.0 && way > clear + std::max(0.0, nearest.distances[i])) moved.push_back(i);
  }
  std::vector<Index> starts;
  for (const Index i : moved) starts.push_back(rows[static_cast<std::size_t>(i)]);
  const std::vector<BarrierSurface::Hit> hits =
      surface.first_hits(rows_of(seen_, starts), rows_of(now, moved));
  Vector offsets(now.rows());
  for (Index i = 0; i < now.rows(); ++i)
    offsets[i] = nearest.normals.row(i).dot(now.row(i)) - nearest.distances[i];
  for (std::size_t m = 0; m < moved.size(); ++m) {
    const BarrierSurface::Hit& hit = hits[m];
    if (hit.share > 1.0) continue;
    const Index i = moved[m];
    const double beyond = hit.normal.dot(now.row(i).transpose() - hit.place);
    if (surface.is_sheet() && beyond < 0.0) {  // the side that it came from is the outer one
      nearest.normals.row(i) *= -1.0;
      nearest.distances[i] *= -1.0;
      offsets[i] *= -1.0;
    }
    if (nearest.distances[i] < near + further_ && nearest.normals.row(i).dot(hit.normal) > same_side)
      continue;
    if (beyond > 0.0 && nearest.distances[i] > 0.0) continue;  // around it
    nearest.normals.row(i) = hit.normal.transpose();
    nearest.distances[i] = beyond;
    offsets[i] = hit.normal.dot(hit.place);
  }
  for (Index i = 0; i < now.rows(); ++i) {
    const double margin = surface.margin() + kept, gap = nearest.distances[i] - margin;
    const Index row = rows[static_cast<std::size_t>(i)];
    if (gap > near + further_) {
      pressures_(row, k) = 0.0;
      continue;
    }
    deepest_ = std::max(deepest_, -gap - kept);
    found_.planes.push_back({row, -1, nearest.normals.row(i).transpose(), offsets[i] + margin,
                             pressures_(row, k), 1.0 / static_cast<double>(samples_.size()), k});
  }
  return nearest.distances;
}

/// Adds the planes that samples of the shape itself carry along.
void ContactTerms::add_own_planes(const RowMatrix<double>& coefficients, bool jumped) {
  const Index own = pressures_.cols() - 1;
  const Vector before = pressures_.col(own);
  touches_itself_ = false;
  pressures_.col(own).setZero();
  const auto normals = [&] { return normals_at(coefficients); };
  for (const FacingPair& pair :
       self_->find(places_, normals, std::min(near_itself + further_, farthest), jumped)) {
    pressures_(pair.first, own) = before[pair.first];
    deepest_ = std::max(deepest_, pair.least - kept - pair.gap);
    touches_itself_ = touches_itself_ || pair.gap < pair.least - slight;
    found_.planes.push_back({pair.first, pair.second, pair.normal, pair.least, before[pair.first],
                             1.0 / static_cast<double>(samples_.size()), own});
  }
}

bool ContactTerms::overlaps(const RowMatrix<double>& coefficients) {
  return self_ && self_->overlaps(places_at(coefficients), normals_at(coefficients));
}

/// The places of the planes' samples, once each.
void ContactTerms::gather_places() {
  std::vector<Index>& used = found_.samples;
  used.clear();
  for (const ContactPlane& plane : found_.planes) {
    used.push_back(plane.first);
    if (plane.second >= 0) used.push_back(plane.second);
  }
  std::sort(used.begin(), used.end());
  used.erase(std::unique(used.begin(), used.end()), used.end());
  found_.places.resize(std::ssize(used), 3);
  for (std::size_t i = 0; i < used.size(); ++i)
    found_.places.row(static_cast<Index>(i)) =
        problem_.surface().row(samples_[static_cast<std::size_t>(used[i])]);
  const auto row_of = [&](Index sample) {
    return std::lower_bound(used.begin(), used.end(), sample) - used.begin();
  };
  for (ContactPlane& plane : found_.planes) {
    plane.first = row_of(plane.first);
    if (plane.second >= 0) plane.second = row_of(plane.second);
  }
  found_.revision = found_.planes.empty() ? 0 : ++sets_;
}

double ContactTerms::touching() const {
  double share = 0.0;
  for (const ContactPlane& plane : found_.planes)
    if (plane.pressure > 0.0) share += plane.share;
  return share;
}

std::string ContactTerms::name_of(Index surface) const {
  if (contact_ && surface < std::ssize(contact_->obstacles))
    return "obstacles[" + std::to_string(surface) + "]";
  return surface < std::ssize(surfaces_) ? "ground" : "itself";
}

Points ContactTerms::forces_at(const Vec3& place, const double* places) const {
  Points forces = Points::Zero(pressures_.cols(), 3);
  const auto nearness = [&](Index row) {
    const double square = (Eigen::Map<const Vec3>(places + 3 * row) - place).squaredNorm();
    return 1.0 / (square + handle_reach * handle_reach);
  };
  for (const ContactPlane& plane : found_.planes) {
    const double share = nearness(plane.first) - (plane.second < 0 ? 0.0 : nearness(plane.second));
    forces.row(plane.obstacle) += share * plane.share * plane.pressure * plane.normal.transpose();
  }
  return forces;
}

void ContactTerms::press(const double* places) {
  for (ContactPlane& plane : found_.planes) {
    const double gap = std::max(-shallow, plane.gap(places));
    plane.pressure = plane.pressed(gap, gap < 0.0 ? relaxed * stiffness : stiffness);
    pressures_(found_.samples[static_cast<std::size_t>(plane.first)], plane.obstacle) = plane.pressure;
  }
}

}  // namespace arapfields
