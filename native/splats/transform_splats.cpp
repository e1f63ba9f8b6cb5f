// SPDX-License-Identifier: GPL-3.0-or-later
#include "splats/transform_splats.h"

#include <Eigen/LU>
#include <numeric>
#include <vector>

#include "core/errors.h"
#include "core/parallel.h"
#include "splats/turn_kernel.h"

namespace arapfields {
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
