// SPDX-License-Identifier: GPL-3.0-or-later
#include "solve/radial/part_links.h"

#include <algorithm>
#include <cmath>

#include "fields/radial_evaluator.h"
#include "sampling/nearest_sample.h"
#include "sampling/sample_choice.h"

namespace arapfields {
namespace {

/// Weight of a link's energy against the surface's: small, but resolved in single precision.
constexpr double link_weight = 3e-4;

}  // namespace

PartLinks::PartLinks(const RadialProblem& problem, Points held) {
  const RestShape& shape = *problem.shape;
  if (*std::max_element(shape.parts.begin(), shape.parts.end()) == 0) return;
  if (problem.mirror) held.col(problem.mirror->axis) = held.col(problem.mirror->axis).cwiseAbs().eval();
  std::vector<Index> free, parts, joined;
  Vector share = Vector::Ones(shape.sites.rows());
  if (problem.blend) problem.blend->free_weight(shape.sites, JetOrder::value, share.data());
  for (const std::int32_t site : nearest_samples(shape.sites).closest(held).triangles)
    joined.push_back(shape.parts[static_cast<std::size_t>(site)]);
  for (Index i = 0; i < share.size(); ++i) {
    const Index part = shape.parts[static_cast<std::size_t>(i)];
    if (share[i] < 1.0)
      joined.push_back(part);
    else
      free.push_back(i), parts.push_back(part);
  }
  const Points sites = rows_of(shape.sites, free);
  std::vector<Index> firsts, seconds;
  for (const auto& [first, second] : spanning_links(sites, parts, joined))
    firsts.push_back(first), seconds.push_back(second);
  from_ = rows_of(sites, firsts);
  to_ = rows_of(sites, seconds);
  rows_ = values(radial_rows(problem.basis, from_, JetOrder::first),
                 radial_rows(problem.basis, to_, JetOrder::first));
}

RowMatrix<double> PartLinks::values(const RowMatrix<double>& at_from, const RowMatrix<double>& at_to) const {
  const Index count = from_.rows();
  RowMatrix<double> result = at_to - at_from;
  for (Index i = 0; i < count; ++i) {
    const Vec3 link = (to_.row(i) - from_.row(i)).transpose();
    for (int k = 0; k < 3; ++k) result.row(i) -= link[k] * at_from.row(first_column(k) * count + i);
    result.row(i) /= link.norm();
  }
  return std::sqrt(link_weight) * result;
}

}  // namespace arapfields
