// SPDX-License-Identifier: GPL-3.0-or-later
#include "fields/radial_evaluator.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <string>

#include "core/errors.h"
#include "core/parallel.h"

namespace arapfields {
namespace {

constexpr Index blocks_per_task = 4;

std::vector<double> center_rows(const RadialBasis& basis) {
  std::vector<double> rows(center_stride * basis.center_count(), 0.0);
  for (Index m = 0; m < basis.center_count(); ++m) {
    double* row = &rows[center_stride * m];
    for (int k = 0; k < 3; ++k) row[k] = basis.centers(m, k);
    row[3] = 1.0 / (basis.radii[m] * basis.radii[m]);
    for (int k = 0; k < 3; ++k) row[4 + k] = basis.embedding ? basis.embedded(m, k) : 0.0;
  }
  return rows;
}

/// The centre of the rows' bounding box and the radius of a ball around it that contains them.
double ball_of(ConstPointsRef<double> rows, double* center) {
  Eigen::Map<Eigen::RowVector3d> middle(center);
  middle = 0.5 * (rows.colwise().minCoeff() + rows.colwise().maxCoeff());
  return std::sqrt((rows.rowwise() - middle).rowwise().squaredNorm().maxCoeff());
}

}  // namespace

template <class Scalar>
RadialEvaluator<Scalar>::RadialEvaluator(const RadialBasis& basis, PointsIn points, JetOrder most,
                                         const Points* known, const std::vector<SurfaceSide>* sides)
    : center_count_(basis.center_count()), count_(points.rows()), most_(most) {
  const std::vector<double> exact = center_rows(basis);
  centers_.assign(exact.begin(), exact.end());
  points_.resize(blocks() * 3 * block_size);
  JetBlock<double> jets(basis.embedding ? count_ : 0, most);
  if (basis.embedding) {
    if (known != nullptr) {
      require(most == JetOrder::value && known->rows() == count_, "embedded",
              std::to_string(known->rows()) + " rows", "one for each point is needed, and values alone");
      Eigen::Map<Points>(jets.view().data, count_, 3) = *known;
    } else {
      basis.embedding->evaluate(points, jets.view(), sides);
    }
    pack_embedding(jets);
  }
  const Eigen::Map<const Points> embedded(jets.view().data, jets.view().count, 3);
  std::vector<std::vector<std::int32_t>> lists(blocks());
  parallel_for(0, blocks(), 8, [&](Index first, Index last) {
    std::vector<std::int32_t> list(center_count_ + 1);
    for (Index b = first; b < last; ++b) {
      Scalar* block = &points_[b * 3 * block_size];
      for (Index i = 0; i < block_size; ++i)
        for (int k = 0; k < 3; ++k)
          block[k * block_size + i] =
              static_cast<Scalar>(points(std::min(b * block_size + i, count_ - 1), k));
      const Index rows = std::min(block_size, count_ - b * block_size);
      std::array<double, 6> center{};
      std::array<double, 2> ball_radius{};
      ball_radius[0] = ball_of(points.middleRows(b * block_size, rows), center.data());
      if (basis.embedding) ball_radius[1] = ball_of(embedded.middleRows(b * block_size, rows), &center[3]);
      const Index active_count = ARAPFIELDS_DISPATCH(
          radial_active(center.data(), ball_radius.data(), exact.data(), center_count_, list.data()));
      lists[b].assign(list.begin(), list.begin() + active_count);
    }
  });
  start_.assign(1, 0);
  for (const auto& list : lists) {
    active_.insert(active_.end(), list.begin(), list.end());
    start_.push_back(static_cast<Index>(active_.size()));
  }
}

template <class Scalar>
void RadialEvaluator<Scalar>::pack_embedding(const JetBlock<double>& jets) {
  const int columns_count = columns(most_), rows = embedding_rows(columns_count);
  embedding_.resize(blocks() * rows * block_size);
  parallel_for(0, blocks(), 8, [&](Index first, Index last) {
    for (Index b = first; b < last; ++b)
      for (Index i = 0; i < block_size; ++i) {
        const Index p = std::min(b * block_size + i, count_ - 1);
        Scalar* to = &embedding_[b * rows * block_size + i];
        for (int c = 0; c < columns_count; ++c)
          for (int k = 0; k < 3; ++k)
            to[(3 * c + k) * block_size] = static_cast<Scalar>(jets.view().at(c, p)[k]);
        if (most_ != JetOrder::second) continue;
        for (int j = 0; j < 3; ++j)
          for (int k = j; k < 3; ++k) {
            const Eigen::Map<const Vec3> a(jets.view().at(first_column(j), p));
            const Eigen::Map<const Vec3> c(jets.view().at(first_column(k), p));
            to[(30 + second_column(j, k) - 4) * block_size] = static_cast<Scalar>(a.dot(c));
          }
      }
  });
}

template <class Scalar>
void RadialEvaluator<Scalar>::require_order(JetOrder order) const {
  require(columns(order) <= columns(most_), "order", std::to_string(columns(order)) + " columns",
          "at most " + std::to_string(columns(most_)) + " were prepared");
}

template <class Scalar>
RadialBlock<Scalar> RadialEvaluator<Scalar>::block(Index b) const {
  const Scalar* embedding =
      embedding_.empty() ? nullptr : &embedding_[b * embedding_rows(columns(most_)) * block_size];
  return {&points_[b * 3 * block_size], embedding, centers_.data(), active_.data() + start_[b],
          start_[b + 1] - start_[b]};
}

template <class Scalar>
template <class Body>
void RadialEvaluator<Scalar>::for_blocks(Body&& body) const {
  parallel_for(0, blocks(), blocks_per_task, [&](Index first, Index last) {
    for (Index b = first; b < last; ++b) body(b, block(b));
  });
}

template <class Scalar>
void RadialEvaluator<Scalar>::evaluate(const RowMatrix<double>& coefficients, JetView<Scalar> out,
                                       const std::vector<Index>* of_blocks) const {
  require(out.count == count_, "out", std::to_string(out.count) + " points",
          std::to_string(count_) + " are needed");
  require(coefficients.rows() == center_count_ + 4 && coefficients.cols() == 3, "coefficients",
          std::to_string(coefficients.rows()) + " rows",
          std::to_string(center_count_ + 4) + " rows of 3 are needed");
  require_order(out.order);
  const int columns_count = columns(out.order);
  const RowMatrix<Scalar> rounded = coefficients.cast<Scalar>();
  const Scalar* affine = rounded.data() + 3 * center_count_;
  const Index count = of_blocks != nullptr ? std::ssize(*of_blocks) : blocks();
  parallel_for(0, count, blocks_per_task, [&](Index first, Index last) {
    std::array<Scalar, 10 * 3 * block_size> jets;
    for (Index at = first; at < last; ++at) {
      const Index b = of_blocks != nullptr ? (*of_blocks)[static_cast<std::size_t>(at)] : at;
      const RadialBlock<Scalar> data = block(b);
      ARAPFIELDS_DISPATCH(radial_forward(data, rounded.data(), columns_count, jets.data()));
      const Index valid = std::min(block_size, count_ - b * block_size);
      for (int c = 0; c < columns_count; ++c) {
        Scalar* to = out.at(c, b * block_size);
        for (int i = 0; i < 3; ++i) {
          const Scalar* from = &jets[(c * 3 + i) * block_size];
          const Scalar constant = c < 4 ? affine[3 * c + i] : Scalar(0);
          for (Index p = 0; p < valid; ++p) {
            Scalar value = from[p] + constant;
            if (c == 0)
              for (int k = 0; k < 3; ++k) value += data.points[k * block_size + p] * affine[3 * (k + 1) + i];
            to[3 * p + i] = value;
          }
        }
      }
    }
  });
}

template <class Scalar>
void RadialEvaluator<Scalar>::pull_back(JetView<const Scalar> cotangents, RowMatrix<double>& gradient) const {
  require(cotangents.count == count_, "cotangents", std::to_string(cotangents.count) + " points",
          std::to_string(count_) + " are needed");
  require_order(cotangents.order);
  const int columns_count = columns(cotangents.order);
  // A fixed number of partial sums: the result does not depend on the number of threads.
  constexpr Index tasks = 4;
  const Index per_task = (blocks() + tasks - 1) / tasks;
  std::vector<std::vector<Scalar>> sums(tasks);
  std::vector<RowMatrix<double>> affine(tasks, RowMatrix<double>::Zero(4, 3));
  parallel_for(0, tasks, 1, [&](Index first, Index last) {
    std::array<Scalar, 10 * 3 * block_size> packed;
    for (Index task = first; task < last; ++task) {
      auto& sum = sums[task];
      sum.assign(center_count_ * 3 * radial_lanes, Scalar(0));
      for (Index b = task * per_task; b < std::min((task + 1) * per_task, blocks()); ++b) {
        const RadialBlock<Scalar> data = block(b);
        const Index valid = std::min(block_size, count_ - b * block_size);
        const Eigen::Map<const Eigen::ArrayX<Scalar>> values(cotangents.at(0, b * block_size), 3 * valid);
        if (columns_count == 1 && (values == Scalar(0)).all())
          continue;  // most contact planes exert no force
        packed.fill(Scalar(0));
        for (int c = 0; c < columns_count; ++c) {
          const Scalar* from = cotangents.at(c, b * block_size);
          for (Index p = 0; p < valid; ++p)
            for (int i = 0; i < 3; ++i) {
              const Scalar x = from[3 * p + i];
              packed[(c * 3 + i) * block_size + p] = x;
              if (c < 4) affine[task](c, i) += static_cast<double>(x);
              if (c == 0)
                for (int k = 0; k < 3; ++k)
                  affine[task](1 + k, i) += static_cast<double>(x * data.points[k * block_size + p]);
            }
        }
        ARAPFIELDS_DISPATCH(radial_backward(data, packed.data(), columns_count, sum.data()));
      }
    }
  });
  for (Index task = 0; task < tasks; ++task) {
    for (Index j = 0; j < center_count_ * 3; ++j)
      for (int lane = 0; lane < radial_lanes; ++lane)
        gradient.data()[j] += static_cast<double>(sums[task][j * radial_lanes + lane]);
    gradient.bottomRows<4>() += affine[task];
  }
}

RowMatrix<double> radial_rows(const RadialBasis& basis, PointsIn points, JetOrder order,
                              const Points* embedded) {
  const RadialEvaluator<double> sites(basis, points, order, embedded);
  constexpr Index block_size = RadialEvaluator<double>::block_size;
  const Index count = points.rows(), centers = basis.center_count();
  const int columns_count = columns(order);
  RowMatrix<double> result = RowMatrix<double>::Zero(columns_count * count, basis.size());
  sites.for_blocks([&](Index b, const RadialBlock<double>& data) {
    std::vector<double> values(data.active_count * columns_count * block_size);
    ARAPFIELDS_DISPATCH(radial_rows(data, columns_count, values.data()));
    for (Index p = 0; p < std::min(block_size, count - b * block_size); ++p) {
      for (int c = 0; c < columns_count; ++c) {
        auto row = result.row(c * count + b * block_size + p);
        for (Index a = 0; a < data.active_count; ++a)
          row[data.active[a]] = values[(a * columns_count + c) * block_size + p];
        if (c < 4) row[centers + c] = 1.0;
        if (c == 0)
          for (int k = 0; k < 3; ++k) row[centers + 1 + k] = data.points[k * block_size + p];
      }
    }
  });
  return result;
}

template class RadialEvaluator<float>;
template class RadialEvaluator<double>;

}  // namespace arapfields
