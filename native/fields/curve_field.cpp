// SPDX-License-Identifier: GPL-3.0-or-later
#include "fields/curve_field.h"

#include <cmath>
#include <vector>

#include "core/errors.h"
#include "core/parallel.h"
#include "tensors/dense.h"

namespace arapfields {
namespace {

/// Nodes of the grid over the points' bounding box and `margin` cells around it that are within `most_cells`
/// cells of a point.
std::vector<Vec2> grid_nodes(Points2In points, double spacing, double margin, double most_cells) {
  const Vec2 low = points.colwise().minCoeff().transpose(), high = points.colwise().maxCoeff().transpose();
  const Vec2 middle = 0.5 * (low + high);
  const auto steps = [&](int axis) {
    return static_cast<Index>(std::ceil(0.5 * (high - low)(axis) / spacing + margin));
  };
  std::vector<Vec2> nodes;
  for (Index i = -steps(0); i <= steps(0); ++i)
    for (Index j = -steps(1); j <= steps(1); ++j) {
      const Vec2 node = middle + spacing * Vec2(static_cast<double>(i), static_cast<double>(j));
      const double nearest = (points.rowwise() - node.transpose()).rowwise().squaredNorm().minCoeff();
      if (nearest <= most_cells * most_cells * spacing * spacing) nodes.push_back(node);
    }
  return nodes;
}

}  // namespace

RowMatrix<double> CurveBasis::rows(Points2In points) const {
  const Index n = points.rows(), m = centers.rows();
  RowMatrix<double> result = RowMatrix<double>::Zero(columns2 * n, size());
  parallel_for(0, n, 64, [&](Index begin, Index end) {
    for (Index p = begin; p < end; ++p) {
      for (Index b = 0; b < m; ++b) {
        const Vec2 d = (points.row(p) - centers.row(b)).transpose();
        const double inverse = 1.0 / (radii(b) * radii(b));
        const double bump = std::exp(-d.squaredNorm() * inverse);
        result(p, b) = bump;
        for (int j = 0; j < 2; ++j) result((1 + j) * n + p, b) = -2 * inverse * d(j) * bump;
        for (int j = 0; j < 2; ++j)
          result((3 + j) * n + p, b) = (4 * inverse * inverse * d(j) * d(j) - 2 * inverse) * bump;
        result(5 * n + p, b) = 4 * inverse * inverse * d(0) * d(1) * bump;
      }
      result(p, m) = 1.0;
      for (int j = 0; j < 2; ++j) {
        result(p, m + 1 + j) = points(p, j);
        result((1 + j) * n + p, m + 1 + j) = 1.0;
      }
    }
  });
  return result;
}

CurveBasis curve_basis(Points2In points, double spacing) {
  const std::vector<Vec2> fine = grid_nodes(points, spacing, 1.0, 1.5);
  const std::vector<Vec2> coarse = grid_nodes(points, 3 * spacing, 1.0, 1e3);
  CurveBasis basis{Points2(static_cast<Index>(fine.size() + coarse.size()), 2),
                   Vector(static_cast<Index>(fine.size() + coarse.size()))};
  Index row = 0;
  const auto append = [&](const std::vector<Vec2>& nodes, double radius) {
    for (const Vec2& node : nodes) {
      basis.centers.row(row) = node;
      basis.radii(row++) = radius;
    }
  };
  append(fine, 2 * spacing);
  append(coarse, 6 * spacing);
  return basis;
}

CurveField CurveField::around(Points2In points, double spacing) {
  require(points.rows() > 0, "points", "none", "a curve needs samples");
  require(points.allFinite(), "points", "some are NaN or infinite", "all must be finite");
  const Vec2 low = points.colwise().minCoeff().transpose(), high = points.colwise().maxCoeff().transpose();
  CurveField field;
  field.center = 0.5 * (low + high);
  field.scale = 0.5 * (high - low).maxCoeff() / 0.75;
  require(field.scale > 0 && std::isfinite(field.scale), "points", "all are the same point",
          "a curve has an extent");
  field.basis = curve_basis(field.to_square(points), spacing);
  field.coefficients = RowMatrix<double>::Zero(field.basis.size(), 2);
  field.coefficients.bottomRows<2>().setIdentity();
  return field;
}

RowMatrix<double> CurveField::jets(Points2In points) const {
  const RowMatrix<double> rows = basis.rows(to_square(points));
  RowMatrix<double> result(rows.rows(), 2);
  gemm<double>(Transpose::no, Transpose::no, 1.0, rows, coefficients, 0.0, result);
  return result;
}

Points2 CurveField::operator()(Points2In points) const {
  Points2 result(points.rows(), 2);
  constexpr Index chunk = 4096;
  for (Index begin = 0; begin < points.rows(); begin += chunk) {
    const Index count = std::min<Index>(chunk, points.rows() - begin);
    result.middleRows(begin, count) = jets(points.middleRows(begin, count)).topRows(count);
  }
  return (result * scale).rowwise() + center.transpose();
}

}  // namespace arapfields
