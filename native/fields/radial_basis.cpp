// SPDX-License-Identifier: GPL-3.0-or-later
#include "fields/radial_basis.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <string>

#include "core/errors.h"
#include "core/frame.h"
#include "fields/radial_kernel.h"

namespace arapfields {
namespace {

void validate(const InteriorEmbedding& given) {
  const Index nodes = given.nodes.rows();
  require(
      nodes > 0 && given.values.rows() == nodes && given.slopes.rows() == nodes && given.slopes.cols() == 9,
      "embedding",
      std::to_string(nodes) + " nodes, " + std::to_string(given.values.rows()) + " values, " +
          std::to_string(given.slopes.rows()) + " × " + std::to_string(given.slopes.cols()) + " slopes",
      "as many values and rows of 9 slopes as nodes are needed, one or more");
  require(given.nodes.allFinite() && given.values.allFinite() && given.slopes.allFinite(), "embedding",
          "NaN or infinity", "finite numbers are needed");
  require_positive("embedding.width", given.width);
  for (const EmbeddingPart& part : given.parts) {
    validate(part.embedding);
    validate(part.share);
    const Index own = part.embedding.nodes.rows();
    require(part.share.nodes.rows() == own && std::ssize(part.sides) == own && part.embedding.parts.empty(),
            "embedding.parts", std::to_string(std::ssize(part.sides)) + " sides",
            "one for each of the part's " + std::to_string(own) + " nodes is needed");
    require(part.ball.center.allFinite() && std::isfinite(part.ball.radius), "embedding.parts",
            "NaN or infinity", "finite numbers are needed");
  }
}

/// The point farthest from the mean, without outliers.
Index first_center(PointsIn points) {
  constexpr double far = 3.0;
  if ((points.rowwise() - points.row(0)).cwiseAbs().maxCoeff() == 0.0) return 0;
  const Frame frame = Frame::balanced(points, Vector::Ones(points.rows()), {}, 1.0);
  Vector squares = frame.to_cube(points).rowwise().squaredNorm();
  squares = (squares.array() > far * far).select(0.0, squares);
  Index first = 0;
  squares.maxCoeff(&first);
  return first;
}

}  // namespace

RowMatrix<double> RadialBasis::identity() const {
  RowMatrix<double> result = RowMatrix<double>::Zero(size(), 3);
  result.bottomRows<3>().setIdentity();
  return result;
}

void RadialBasis::set_embedding(std::shared_ptr<const InteriorEmbedding> other) {
  if (other) validate(*other);
  embedding = std::move(other);
  embedded.resize(embedding ? center_count() : 0, 3);
  if (embedding) embedding->evaluate(centers, {embedded.data(), center_count(), JetOrder::value});
}

FarthestPoints farthest_points(PointsIn points, Index count, const Vector& sizes, const Points& embedded) {
  require(points.rows() > 0 && points.allFinite(), "points", "none, or NaN or infinite ones",
          "finite points are needed");
  const Index n = points.rows(), stride = (n + 15) / 16 * 16;
  const int dimensions = embedded.rows() > 0 ? 6 : 3;
  const auto coordinate = [&](Index i, int k) { return k < 3 ? points(i, k) : embedded(i, k - 3); };
  std::vector<double> columns(dimensions * stride), distance(stride, 1e300), weights(stride, 1.0);
  for (Index i = 0; i < stride; ++i)
    for (int k = 0; k < dimensions; ++k) columns[k * stride + i] = coordinate(std::min(i, n - 1), k);
  for (Index i = 0; i < stride && sizes.size() > 0; ++i)
    weights[i] = 1.0 / (sizes[std::min(i, n - 1)] * sizes[std::min(i, n - 1)]);
  Index next = first_center(points);
  FarthestPoints result;
  while (static_cast<Index>(result.indices.size()) < count) {
    result.indices.push_back(next);
    std::array<double, 6> from{};
    for (int k = 0; k < dimensions; ++k) from[static_cast<std::size_t>(k)] = coordinate(next, k);
    const double worst = ARAPFIELDS_DISPATCH(
        farthest_update(columns.data(), dimensions, weights.data(), stride, from.data(), distance.data()));
    result.fill_distance = std::sqrt(worst);
    if (!(worst > 0.0)) break;
    next = std::min<Index>(std::find(distance.begin(), distance.end(), worst) - distance.begin(), n - 1);
  }
  return result;
}

RadialBasis radial_basis(PointsIn points, const std::vector<RadialScale>& scales,
                         const RadialLayout& layout) {
  require(!scales.empty(), "scales", "none were given", "at least one is needed");
  std::vector<Vec3> centers;
  std::vector<double> radii;
  for (const RadialScale& scale : scales) {
    require(scale.count > 0, "scales.count", std::to_string(scale.count), "must be positive");
    require(scale.radius_factor > 0.0 && std::isfinite(scale.radius_factor), "scales.radius_factor",
            std::to_string(scale.radius_factor), "must be positive");
    const bool two_layers = scale.two_layers && layout.inner.rows() == points.rows();
    const Index sites = two_layers ? (scale.count + 1) / 2 : scale.count;
    const FarthestPoints chosen = farthest_points(points, sites, layout.sizes, layout.embedded);
    const double extent = (points.colwise().maxCoeff() - points.colwise().minCoeff()).maxCoeff();
    // All points covered exactly (few points, or one): the radius falls back on the extent.
    const double fill = chosen.fill_distance > 0.0 ? chosen.fill_distance : std::max(extent, 1e-3);
    const auto add = [&](Index i, const Vec3& place) {
      centers.push_back(place);
      radii.push_back(scale.radius_factor * fill * (layout.sizes.size() > 0 ? layout.sizes[i] : 1.0));
    };
    for (const Index i : chosen.indices) add(i, points.row(i));
    const Index below =
        two_layers ? std::min<Index>(scale.count / 2, static_cast<Index>(chosen.indices.size())) : 0;
    for (Index k = 0; k < below; ++k) {
      const Index i = chosen.indices[k];
      add(i, layout.inner.row(i));
    }
  }
  const Index count = static_cast<Index>(centers.size());
  RadialBasis basis{Points(count, 3), Eigen::Map<const Vector>(radii.data(), count), nullptr, {}};
  for (Index m = 0; m < count; ++m) basis.centers.row(m) = centers[m].transpose();
  return basis;
}

}  // namespace arapfields
