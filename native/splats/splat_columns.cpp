// SPDX-License-Identifier: GPL-3.0-or-later
#include <algorithm>

#include "core/parallel.h"
#include "splats/gaussian_splats.h"

namespace arapfields {
namespace {

constexpr Index block = 512;  // splats whose numbers stay in the nearest caches while they are turned about

/// One quantity: a column of row-major numbers that has its place in the result.
struct Column {
  const float* first;
  Index stride;
};

}  // namespace

void GaussianSplats::write_columns(const float* minus, float* out) const {
  std::vector<Column> columns;
  const auto add = [&columns](const auto& rows, Index column) {
    columns.push_back({rows.data() + column, rows.cols()});
  };
  for (Index k = 0; k < 4; ++k) add(rotations, k);
  for (Index a = 0; a < 3; ++a) add(log_scales, a);
  for (Index c = 0; c < 3; ++c) add(harmonics, c);
  for (Index c = 0; c < 3; ++c)
    for (Index k = 3 + c; k < harmonics.cols(); k += 3) add(harmonics, k);
  parallel_for(0, size(), block, [&](Index from, Index to) {
    for (Index begin = from; begin < to; begin += block) {
      const Index end = std::min(begin + block, to);
      for (std::size_t row = 0; row < columns.size(); ++row) {
        const auto [first, stride] = columns[row];
        const Index place = static_cast<Index>(row) * size();
        if (minus == nullptr)
          for (Index i = begin; i < end; ++i) out[place + i] = first[i * stride];
        else
          for (Index i = begin; i < end; ++i) out[place + i] = first[i * stride] - minus[place + i];
      }
    }
  });
}

}  // namespace arapfields
