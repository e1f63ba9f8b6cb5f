// SPDX-License-Identifier: GPL-3.0-or-later
#include "energies/gauss.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <string>

#include "core/decompositions.h"
#include "core/errors.h"
#include "core/smoothstep.h"
#include "energies/kernels.h"
#include "energies/ranges.h"

namespace arapfields {
namespace {

/// The paper's sharpness, which suits the cube, and the largest automatic one.
constexpr double cube_sharpness = 5.0, most_sharpness = 25.0;
/// Directions closer than 15° are facets of one curved face.
constexpr double one_face = 0.9659258262890683;

/// Cosines of 60° and 80°, between which a style's weight falls off.
constexpr double falloff_begin = 0.5, falloff_end = 0.17364817766693036;

Points different_normals(PointsIn normals) {
  const Points unit = unit_normals(normals);
  for (Index i = 0; i < unit.rows(); ++i)
    for (Index j = 0; j < i; ++j)
      require((unit.row(i) - unit.row(j)).norm() > 1e-6, "normals",
              "rows " + std::to_string(j) + " and " + std::to_string(i) + " have the same direction",
              "all directions must differ by more than 1e-6");
  return unit;
}

/// The solution of kernel·w = 1 from the eigenvectors above `cutoff`, refined twice.
Vector truncated_solution(const Eigen::MatrixXd& kernel, const SymmetricEigen<Vector, Eigen::MatrixXd>& eigen,
                          double cutoff) {
  const Vector& values = eigen.values;
  Vector inverse(values.size());
  for (Index i = 0; i < values.size(); ++i) inverse[i] = values[i] > cutoff ? 1.0 / values[i] : 0.0;
  Vector weights = Vector::Zero(values.size());
  for (int pass = 0; pass < 3; ++pass) {
    const Vector residual = Vector::Ones(values.size()) - kernel * weights;
    weights += eigen.vectors * (inverse.asDiagonal() * (eigen.vectors.transpose() * residual));
  }
  return weights;
}

/// The curved face to which each normal belongs, by number: neighbours within 15° share one.
std::vector<Index> faces_of(const Eigen::MatrixXd& cosines) {
  std::vector<Index> faces(cosines.rows(), -1), open;
  for (Index first = 0; first < cosines.rows(); ++first) {
    if (faces[first] >= 0) continue;
    for (open = {first}; !open.empty();) {
      const Index i = open.back();
      open.pop_back();
      faces[i] = first;
      for (Index j = 0; j < cosines.rows(); ++j)
        if (faces[j] < 0 && cosines(i, j) > one_face) open.push_back(j);
    }
  }
  return faces;
}

/// Mean angle from a direction to the nearest of unit normals, over the sphere (a Fibonacci lattice).
double mean_angle(const Points& unit) {
  constexpr int directions = 2000;
  double sum = 0.0;
  for (int i = 0; i < directions; ++i) {
    const double z = 1.0 - (2.0 * i + 1.0) / directions, radius = std::sqrt(1.0 - z * z);
    const double turn = 2.0 * std::numbers::pi * i / std::numbers::phi;
    const Vec3 direction(radius * std::cos(turn), radius * std::sin(turn), z);
    sum += std::acos(std::clamp((unit * direction).maxCoeff(), -1.0, 1.0));
  }
  return sum / directions;
}

/// mean_angle of the cube's normals.
double cube_angle() {
  static const double angle = mean_angle((Points(6, 3) << Mat3::Identity(), -Mat3::Identity()).finished());
  return angle;
}

}  // namespace

Points unit_normals(PointsIn normals) {
  require(normals.rows() > 0, "normals", "none were given", "at least one is needed");
  Points unit = normals;
  for (Index i = 0; i < unit.rows(); ++i) {
    const double length = unit.row(i).stableNorm();
    require(std::isfinite(length) && length > 0.0, "normals",
            "row " + std::to_string(i) + (length == 0.0 ? " is zero" : " is NaN or infinite"),
            "finite directions of any positive length are allowed");
    unit.row(i) /= length;
  }
  return unit;
}

double style_sharpness(PointsIn normals) {
  const Points unit = unit_normals(normals);
  const Eigen::MatrixXd cosines = product(unit, unit.transpose());
  const std::vector<Index> faces = faces_of(cosines);
  double nearest = -1.0;
  for (Index i = 0; i < unit.rows(); ++i)
    for (Index j = 0; j < i; ++j)
      if (faces[i] != faces[j]) nearest = std::max(nearest, cosines(i, j));
  const double midway = std::sqrt(0.5 + 0.5 * std::clamp(nearest, -1.0, 1.0));
  return std::clamp(cube_sharpness * (1.0 - std::sqrt(0.5)) / (1.0 - midway), cube_sharpness, most_sharpness);
}

double GaussPreference::value(const Vec3& normal) const {
  return (sharpness * (normals * normal)).array().exp().matrix().dot(weights);
}

Vector GaussPreference::values(PointsIn directions) const {
  Vector result(directions.rows());
  for_ranges(directions.rows(), [&](Index begin, Index end) {
    for (Index i = begin; i < end; ++i) result[i] = value(directions.row(i).transpose());
  });
  return result;
}

Vector GaussPreference::falloff(PointsIn directions) const {
  Vector result = Vector::Ones(directions.rows());
  if (!automatic) return result;
  for_ranges(directions.rows(), [&](Index begin, Index end) {
    for (Index i = begin; i < end; ++i) {
      result[i] = falloff_at((normals * directions.row(i).transpose()).maxCoeff());
    }
  });
  return result;
}

double falloff_at(double cosine) { return smoothstep(falloff_end, falloff_begin, cosine); }

void require_sharpness(double sharpness) {
  require(sharpness >= 0.0 && sharpness <= 100.0, "sharpness", std::to_string(sharpness),
          "0 (from the style) to 100 is allowed");
}

GaussPreference gauss_preference(PointsIn normals, double sharpness) {
  require_sharpness(sharpness);
  GaussPreference result{different_normals(normals), {}, sharpness};
  if (sharpness == 0.0) {
    result.sharpness = sharpness = style_sharpness(normals);
    result.automatic = true;
    result.balance = std::max(1.0, cube_angle() / mean_angle(result.normals));
  }
  // exp(σ(n·m − 1)): the same system with every weight scaled by e^σ, whose diagonal is 1.
  const Eigen::MatrixXd kernel =
      (sharpness * ((result.normals * result.normals.transpose()).array() - 1.0)).exp().matrix();
  const auto eigen = symmetric_eigen(kernel);
  const double largest = eigen.values.maxCoeff();
  double best = INFINITY;
  for (double cutoff = 1e-4 * largest; cutoff > 1e-17 * largest && best > 1e-12; cutoff *= 0.1) {
    const Vector weights = truncated_solution(kernel, eigen, cutoff);
    const double residual = (kernel * weights - Vector::Ones(weights.size())).cwiseAbs().maxCoeff();
    if (residual < best) {
      best = residual;
      result.weights = weights * std::exp(-sharpness);
    }
  }
  return result;
}

namespace {

template <class Scalar>
double normal_energy(GaussBlock<Scalar> block, JetView<const Scalar> jets, ConstPointsRef<Scalar> normals,
                     const Eigen::Ref<const Eigen::VectorX<Scalar>>& sample_weights, double weight,
                     JetView<Scalar> cotangents) {
  require(jets.order != JetOrder::value, "jets", "values alone", "first derivatives are needed");
  require(normals.rows() == jets.count, "normals", std::to_string(normals.rows()) + " rows",
          "one for each of the " + std::to_string(jets.count) + " samples is needed");
  require(sample_weights.size() == 0 || sample_weights.size() == jets.count, "sample_weights",
          std::to_string(sample_weights.size()) + " numbers", "one for each sample, or none, is needed");
  require(
      cotangents.data == nullptr || (cotangents.count == jets.count && cotangents.order != JetOrder::value),
      "cotangents", "another shape than the jets'", "as many points and first derivatives are needed");
  if (jets.count == 0) return 0.0;
  block.jets = jets.data;
  block.cotangents = cotangents.data;
  block.count = jets.count;
  block.normals = normals.data();
  block.sample_weights = sample_weights.size() == 0 ? nullptr : sample_weights.data();
  block.weight = static_cast<Scalar>(weight / static_cast<double>(jets.count));
  const auto sums = sum_over_ranges<1>(jets.count, [&](Index begin, Index end, double* out) {
    out[0] += ARAPFIELDS_DISPATCH(gauss_range(block, begin, end));
  });
  return sums[0] / static_cast<double>(jets.count);
}

}  // namespace

template <class Scalar>
double target_energy(JetView<const Scalar> jets, ConstPointsRef<Scalar> normals,
                     ConstPointsRef<Scalar> targets,
                     const Eigen::Ref<const Eigen::VectorX<Scalar>>& sample_weights, double weight,
                     JetView<Scalar> cotangents) {
  require(targets.rows() == jets.count, "targets", std::to_string(targets.rows()) + " rows",
          "one for each of the " + std::to_string(jets.count) + " samples is needed");
  GaussBlock<Scalar> block{};
  block.targets = targets.data();
  block.sharpness = Scalar(2);
  return normal_energy<Scalar>(block, jets, normals, sample_weights, weight, cotangents);
}

template <class Scalar>
double gauss_energy(JetView<const Scalar> jets, ConstPointsRef<Scalar> normals,
                    const Eigen::Ref<const Eigen::VectorX<Scalar>>& sample_weights,
                    const GaussPreference& preference, double weight, JetView<Scalar> cotangents) {
  RowMatrix<Scalar> preferred(preference.normals.rows(), 4);
  preferred << preference.normals.cast<Scalar>(), preference.weights.cast<Scalar>();
  GaussBlock<Scalar> block{};
  block.preferred = preferred.data();
  block.preferred_count = preferred.rows();
  block.sharpness = static_cast<Scalar>(preference.sharpness);
  return normal_energy<Scalar>(block, jets, normals, sample_weights, weight, cotangents);
}

#define ARAPFIELDS_GAUSS(Scalar)                                                        \
  template double target_energy<Scalar>(                                                \
      JetView<const Scalar>, ConstPointsRef<Scalar>, ConstPointsRef<Scalar>,            \
      const Eigen::Ref<const Eigen::VectorX<Scalar>>&, double, JetView<Scalar>);        \
  template double gauss_energy<Scalar>(JetView<const Scalar>, ConstPointsRef<Scalar>,   \
                                       const Eigen::Ref<const Eigen::VectorX<Scalar>>&, \
                                       const GaussPreference&, double, JetView<Scalar>);
ARAPFIELDS_GAUSS(float)
ARAPFIELDS_GAUSS(double)

}  // namespace arapfields
