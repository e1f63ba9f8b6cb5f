// SPDX-License-Identifier: GPL-3.0-or-later
#include "core/parallel.h"
#include "splats/splat_motion.h"
#include "splats/turn_kernel.h"

namespace arapfields {

template <class Scalar>
PointsF changed_columns(const Frame& frame, const GaussianSplats& rest, const std::vector<SplatGroup>& groups,
                        const SplatJets<Scalar>& jets, const std::vector<SplatColumn>& columns,
                        const Progress& progress) {
  PointsF centers(rest.size(), 3);
  RowMatrix<float> jacobians(rest.size(), 9);
  for (std::size_t g = 0; g < groups.size(); ++g) {
    progress.report(static_cast<double>(g) / static_cast<double>(groups.size()));
    const std::vector<Index>& rows = groups[g].rows;
    JetBlock<Scalar> block(std::ssize(rows), JetOrder::first);
    const JetView<Scalar> of_group = block.view();
    jets(g, of_group);
    parallel_for(0, of_group.count, 1024, [&](Index from, Index to) {
      for (Index i = from; i < to; ++i) {
        const Index row = rows[static_cast<std::size_t>(i)];
        for (int a = 0; a < 3; ++a) {
          centers(row, a) =
              static_cast<float>(frame.scale * static_cast<double>(of_group.at(0, i)[a]) + frame.center[a]);
          for (int k = 0; k < 3; ++k)
            jacobians(row, 3 * k + a) = static_cast<float>(of_group.at(first_column(k), i)[a]);
        }
      }
    });
  }
  const SplatColumnBatch batch{jacobians.data(), columns.data(), static_cast<int>(rest.harmonics.cols() / 3),
                               &harmonic_tables<float>()};
  parallel_for(0, rest.size(), 1024,
               [&](Index from, Index to) { ARAPFIELDS_DISPATCH(turn_columns(batch, from, to)); });
  return centers;
}
template PointsF changed_columns(const Frame&, const GaussianSplats&, const std::vector<SplatGroup>&,
                                 const SplatJets<float>&, const std::vector<SplatColumn>&, const Progress&);
template PointsF changed_columns(const Frame&, const GaussianSplats&, const std::vector<SplatGroup>&,
                                 const SplatJets<double>&, const std::vector<SplatColumn>&, const Progress&);

}  // namespace arapfields
