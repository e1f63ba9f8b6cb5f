// SPDX-License-Identifier: GPL-3.0-or-later
#include "solve/radial/contact_points.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <numbers>

#include "core/decompositions.h"
#include "core/jacobians.h"
#include "core/unit_rows.h"
#include "sampling/sample_choice.h"

namespace arapfields {
namespace {

/// Most refined points.
constexpr Index most_finer = 12000;
/// Refined points for the area of one sample, and their greatest distance from it, in sample spacings.
constexpr double finer_density = 12.0, finer_reach = 2.2;
/// Least cosine between the normals of neighbours on the same side of the surface.
constexpr double same_side = 0.5;
/// How far beyond a sharp edge of the shape, in sample spacings, a refined point may lie.
constexpr double over_edge = 0.05;
/// Fewest neighbours for the fit of a quadratic height field; with fewer, refined points lie in the tangent
/// plane.
constexpr Index least_fitted = 5;

}  // namespace

void ContactPoints::choose(const Progress& progress) {
  if (!samples_.empty()) return;
  const auto followed = problem_.shape->followed(problem_.samples, progress);
  samples_ = followed->samples;
  parents_ = followed->parents;
  rest_ = followed->rest;
  spacing_ = followed->spacing;
  near_.resize(samples_.size());
  is_fine_.assign(samples_.size(), false);
  embedded_ = embedded_at(rest_);
  coarse_ = rest_.rows();
}

Index ContactPoints::sample_of(Index row) const {
  return row < sample_count() ? row : parents_[static_cast<std::size_t>(row - sample_count())];
}

double ContactPoints::area(Index row) const {
  const double whole = 1.0 / static_cast<double>(sample_count());
  return row < coarse_ ? whole : 0.5 * whole;
}

Points ContactPoints::rest(const std::vector<Index>& rows) const { return rows_of(rest_, rows); }

Points ContactPoints::embedded(const std::vector<Index>& rows) const {
  return embedded_.rows() > 0 ? rows_of(embedded_, rows) : Points(0, 3);
}

Points ContactPoints::normals(const std::vector<Index>& samples) const {
  if (problem_.samples.normals.rows() != problem_.samples.size()) return Points::Zero(std::ssize(samples), 3);
  std::vector<Index> rows;
  for (const Index i : samples) rows.push_back(samples_[static_cast<std::size_t>(i)]);
  return unit_rows(rows_of(problem_.samples.normals, rows));
}

Points ContactPoints::embedded_at(PointsIn places) const {
  if (!problem_.basis.embedding) return Points(0, 3);
  Points result(places.rows(), 3);
  problem_.basis.embedding->evaluate(places, {result.data(), result.rows(), JetOrder::value});
  return result;
}

const std::vector<Index>& ContactPoints::neighbours(Index sample) {
  const Index n = sample_count();
  if (!grid_) {
    grid_ = std::make_unique<PointGrid>(rest_.topRows(n), 2.0 * finer_reach * spacing_);
    cells_ = grid_->cell_of_each();
  }
  std::vector<Index>& found = near_[static_cast<std::size_t>(sample)];
  if (!found.empty()) return found;
  const Points& normals = problem_.samples.normals;
  const bool faces = normals.rows() == problem_.samples.size();
  const auto normal = [&](Index i) { return normals.row(samples_[static_cast<std::size_t>(i)]); };
  const double square = 4.0 * finer_reach * finer_reach * spacing_ * spacing_;
  found.push_back(sample);
  grid_->near(cells_[static_cast<std::size_t>(sample)], [&](Index cell) {
    for (const Index i : grid_->rows(cell))
      if (i != sample && (rest_.row(i) - rest_.row(sample)).squaredNorm() < square &&
          (!faces || normal(i).dot(normal(sample)) > same_side))
        found.push_back(i);
  });
  return found;
}

/// The refined points of a sample, always the same.
const Points& ContactPoints::finer(Index sample) {
  const auto known = made_.find(sample);
  return known != made_.end() ? known->second : made_.emplace(sample, made_finer(sample)).first->second;
}

/// Points of a golden-angle spiral in the tangent plane within the sample's Voronoi cell, lifted to the
/// quadratic height field that fits its neighbours.
Points ContactPoints::made_finer(Index sample) {
  const Vec3 at = rest_.row(sample).transpose();
  const auto normal_at = [&](Index i) -> Vec3 {
    return problem_.samples.normals.row(samples_[static_cast<std::size_t>(i)]).transpose().normalized();
  };
  const Vec3 normal = normal_at(sample);
  const Vec3 first = normal.unitOrthogonal(), second = normal.cross(first);
  const std::vector<Index>& around = neighbours(sample);
  Mat3 gram = Mat3::Zero();
  Vec3 right = Vec3::Zero();
  RowMatrix<double> flat(static_cast<Index>(around.size()), 2);
  for (std::size_t k = 0; k < around.size(); ++k) {
    const Vec3 arm = rest_.row(around[k]).transpose() - at;
    const double a = arm.dot(first), b = arm.dot(second);
    flat.row(static_cast<Index>(k)) << a, b;
    const Vec3 terms(a * a, a * b, b * b);
    gram += terms * terms.transpose();
    right += arm.dot(normal) * terms;
  }
  Vec3 bend = Vec3::Zero();
  if (std::ssize(around) > least_fitted) {
    gram.diagonal().array() += 1e-3 * gram.trace();
    bend = solve_definite(gram, right);
  }
  std::vector<Index> sides;  // nearby samples beyond a sharp edge
  grid_->near(cells_[static_cast<std::size_t>(sample)], [&](Index cell) {
    for (const Index i : grid_->rows(cell))
      if ((rest_.row(i) - rest_.row(sample)).norm() < 2.0 * finer_reach * spacing_ &&
          normal.dot(normal_at(i)) <= same_side)
        sides.push_back(i);
  });
  const auto off_the_surface = [&](const Vec3& place) {  // beyond a sharp edge
    return std::any_of(sides.begin(), sides.end(), [&](Index i) {
      const Vec3 arm = place - rest_.row(i).transpose();
      return arm.norm() < finer_reach * spacing_ && arm.dot(normal_at(i)) > over_edge * spacing_;
    });
  };
  std::vector<Vec3> places;
  const double density = finer_density / (spacing_ * spacing_);
  const auto count = static_cast<int>(std::numbers::pi * finer_reach * finer_reach * finer_density);
  const double golden = std::numbers::pi * (3.0 - std::sqrt(5.0));
  for (int k = 1; k < count; ++k) {
    const double radius = std::sqrt(static_cast<double>(k) / (std::numbers::pi * density));
    const double a = radius * std::cos(golden * k), b = radius * std::sin(golden * k);
    bool nearest = true;
    for (Index j = 1; j < flat.rows() && nearest; ++j)
      nearest = (flat.row(j) - Eigen::RowVector2d(a, b)).squaredNorm() > radius * radius;
    const Vec3 place =
        at + a * first + b * second + (bend[0] * a * a + bend[1] * a * b + bend[2] * b * b) * normal;
    if (nearest && !off_the_surface(place)) places.push_back(place);
  }
  Points result(static_cast<Index>(places.size()), 3);
  for (std::size_t k = 0; k < places.size(); ++k) result.row(static_cast<Index>(k)) = places[k].transpose();
  return result;
}

void ContactPoints::refine(const std::vector<Index>& samples) {
  if (problem_.samples.normals.rows() != problem_.samples.size()) return;
  const Index known = rest_.rows();
  for (const Index sample : samples) {
    if (is_fine_[static_cast<std::size_t>(sample)] || size() - coarse_ > most_finer) continue;
    const Points& more = finer(sample);
    is_fine_[static_cast<std::size_t>(sample)] = true;
    const Index before = rest_.rows();
    rest_.conservativeResize(before + more.rows(), Eigen::NoChange);
    rest_.bottomRows(more.rows()) = more;
    parents_.insert(parents_.end(), static_cast<std::size_t>(more.rows()), sample);
    refined_.push_back(sample);
    ends_.push_back(rest_.rows());
  }
  if (rest_.rows() == known) return;
  ++finer_places_;
  const Points more = embedded_at(rest_.bottomRows(rest_.rows() - known));
  if (more.rows() == 0) return;
  embedded_.conservativeResize(rest_.rows(), Eigen::NoChange);
  embedded_.bottomRows(more.rows()) = more;
}

void ContactPoints::set_refined(const std::vector<Index>& samples) {
  const auto [end, other] = std::mismatch(refined_.begin(), refined_.end(), samples.begin(), samples.end());
  const std::ptrdiff_t kept = end - refined_.begin();
  if (end != refined_.end()) {
    const Index rows = kept > 0 ? ends_[static_cast<std::size_t>(kept) - 1] : coarse_;
    for (auto sample = end; sample != refined_.end(); ++sample)
      is_fine_[static_cast<std::size_t>(*sample)] = false;
    refined_.resize(static_cast<std::size_t>(kept));
    ends_.resize(static_cast<std::size_t>(kept));
    parents_.resize(static_cast<std::size_t>(rows - sample_count()));
    rest_.conservativeResize(rows, Eigen::NoChange);
    if (embedded_.rows() > 0) embedded_.conservativeResize(rows, Eigen::NoChange);
    places_.conservativeResize(std::min<Index>(places_.rows(), rows), Eigen::NoChange);
    ++finer_places_;
  }
  refine({samples.begin() + kept, samples.end()});
}

/// FNV-1a.
std::uint64_t ContactPoints::identity() const {
  std::uint64_t hash = 0xcbf29ce484222325u;
  const double* numbers = rest_.data();
  for (Index i = 0; i < 3 * coarse_; ++i)
    hash = (hash ^ std::bit_cast<std::uint64_t>(numbers[i])) * 0x100000001b3u;
  return hash;
}

const Points& ContactPoints::at(const RowMatrix<double>& coefficients) {
  const Index n = coarse_, all = size();
  if (!is_at(coefficients)) places_.resize(0, 3);
  coefficients_ = coefficients;
  const Index known = places_.rows();
  if (known == all) return places_;
  Points places(all, 3);
  places.topRows(known) = places_;
  const auto fill = [&](Dependent<RadialEvaluator<float>, 1>& made, Revision of, Index first, Index count) {
    const RadialEvaluator<float>& evaluator = made.get({of}, [&] {
      Points embedded;
      if (embedded_.rows() > 0) embedded = embedded_.middleRows(first, count);
      return RadialEvaluator<float>(problem_.basis, rest_.middleRows(first, count), JetOrder::value,
                                    embedded.rows() > 0 ? &embedded : nullptr);
    });
    PointsF values(count, 3);
    evaluator.evaluate(coefficients, {values.data(), count, JetOrder::value});
    places.middleRows(first, count) = values.cast<double>();
  };
  if (known < n) fill(evaluator_, 1, 0, n);
  if (all > n) fill(finer_, finer_places_, n, all - n);
  places_ = std::move(places);
  return places_;
}

Points ContactPoints::normals_at(const RowMatrix<double>& coefficients, const std::vector<Index>* blocks) {
  const RadialEvaluator<float>& evaluator = slopes_.get({1}, [&] {
    return RadialEvaluator<float>(problem_.basis, rest_.topRows(sample_count()), JetOrder::first);
  });
  JetBlock<float> jets(evaluator.size(), JetOrder::first);
  evaluator.evaluate(coefficients, jets.view(), blocks);
  Points normals = Points::Zero(evaluator.size(), 3);
  const auto turn = [&](Index i) {
    const Vec3 rest = problem_.samples.normals.row(samples_[static_cast<std::size_t>(i)]).transpose();
    normals.row(i) = area_vector(jacobian_at(std::as_const(jets).view(), i), rest).transpose();
  };
  const Index count = blocks != nullptr ? std::ssize(*blocks) : evaluator.blocks();
  for (Index k = 0; k < count; ++k) {
    const Index block = blocks != nullptr ? (*blocks)[static_cast<std::size_t>(k)] : k;
    const Index first = evaluator.block_size * block;
    for (Index i = first; i < std::min<Index>(first + evaluator.block_size, normals.rows()); ++i) turn(i);
  }
  return normals;
}

}  // namespace arapfields
