// SPDX-License-Identifier: GPL-3.0-or-later
#include "fields/radial_basis.h"

#include <algorithm>
#include <cmath>
#include <string>

#include "core/errors.h"
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

FarthestPoints farthest_points(PointsIn points, Index count) {
  require(points.rows() > 0 && points.allFinite(), "points", "none, or NaN or infinite ones",
          "finite points are needed");
  const Index n = points.rows(), stride = (n + 15) / 16 * 16;
  std::vector<double> columns(static_cast<std::size_t>(3 * stride)),
      distance(static_cast<std::size_t>(stride), 1e300);
  for (Index i = 0; i < stride; ++i)
    for (int k = 0; k < 3; ++k)
      columns[static_cast<std::size_t>(k * stride + i)] = points(std::min(i, n - 1), k);
  const Eigen::RowVector3d middle = points.colwise().mean();
  Index next = 0;
  (points.rowwise() - middle).rowwise().squaredNorm().maxCoeff(&next);
  FarthestPoints result;
  while (static_cast<Index>(result.indices.size()) < count) {
    result.indices.push_back(next);
    const Vec3 from = points.row(next);
    const double worst =
        ARAPFIELDS_DISPATCH(farthest_update(columns.data(), stride, stride, from.data(), distance.data()));
    result.fill_distance = std::sqrt(worst);
    if (!(worst > 0.0)) break;
    next = std::min<Index>(std::find(distance.begin(), distance.end(), worst) - distance.begin(), n - 1);
  }
  return result;
}

RadialBasis radial_basis(PointsIn points, const std::vector<RadialScale>& scales) {
  require(!scales.empty(), "scales", "none were given", "at least one is needed");
  std::vector<Index> centers;
  std::vector<double> radii;
  for (const RadialScale& scale : scales) {
    require(scale.count > 0, "scales.count", std::to_string(scale.count), "must be positive");
    require(scale.radius_factor > 0.0 && std::isfinite(scale.radius_factor), "scales.radius_factor",
            std::to_string(scale.radius_factor), "must be positive");
    const FarthestPoints chosen = farthest_points(points, scale.count);
    const double extent = (points.colwise().maxCoeff() - points.colwise().minCoeff()).maxCoeff();
    // All points covered exactly (few points, or one): the radius falls back on the extent.
    const double fill = chosen.fill_distance > 0.0 ? chosen.fill_distance : std::max(extent, 1e-3);
    centers.insert(centers.end(), chosen.indices.begin(), chosen.indices.end());
    radii.insert(radii.end(), chosen.indices.size(), scale.radius_factor * fill);
  }
  RadialBasis basis{Points(static_cast<Index>(centers.size()), 3),
                    Eigen::Map<const Vector>(radii.data(), static_cast<Index>(radii.size())),
                    nullptr,
                    {}};
  for (std::size_t m = 0; m < centers.size(); ++m)
    basis.centers.row(static_cast<Index>(m)) = points.row(centers[m]);
  return basis;
}

}  // namespace arapfields
