// SPDX-License-Identifier: GPL-3.0-or-later
#include "energies/arap2d.h"

#include <cmath>

#include "core/errors.h"
#include "energies/kernels.h"
#include "energies/ranges.h"

namespace arapfields {
namespace {

template <class Scalar>
using Matrix2 = Eigen::Matrix<Scalar, 2, 2>;

/// cos θ and sin θ of the closest rotation, and t = tr(RᵀJ) ≥ 0.
template <class Scalar>
struct Polar2 {
  Scalar cosine, sine, sum;

  explicit Polar2(const Matrix2<Scalar>& j) {
    const Scalar c = j(0, 0) + j(1, 1), s = j(1, 0) - j(0, 1);
    sum = std::hypot(c, s);
    cosine = sum > Scalar(0) ? c / sum : Scalar(1);
    sine = sum > Scalar(0) ? s / sum : Scalar(0);
  }
  Matrix2<Scalar> rotation() const { return (Matrix2<Scalar>() << cosine, -sine, sine, cosine).finished(); }
  /// R E, the derivative of R by its angle.
  Matrix2<Scalar> turned() const { return (Matrix2<Scalar>() << -sine, -cosine, cosine, -sine).finished(); }
};

template <class Scalar>
Matrix2<Scalar> first_derivatives(JetView2<const Scalar> jets, Index p) {
  Matrix2<Scalar> j;
  for (int k = 0; k < 2; ++k)
    for (int i = 0; i < 2; ++i) j(i, k) = jets.at(1 + k, p)[i];
  return j;
}

/// D_k of point p.
template <class Scalar>
Matrix2<Scalar> second_derivatives(JetView2<const Scalar> jets, Index p, int k) {
  Matrix2<Scalar> d;
  for (int j = 0; j < 2; ++j)
    for (int i = 0; i < 2; ++i) d(i, j) = jets.at(second_column2(j, k), p)[i];
  return d;
}

template <class Scalar>
void add_point(JetView2<const Scalar> jets, Index p, Scalar stretch_weight, Scalar bend_weight,
               JetView2<Scalar> cotangents, double* sums) {
  const Matrix2<Scalar> jacobian = first_derivatives(jets, p);
  const Polar2<Scalar> polar(jacobian);
  const Matrix2<Scalar> rotation = polar.rotation(), turned = polar.turned();
  const bool ambiguous = !(polar.sum > Scalar(smallest_sum));
  const Scalar sum = ambiguous ? Scalar(smallest_sum) : polar.sum;
  sums[0] += static_cast<double>((jacobian - rotation).squaredNorm());

  Matrix2<Scalar> along = 2 * stretch_weight * (jacobian - rotation);
  for (int k = 0; k < 2; ++k) {
    const Matrix2<Scalar> d = second_derivatives(jets, p, k);
    const Scalar rate = d.cwiseProduct(turned).sum() / sum;  // ∂_k θ
    sums[1] += static_cast<double>(sum * rate * rate);
    if (cotangents.data == nullptr || bend_weight == Scalar(0)) continue;
    for (int j = 0; j < 2; ++j)
      for (int i = 0; i < 2; ++i)
        cotangents.at(second_column2(j, k), p)[i] += 2 * bend_weight * rate * turned(i, j);
    // J enters through the angle, dθ = ⟨R E, dJ⟩/t and d⟨D, R E⟩ = −⟨D, R⟩ dθ, and through dt = ⟨R, dJ⟩.
    along -= bend_weight * 2 * rate * d.cwiseProduct(rotation).sum() / sum * turned;
    if (!ambiguous) along -= bend_weight * rate * rate * rotation;
  }
  if (cotangents.data == nullptr) return;
  for (int k = 0; k < 2; ++k)
    for (int i = 0; i < 2; ++i) cotangents.at(1 + k, p)[i] += along(i, k);
}

}  // namespace

Mat2 closest_rotation2(const Mat2& jacobian) { return Polar2<double>(jacobian).rotation(); }

template <class Scalar>
ArapValue arap_energy2(JetView2<const Scalar> jets, double bending, double weight,
                       JetView2<Scalar> cotangents) {
  require(cotangents.data == nullptr || cotangents.count == jets.count, "cotangents",
          std::to_string(cotangents.count) + " points", "as many points as the jets have");
  if (jets.count == 0) return {};
  const double n = static_cast<double>(jets.count);
  const auto sums = sum_over_ranges<2>(jets.count, [&](Index begin, Index end, double* out) {
    for (Index p = begin; p < end; ++p)
      add_point(jets, p, static_cast<Scalar>(weight / n), static_cast<Scalar>(weight * bending / n),
                cotangents, out);
  });
  return {sums[0] / n, sums[1] / n};
}

template ArapValue arap_energy2<float>(JetView2<const float>, double, double, JetView2<float>);
template ArapValue arap_energy2<double>(JetView2<const double>, double, double, JetView2<double>);

}  // namespace arapfields
