// SPDX-License-Identifier: GPL-3.0-or-later
#include "solve/radial/contact_stiffness.h"

#include <algorithm>

#include "tensors/dense.h"

namespace arapfields {
namespace {

/// Most springs of the update: the basis functions resolve no more.
constexpr Index most_planes = 240;

}  // namespace

ContactStiffness::ContactStiffness(const RadialBasis& basis, const ContactSet& set, PointsIn places,
                                   const TallMatrix<float>& inverse_factor) {
  struct Spring {
    const ContactPlane* plane;
    Vec3 along;
    double stiffness;  // times the area fraction
  };
  std::vector<Spring> springs;
  for (const ContactPlane& plane : set.planes) {
    if (plane.updated_pressure(plane.gap(places.data()), set.stiffness) <= 0.0) continue;
    springs.push_back({&plane, plane.normal, set.stiffness * plane.area});
    if (plane.friction <= 0.0) continue;
    const Vec3 first = plane.normal.unitOrthogonal();
    for (const Vec3& along : {first, Vec3(plane.normal.cross(first))})
      springs.push_back(
          {&plane, along, plane.friction / std::max(stuck, plane.slip(places.data()).norm()) * plane.area});
  }
  const Index all = std::ssize(springs), count = std::min<Index>(all, most_planes);
  if (count == 0) return;
  std::vector<const ContactPlane*> planes;
  RowMatrix<double> along(count, 3);
  Vector softness(count);
  for (Index i = 0; i < count; ++i) {
    const Spring& spring = springs[static_cast<std::size_t>(i * all / count)];
    planes.push_back(spring.plane);
    along.row(i) = spring.along.transpose();
    softness[i] = 2.0 * static_cast<double>(count) / (static_cast<double>(all) * spring.stiffness);
  }
  rows_.add(basis, set, planes, along, inverse_factor);
  RowMatrix<double> matrix = rows_.compliance();
  matrix.diagonal() += softness;
  factor_ = cholesky<double>(matrix);
}

void ContactStiffness::apply(PointsF& y) const {
  if (rows_.size() == 0) return;
  Vector pull = factor_.triangularView<Eigen::Lower>().solve(rows_.along(y));
  pull = factor_.transpose().triangularView<Eigen::Upper>().solve(pull);
  y -= rows_.pull(pull);
}

}  // namespace arapfields
