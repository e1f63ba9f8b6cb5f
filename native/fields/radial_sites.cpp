// SPDX-License-Identifier: GPL-3.0-or-later
#include <algorithm>
#include <array>
#include <cmath>
#include <string>

#include "core/errors.h"
#include "core/parallel.h"
#include "fields/radial_basis.h"

namespace arapfields {
namespace {

constexpr Index block_size = 16;
constexpr Index blocks_per_task = 4;

std::size_t at(Index i) { return static_cast<std::size_t>(i); }

}  // namespace

RadialSites::RadialSites(const RadialBasis& basis, PointsIn points)
    : bump_count_(basis.bumps()), count_(points.rows()) {
  bumps_.resize(at(4 * bump_count_));
  for (Index m = 0; m < bump_count_; ++m) {
    for (int k = 0; k < 3; ++k) bumps_[at(4 * m + k)] = basis.centers(m, k);
    bumps_[at(4 * m + 3)] = 1.0 / (basis.radii[m] * basis.radii[m]);
  }
  points_.resize(at(blocks() * 3 * block_size));
  std::vector<std::vector<std::int32_t>> lists(at(blocks()));
  parallel_for(0, blocks(), 8, [&](Index first, Index last) {
    std::vector<std::int32_t> list(at(bump_count_ + 1));
    for (Index b = first; b < last; ++b) {
      double* block = &points_[at(b * 3 * block_size)];
      for (Index i = 0; i < block_size; ++i)
        for (int k = 0; k < 3; ++k)
          block[k * block_size + i] = points(std::min(b * block_size + i, count_ - 1), k);
      const Index rows = std::min(block_size, count_ - b * block_size);
      const auto part = points.middleRows(b * block_size, rows);
      const Vec3 center = 0.5 * (part.colwise().minCoeff() + part.colwise().maxCoeff()).transpose();
      const double reach =
          std::sqrt((part.rowwise() - center.transpose()).rowwise().squaredNorm().maxCoeff());
      const Index found =
          ARAPFIELDS_DISPATCH(radial_active(center.data(), reach, bumps_.data(), bump_count_, list.data()));
      lists[at(b)].assign(list.begin(), list.begin() + found);
    }
  });
  start_.assign(1, 0);
  for (const auto& list : lists) {
    active_.insert(active_.end(), list.begin(), list.end());
    start_.push_back(static_cast<Index>(active_.size()));
  }
}

RadialBlock RadialSites::block(Index b) const {
  return {&points_[at(b * 3 * block_size)], bumps_.data(), active_.data() + start_[at(b)],
          start_[at(b) + 1] - start_[at(b)]};
}

void RadialSites::evaluate(const RowMatrix<double>& coefficients, JetView<double> out) const {
  require(out.count == count_, "out", std::to_string(out.count) + " points",
          std::to_string(count_) + " are needed");
  require(coefficients.rows() == bump_count_ + 4 && coefficients.cols() == 3, "coefficients",
          std::to_string(coefficients.rows()) + " rows",
          std::to_string(bump_count_ + 4) + " rows of 3 are needed");
  const int columns_count = columns(out.order);
  const double* affine = coefficients.data() + 3 * bump_count_;
  parallel_for(0, blocks(), blocks_per_task, [&](Index first, Index last) {
    std::array<double, 10 * 3 * block_size> jets;
    for (Index b = first; b < last; ++b) {
      const RadialBlock here = block(b);
      ARAPFIELDS_DISPATCH(radial_forward(here, coefficients.data(), columns_count, jets.data()));
      const Index valid = std::min(block_size, count_ - b * block_size);
      for (int c = 0; c < columns_count; ++c) {
        double* to = out.at(c, b * block_size);
        for (int i = 0; i < 3; ++i) {
          const double* from = &jets[at((c * 3 + i) * block_size)];
          const double constant = c < 4 ? affine[3 * c + i] : 0.0;
          for (Index p = 0; p < valid; ++p) {
            double value = from[p] + constant;
            if (c == 0)
              for (int k = 0; k < 3; ++k) value += here.points[k * block_size + p] * affine[3 * (k + 1) + i];
            to[3 * p + i] = value;
          }
        }
      }
    }
  });
}

void RadialSites::pull_back(JetView<const double> cotangents, RowMatrix<double>& gradient) const {
  require(cotangents.count == count_, "cotangents", std::to_string(cotangents.count) + " points",
          std::to_string(count_) + " are needed");
  const int columns_count = columns(cotangents.order);
  // A fixed number of partial sums: the result does not depend on the number of threads.
  constexpr Index tasks = 4;
  const Index per_task = (blocks() + tasks - 1) / tasks;
  std::vector<std::vector<double>> sums(at(tasks));
  std::vector<RowMatrix<double>> affine(at(tasks), RowMatrix<double>::Zero(4, 3));
  parallel_for(0, tasks, 1, [&](Index first, Index last) {
    std::array<double, 10 * 3 * block_size> packed;
    for (Index task = first; task < last; ++task) {
      auto& sum = sums[at(task)];
      sum.assign(at(bump_count_ * 3 * radial_lanes), 0.0);
      for (Index b = task * per_task; b < std::min((task + 1) * per_task, blocks()); ++b) {
        const RadialBlock here = block(b);
        const Index valid = std::min(block_size, count_ - b * block_size);
        packed.fill(0.0);
        for (int c = 0; c < columns_count; ++c) {
          const double* from = cotangents.at(c, b * block_size);
          for (Index p = 0; p < valid; ++p)
            for (int i = 0; i < 3; ++i) {
              const double x = from[3 * p + i];
              packed[at((c * 3 + i) * block_size + p)] = x;
              if (c < 4) affine[at(task)](c, i) += x;
              if (c == 0)
                for (int k = 0; k < 3; ++k) affine[at(task)](1 + k, i) += x * here.points[k * block_size + p];
            }
        }
        ARAPFIELDS_DISPATCH(radial_backward(here, packed.data(), columns_count, sum.data()));
      }
    }
  });
  for (Index task = 0; task < tasks; ++task) {
    for (Index j = 0; j < bump_count_ * 3; ++j)
      for (int lane = 0; lane < radial_lanes; ++lane)
        gradient.data()[j] += sums[at(task)][at(j * radial_lanes + lane)];
    gradient.bottomRows<4>() += affine[at(task)];
  }
}

RowMatrix<double> RadialSites::rows(JetOrder order, Index stride) const {
  const int columns_count = columns(order);
  const Index taken = (count_ + stride - 1) / stride;
  RowMatrix<double> result = RowMatrix<double>::Zero(columns_count * taken, bump_count_ + 4);
  parallel_for(0, blocks(), 4, [&](Index first, Index last) {
    std::vector<double> values;
    for (Index b = first; b < last; ++b) {
      const RadialBlock here = block(b);
      values.resize(at(here.active_count * columns_count * block_size));
      ARAPFIELDS_DISPATCH(radial_rows(here, columns_count, values.data()));
      for (Index p = 0; p < std::min(block_size, count_ - b * block_size); ++p) {
        const Index point = b * block_size + p;
        if (point % stride != 0) continue;
        for (int c = 0; c < columns_count; ++c) {
          auto row = result.row(c * taken + point / stride);
          for (Index a = 0; a < here.active_count; ++a)
            row[here.active[a]] = values[at((a * columns_count + c) * block_size + p)];
          if (c < 4) row[bump_count_ + c] = 1.0;
          if (c == 0)
            for (int k = 0; k < 3; ++k) row[bump_count_ + 1 + k] = here.points[k * block_size + p];
        }
      }
    }
  });
  return result;
}

}  // namespace arapfields
