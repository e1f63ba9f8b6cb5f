// SPDX-License-Identifier: GPL-3.0-or-later
#include "solve/contact/points.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <numbers>

#include "core/decompositions.h"
#include "core/jets.h"
#include "core/random.h"
#include "core/types.h"
#include "sampling/oriented_points.h"
#include "sampling/sample_choice.h"
#include "sampling/standing_out.h"
#include "solve/contact/parameters.h"

namespace arapfields {
namespace {

using P = ContactParameters;

/// Rows of two arrays, the second after the first.
Points rows_of_both(const Points& first, const Points& second, const std::vector<Index>& rows) {
  Points result(std::ssize(rows), 3);
  for (Index i = 0; i < result.rows(); ++i) {
    const Index row = rows[static_cast<std::size_t>(i)];
    result.row(i) = row < first.rows() ? first.row(row) : second.row(row - first.rows());
  }
  return result;
}

}  // namespace

FollowedPlaces::FollowedPlaces(const SurfaceSamples& surface, const std::vector<std::uint32_t>& order,
                               std::uint64_t seed, const Progress& progress) {
  Random random(seed, P::sample_stream);
  samples = stratified(order, std::min(P::most_samples, surface.size()), random);
  rest = rows_of(surface.points, samples);
  const PointGrid coarse(rest, P::area_cell);  // a cell holds about area_cell² of the surface
  spacing = P::area_cell * std::sqrt(static_cast<double>(coarse.size()) / static_cast<double>(rest.rows()));
  if (!surface.mesh) return;
  Points normals = Points::Zero(rest.rows(), 3);
  if (surface.normals.rows() == surface.size()) normals = unit_rows(rows_of(surface.normals, samples));
  const Points vertices =
      surface.frame.to_cube(used_vertices(surface.mesh->vertices, surface.mesh->triangles));
  const Points found = rows_of(
      vertices, standing_out(vertices, rest, normals, spacing, P::stands_out, P::most_vertices, progress));
  const Points alike = Points::Zero(std::max(rest.rows(), found.rows()), 3);
  parents = OrientedPoints(rest, alike.topRows(rest.rows())).nearest(found, alike.topRows(found.rows()), 0.0);
  rest.conservativeResize(rest.rows() + found.rows(), Eigen::NoChange);
  rest.bottomRows(found.rows()) = found;
}

void ContactPoints::choose(const Progress& progress) {
  if (!samples_.empty()) return;
  const auto followed = problem_.shape->followed(problem_.samples, progress);
  samples_ = followed->samples;
  parents_ = followed->parents;
  rest_ = followed->rest;
  spacing_ = followed->spacing;
  near_.resize(samples_.size());
  embedded_ = embedded_at(rest_);
}

Index ContactPoints::sample_of(Index row, const RefinedPoints& refined) const {
  if (row < sample_count()) return row;
  return row < coarse_count() ? parents_[static_cast<std::size_t>(row - sample_count())]
                              : refined.parents[static_cast<std::size_t>(row - coarse_count())];
}

double ContactPoints::area(Index row) const {
  const double whole = 1.0 / static_cast<double>(sample_count());
  return row < coarse_count() ? whole : 0.5 * whole;
}

Points ContactPoints::rest(const std::vector<Index>& rows, const RefinedPoints& refined) const {
  return rows_of_both(rest_, refined.rest, rows);
}

Points ContactPoints::embedded(const std::vector<Index>& rows, const RefinedPoints& refined) const {
  return embedded_.rows() > 0 ? rows_of_both(embedded_, refined.embedded, rows) : Points(0, 3);
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
    grid_ = std::make_unique<PointGrid>(rest_.topRows(n), 2.0 * P::refined_reach * spacing_);
    cells_ = grid_->cell_of_each();
  }
  std::vector<Index>& found = near_[static_cast<std::size_t>(sample)];
  if (!found.empty()) return found;
  const Points& normals = problem_.samples.normals;
  const bool faces = normals.rows() == problem_.samples.size();
  const auto normal = [&](Index i) { return normals.row(samples_[static_cast<std::size_t>(i)]); };
  const double square = 4.0 * P::refined_reach * P::refined_reach * spacing_ * spacing_;
  found.push_back(sample);
  grid_->near(cells_[static_cast<std::size_t>(sample)], [&](Index cell) {
    for (const Index i : grid_->rows(cell))
      if (i != sample && (rest_.row(i) - rest_.row(sample)).squaredNorm() < square &&
          (!faces || normal(i).dot(normal(sample)) > P::neighbour_cosine))
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
  if (std::ssize(around) > P::least_fitted) {
    gram.diagonal().array() += P::fit_ridge * gram.trace();
    bend = solve_definite(gram, right);
  }
  std::vector<Index> sides;  // nearby samples beyond a sharp edge
  grid_->near(cells_[static_cast<std::size_t>(sample)], [&](Index cell) {
    for (const Index i : grid_->rows(cell))
      if ((rest_.row(i) - rest_.row(sample)).norm() < 2.0 * P::refined_reach * spacing_ &&
          normal.dot(normal_at(i)) <= P::neighbour_cosine)
        sides.push_back(i);
  });
  const auto off_the_surface = [&](const Vec3& place) {  // beyond a sharp edge
    return std::any_of(sides.begin(), sides.end(), [&](Index i) {
      const Vec3 arm = place - rest_.row(i).transpose();
      return arm.norm() < P::refined_reach * spacing_ && arm.dot(normal_at(i)) > P::beyond_edge * spacing_;
    });
  };
  std::vector<Vec3> places;
  const double density = P::refined_density / (spacing_ * spacing_);
  const auto count =
      static_cast<int>(std::numbers::pi * P::refined_reach * P::refined_reach * P::refined_density);
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

ContactPoints::Refined ContactPoints::refine(const Refined& refined, const std::vector<Index>& samples) {
  if (problem_.samples.normals.rows() != problem_.samples.size()) return refined;
  RefinedPoints result = *refined;
  for (const Index sample : samples) {
    if (result.rest.rows() > P::most_refined) break;
    if (std::find(result.samples.begin(), result.samples.end(), sample) != result.samples.end()) continue;
    const Points& more = finer(sample);
    result.samples.push_back(sample);
    result.rest.conservativeResize(result.rest.rows() + more.rows(), Eigen::NoChange);
    result.rest.bottomRows(more.rows()) = more;
    result.parents.insert(result.parents.end(), static_cast<std::size_t>(more.rows()), sample);
  }
  if (result.samples.size() == refined->samples.size()) return refined;
  const Index known = refined->rest.rows(), count = result.rest.rows();
  if (const Points more = embedded_at(result.rest.bottomRows(count - known)); more.rows() > 0) {
    result.embedded.conservativeResize(count, Eigen::NoChange);
    result.embedded.bottomRows(more.rows()) = more;
  }
  result.revision = ++refinements_;
  return std::make_shared<const RefinedPoints>(std::move(result));
}

/// FNV-1a.
std::uint64_t ContactPoints::identity() const {
  std::uint64_t hash = 0xcbf29ce484222325u;
  const double* numbers = rest_.data();
  for (Index i = 0; i < rest_.size(); ++i)
    hash = (hash ^ std::bit_cast<std::uint64_t>(numbers[i])) * 0x100000001b3u;
  return hash;
}

Points ContactPoints::at(const RowMatrix<double>& coefficients, const RefinedPoints& refined) {
  const auto moved = [&](Dependent<RadialEvaluator<float>, 1>& made, Revision of, const Points& rest,
                         const Points& embedded) -> Points {
    const RadialEvaluator<float>& evaluator = made.get({of}, [&] {
      return RadialEvaluator<float>(problem_.basis, rest, JetOrder::value,
                                    embedded.rows() > 0 ? &embedded : nullptr);
    });
    PointsF values(rest.rows(), 3);
    evaluator.evaluate(coefficients, {values.data(), values.rows(), JetOrder::value});
    return values.cast<double>();
  };
  if (places_.rows() == 0 || !is_at(coefficients)) places_ = moved(evaluator_, 1, rest_, embedded_);
  coefficients_ = coefficients;
  Points places(size(refined), 3);
  places.topRows(coarse_count()) = places_;
  if (refined.rest.rows() > 0)
    places.bottomRows(refined.rest.rows()) = moved(finer_, refined.revision, refined.rest, refined.embedded);
  return places;
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
