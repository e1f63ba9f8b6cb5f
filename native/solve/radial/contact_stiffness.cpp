// SPDX-License-Identifier: GPL-3.0-or-later
#include "solve/radial/contact_stiffness.h"

#include <algorithm>

#include "fields/radial_evaluator.h"
#include "sampling/sample_choice.h"
#include "tensors/dense.h"

namespace arapfields {
namespace {

/// Planes that stand for all: more would tell apart what no basis function does.
constexpr Index most_planes = 240;

}  // namespace

ContactStiffness::ContactStiffness(const RadialBasis& basis, const ContactSet& set, PointsIn places,
                                   const TallMatrix<float>& inverse_factor) {
  struct Spring {
    const ContactPlane* plane;
    Vec3 along;
    double stiffness;  // times the share
  };
  std::vector<Spring> springs;
  for (const ContactPlane& plane : set.planes) {
    if (plane.pressed(plane.gap(places.data()), set.stiffness) <= 0.0) continue;
    springs.push_back({&plane, plane.normal, set.stiffness * plane.share});
    if (plane.grip <= 0.0) continue;
    const Vec3 first = plane.normal.unitOrthogonal();
    for (const Vec3& along : {first, Vec3(plane.normal.cross(first))})
      springs.push_back(
          {&plane, along, plane.grip / std::max(stuck, plane.slip(places.data()).norm()) * plane.share});
  }
  const Index all = std::ssize(springs), count = std::min<Index>(all, most_planes);
  if (count == 0) return;
  std::vector<Index> first(static_cast<std::size_t>(count));
  normals_.resize(count, 3);
  Vector softness(count);
  const auto pick = [&](Index i) -> const Spring& {
    return springs[static_cast<std::size_t>(i * all / count)];
  };
  for (Index i = 0; i < count; ++i) {
    first[static_cast<std::size_t>(i)] = pick(i).plane->first;
    normals_.row(i) = pick(i).along.transpose();
    softness[i] = 2.0 * static_cast<double>(count) / (static_cast<double>(all) * pick(i).stiffness);
  }
  RowMatrix<double> values = radial_rows(basis, rows_of(set.places, first), JetOrder::value);
  std::vector<Index> carrying, carriers;
  for (Index i = 0; i < count; ++i)
    if (pick(i).plane->second >= 0) carrying.push_back(i), carriers.push_back(pick(i).plane->second);
  if (!carriers.empty())
    values(carrying, Eigen::all) -= radial_rows(basis, rows_of(set.places, carriers), JetOrder::value);
  rows_.resize(count, basis.size());
  for (Index i = 0; i < count; i += 3) {
    const Index some = std::min<Index>(3, count - i);
    PointsF columns = PointsF::Zero(basis.size(), 3);
    columns.leftCols(some) = values.middleRows(i, some).transpose().cast<float>();
    rows_.middleRows(i, some) = inverse_factor.times(columns).leftCols(some).transpose();
  }
  RowMatrix<float> products(count, count);
  lower_gram<float>(Transpose::no, rows_, 0.0f, products);
  RowMatrix<double> matrix = products.cast<double>().cwiseProduct(normals_ * normals_.transpose());
  matrix.diagonal() += softness;
  factor_ = cholesky<double>(matrix);
}

void ContactStiffness::apply(PointsF& y) const {
  if (rows_.rows() == 0) return;
  const PointsF along = rows_ * y;
  Vector pull = along.cast<double>().cwiseProduct(normals_).rowwise().sum();
  pull = factor_.triangularView<Eigen::Lower>().solve(pull);
  pull = factor_.transpose().triangularView<Eigen::Upper>().solve(pull);
  y -= rows_.transpose() * (pull.asDiagonal() * normals_).cast<float>();
}

}  // namespace arapfields
