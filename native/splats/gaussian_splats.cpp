// SPDX-License-Identifier: GPL-3.0-or-later
#include "splats/gaussian_splats.h"

#include <Eigen/Geometry>
#include <Eigen/LU>
#include <numeric>
#include <vector>

#include "core/errors.h"
#include "core/parallel.h"
#include "splats/turn_kernel.h"

namespace arapfields {
namespace {

constexpr float largest_log_scale = 80.0f;  // e^80 is still a finite float
constexpr float unit_tolerance = 1e-3f;     // of a quaternion's length

template <class Matrix>
void append_rows(Matrix& matrix, const std::vector<Index>& rows) {
  const Index before = matrix.rows();
  matrix.conservativeResize(before + static_cast<Index>(rows.size()), matrix.cols());
  for (std::size_t k = 0; k < rows.size(); ++k)
    matrix.row(before + static_cast<Index>(k)) = matrix.row(rows[k]).eval();
}

}  // namespace

GaussianSplats GaussianSplats::copies(const std::vector<Index>& rows) const {
  GaussianSplats result;
  result.centers = centers(rows, Eigen::all);
  result.rotations = rotations(rows, Eigen::all);
  result.log_scales = log_scales(rows, Eigen::all);
  result.opacity_logits = opacity_logits(rows);
  result.harmonics = harmonics(rows, Eigen::all);
  result.other_properties = other_properties;
  result.other_values = other_values(rows, Eigen::all);
  return result;
}

void GaussianSplats::be_places_of(const GaussianSplats& other) {
  centers.resize(other.size(), 3);
  rotations.resize(other.size(), 4);
  log_scales.resize(other.size(), 3);
  opacity_logits = other.opacity_logits;
  harmonics.resize(other.size(), other.harmonics.cols());
  other_properties = other.other_properties;
  other_values = other.other_values;
}

void GaussianSplats::append_copies(const std::vector<Index>& rows) {
  append_rows(centers, rows);
  append_rows(rotations, rows);
  append_rows(log_scales, rows);
  append_rows(opacity_logits, rows);
  append_rows(harmonics, rows);
  append_rows(other_values, rows);
}

void GaussianSplats::validate() const {
  const auto check = [&](const char* name, Index rows, bool finite) {
    require(rows == size(), name, std::to_string(rows) + " rows", "one for each center is needed");
    require(finite, name, "NaN or infinity", "all must be finite");
  };
  check("centers", size(), centers.allFinite());
  check("rotations", rotations.rows(), rotations.allFinite());
  check("scales", log_scales.rows(), log_scales.allFinite());
  check("opacities", opacity_logits.rows(), true);
  require(!opacity_logits.hasNaN(), "opacities", "NaN", "numbers are needed");
  check("harmonics", harmonics.rows(), harmonics.allFinite());
  check("other_values", other_values.rows(), true);
  require(rotations.cols() == 4, "rotations", "another shape", "(n, 4) quaternions are needed");
  const Index bands = harmonics.cols();
  require(bands == 3 || bands == 12 || bands == 27 || bands == 48, "harmonics", "another shape",
          "(n, k, 3) with k = 1, 4, 9 or 16 is needed");
  require(size() == 0 || log_scales.maxCoeff() <= largest_log_scale, "scales", "too large",
          "e^80 at most are allowed");
  require(((rotations.rowwise().norm().array() - 1.0f).abs() < unit_tolerance).all(), "rotations",
          "a quaternion is not of length 1", "unit quaternions are needed");
}

Mat3 axes_of(const Eigen::Ref<const Eigen::RowVector4f>& rotation) {
  const Eigen::Vector4d q = rotation.cast<double>().transpose();
  return Eigen::Quaterniond(q[0], q[1], q[2], q[3]).normalized().toRotationMatrix();
}

namespace {

constexpr Index splats_at_a_time = 1 << 15;  // splats between two looks at the task

/// Jets' first derivatives of `count` places, all those of A.
PointsOf<double> derivatives(const Mat3& linear, Index count) {
  PointsOf<double> result(3 * count, 3);
  for (int k = 0; k < 3; ++k)
    result.middleRows(k * count, count).rowwise() = linear.col(k).transpose().eval();
  return result;
}

}  // namespace

GaussianSplats transform_splats(const GaussianSplats& splats, const Mat4& matrix, const Progress& progress) {
  splats.validate();
  require(matrix.allFinite(), "matrix", "NaN or infinity", "all must be finite");
  require(matrix.row(3) == Eigen::RowVector4d(0.0, 0.0, 0.0, 1.0), "matrix", "another last row",
          "(0, 0, 0, 1) is needed");
  const Mat3 linear = matrix.topLeftCorner<3, 3>();
  require(linear.determinant() > 0.0, "matrix", "it mirrors or flattens", "a determinant above 0 is needed");
  GaussianSplats moved;
  moved.be_places_of(splats);
  const Index most = std::min(splats_at_a_time, splats.size());
  const PointsOf<double> jacobians = derivatives(linear, most);
  std::vector<Index> rows(static_cast<std::size_t>(most));
  PointsOf<double> stretches(most, 3);
  for (Index first = 0; first < splats.size(); first += most) {
    progress.report(static_cast<double>(first) / static_cast<double>(splats.size()));
    const Index count = std::min(most, splats.size() - first);
    std::iota(rows.begin(), rows.end(), first);
    const SplatBatch<double> batch{jacobians.data(),
                                   most,
                                   rows.data(),
                                   rows.data(),
                                   splats.rotations.data(),
                                   splats.log_scales.data(),
                                   splats.harmonics.data(),
                                   moved.rotations.data(),
                                   moved.log_scales.data(),
                                   moved.harmonics.data(),
                                   static_cast<int>(splats.harmonics.cols() / 3),
                                   &harmonic_tables<double>(),
                                   stretches.data()};
    parallel_for(0, count, 1024, [&](Index from, Index to) {
      ARAPFIELDS_DISPATCH(turn_splats(batch, from, to));
      for (Index i = first + from; i < first + to; ++i)
        moved.centers.row(i) =
            (linear * splats.centers.row(i).transpose().cast<double>() + matrix.topRightCorner<3, 1>())
                .transpose()
                .cast<float>();
    });
  }
  return moved;
}

}  // namespace arapfields
