// SPDX-License-Identifier: GPL-3.0-or-later
#include "splats/move_splats.h"

#include <Eigen/Geometry>
#include <cmath>
#include <numeric>

#include "core/errors.h"
#include "core/parallel.h"
#include "energies/rotation.h"
#include "splats/harmonics.h"

namespace arapfields {
namespace {

constexpr std::size_t chunk = 1 << 15;  // splats between two looks at the task
constexpr int rounds = 4;               // of division: into at most 16
constexpr double wide = 0.01;  // standard deviation (cube) from which on a Gaussian is tested for bending
constexpr double most_bending = 0.2;          // change of J over a standard deviation, as a share of J
constexpr double apart = 0.8660254037844386;  // √3/2: two halves of σ/2 have the whole's variance
constexpr int sweeps = 12;
constexpr double orthogonal = 1e-15;
constexpr double least_length = 1e-30;  // of an axis, whose logarithm is stored

/// The orthogonal axes u_i of lengths σ_i with Σ σ_i² u_i u_iᵀ = A Aᵀ, as columns σ_i u_i, by Hestenes'
/// one-sided Jacobi rotations. Columns that are orthogonal stay as they are; others keep their order.
Mat3 orthogonalised(Mat3 columns) {
  for (int sweep = 0; sweep < sweeps; ++sweep) {
    bool turned = false;
    for (const auto& [p, q] : {std::pair(0, 1), std::pair(0, 2), std::pair(1, 2)}) {
      const double alpha = columns.col(p).squaredNorm(), beta = columns.col(q).squaredNorm();
      const double gamma = columns.col(p).dot(columns.col(q));
      if (gamma * gamma <= orthogonal * orthogonal * alpha * beta || gamma == 0.0) continue;
      const double zeta = (beta - alpha) / (2.0 * gamma);
      const double t = std::copysign(1.0, zeta) / (std::abs(zeta) + std::hypot(1.0, zeta));
      const double c = 1.0 / std::hypot(1.0, t), s = c * t;
      const Vec3 first = columns.col(p), second = columns.col(q);
      columns.col(p) = c * first - s * second;
      columns.col(q) = s * first + c * second;
      turned = true;
    }
    if (!turned) break;
  }
  return columns;
}

/// A field's jets at some splats' centers, by the cube's coordinates.
class SplatJets {
 public:
  SplatJets(const DeformationField& field, const GaussianSplats& splats, const std::vector<Index>& rows,
            JetOrder order)
      : block_(static_cast<Index>(rows.size()), order), rotations_(3 * block_.view().count, 3) {
    Points rest(block_.view().count, 3);
    for (Index i = 0; i < rest.rows(); ++i)
      rest.row(i) = splats.centers.row(rows[static_cast<std::size_t>(i)]).cast<double>();
    field.evaluate(field.frame().to_cube(rest), block_.view());
    closest_rotations(block_.view().column(1), rest.rows(), rotations_.data());
  }
  Vec3 value(Index i) const { return column(0, i); }
  Mat3 jacobian(Index i) const {
    Mat3 result;
    for (int k = 0; k < 3; ++k) result.col(k) = column(first_column(k), i);
    return result;
  }
  /// The rotation closest to the Jacobian.
  Mat3 rotation(Index i) const {
    Mat3 result;
    for (int k = 0; k < 3; ++k) result.col(k) = rotations_.row(k * block_.view().count + i).transpose();
    return result;
  }
  /// The second derivative along a direction.
  Vec3 bend(Index i, const Vec3& direction) const {
    Vec3 result = Vec3::Zero();
    for (int j = 0; j < 3; ++j)
      for (int k = 0; k < 3; ++k) result += direction[j] * direction[k] * column(second_column(j, k), i);
    return result;
  }

 private:
  Vec3 column(int c, Index i) const { return Eigen::Map<const Vec3>(block_.view().at(c, i)); }

  JetBlock<double> block_;
  Points rotations_;  // (3 count, 3)
};

/// Moves splats; those that it divides first are moved in the next round.
class SplatMotion {
 public:
  SplatMotion(const DeformationField& field, GaussianSplats& splats, double max_stretch)
      : field_(field),
        splats_(splats),
        max_stretch_(max_stretch),
        depth_(Eigen::MatrixX3i::Zero(splats.size(), 3)) {}

  void run(const Progress& progress) {
    std::vector<Index> rows(static_cast<std::size_t>(splats_.size()));
    std::iota(rows.begin(), rows.end(), Index{0});
    for (int round = 0; !rows.empty(); ++round) {
      const double share = 1.0 - std::ldexp(1.0, -round);  // of the progress that earlier rounds have
      const auto part = progress.part(share, share + std::ldexp(1.0, -round - 1));
      std::vector<Index> left;
      for (std::size_t first = 0; first < rows.size(); first += chunk) {
        part.report(static_cast<double>(first) / static_cast<double>(rows.size()));
        const std::size_t last = std::min(first + chunk, rows.size());
        move({rows.begin() + static_cast<std::ptrdiff_t>(first),
              rows.begin() + static_cast<std::ptrdiff_t>(last)},
             round < rounds && std::isfinite(max_stretch_), left);
      }
      rows = std::move(left);
    }
  }

 private:
  /// Moves these rows but for those that are divided, whose halves are added to `left`.
  void move(const std::vector<Index>& rows, bool divides, std::vector<Index>& left) {
    const Index count = static_cast<Index>(rows.size());
    const SplatJets jets(field_, splats_, rows, JetOrder::first);
    std::vector<int> axes(rows.size(), -1);
    if (divides) {
      parallel_for(0, count, 1024, [&](Index from, Index to) {
        for (Index i = from; i < to; ++i)
          axes[static_cast<std::size_t>(i)] =
              stretched_axis(rows[static_cast<std::size_t>(i)], jets.jacobian(i));
      });
      choose_bent_axes(rows, axes);
    }
    parallel_for(0, count, 1024, [&](Index from, Index to) {
      for (Index i = from; i < to; ++i)
        if (axes[static_cast<std::size_t>(i)] < 0) move_one(rows[static_cast<std::size_t>(i)], jets, i);
    });
    divide(rows, axes, left);
  }

  Mat3 axes_at_rest(Index row) const { return axes_of(splats_.rotations.row(row)); }
  double sigma(Index row, int axis) const {
    return std::exp(static_cast<double>(splats_.log_scales(row, axis)));
  }

  /// The axis that is stretched too much for as often as it was divided; −1: none.
  int stretched_axis(Index row, const Mat3& jacobian) const {
    int axis = -1;
    const double most = (jacobian * axes_at_rest(row)).colwise().norm().maxCoeff(&axis);
    return most > std::ldexp(max_stretch_, depth_(row, axis)) ? axis : -1;
  }

  /// The axes of broad Gaussians along which the field bends them most, where that is too much.
  void choose_bent_axes(const std::vector<Index>& rows, std::vector<int>& axes) const {
    std::vector<Index> broad;
    std::vector<std::size_t> places;
    for (std::size_t i = 0; i < rows.size(); ++i)
      if (std::exp(splats_.log_scales.row(rows[i]).maxCoeff()) > wide * field_.frame().scale)
        broad.push_back(rows[i]), places.push_back(i);
    const SplatJets jets(field_, splats_, broad, JetOrder::second);
    parallel_for(0, static_cast<Index>(broad.size()), 256, [&](Index from, Index to) {
      for (Index k = from; k < to; ++k) {
        const Index row = broad[static_cast<std::size_t>(k)];
        const Mat3 rest = axes_at_rest(row), jacobian = jets.jacobian(k);
        double most = most_bending;
        for (int a = 0; a < 3; ++a) {
          const double along = (jacobian * rest.col(a)).norm();
          const double bend = sigma(row, a) / field_.frame().scale * jets.bend(k, rest.col(a)).norm();
          if (bend > most * along) most = bend / along, axes[places[static_cast<std::size_t>(k)]] = a;
        }
      }
    });
  }

  void divide(const std::vector<Index>& rows, const std::vector<int>& axes, std::vector<Index>& left) {
    std::vector<Index> divided;
    std::vector<int> along;
    for (std::size_t i = 0; i < rows.size(); ++i)
      if (axes[i] >= 0) divided.push_back(rows[i]), along.push_back(axes[i]);
    if (divided.empty()) return;
    const Index before = splats_.size();
    splats_.append_copies(divided);
    depth_.conservativeResize(splats_.size(), 3);
    for (std::size_t k = 0; k < divided.size(); ++k) {
      const Index row = divided[k], other = before + static_cast<Index>(k);
      const Vec3 shift = apart * sigma(row, along[k]) * axes_at_rest(row).col(along[k]);
      splats_.centers.row(row) -= shift.cast<float>().transpose();
      splats_.centers.row(other) += shift.cast<float>().transpose();
      ++depth_(row, along[k]);
      depth_.row(other) = depth_.row(row);
      for (const Index half : {row, other}) {
        splats_.log_scales(half, along[k]) -= static_cast<float>(std::log(2.0));
        left.push_back(half);
      }
    }
  }

  void move_one(Index row, const SplatJets& jets, Index i) {
    const Mat3 rest = axes_at_rest(row), turn = jets.rotation(i);
    const Vec3 widths(sigma(row, 0), sigma(row, 1), sigma(row, 2));
    const Mat3 columns = orthogonalised(jets.jacobian(i) * rest * widths.asDiagonal());
    const Vec3 lengths = columns.colwise().norm().transpose();
    Mat3 axes = turn * rest;
    const Eigen::Quaterniond before(axes);
    for (int a = 0; a < 3; ++a)
      if (lengths[a] > least_length) axes.col(a) = columns.col(a) / lengths[a];
    if (axes.determinant() < 0.0) axes.col(2) *= -1.0;
    Eigen::Quaterniond after(axes);
    if (after.dot(before) < 0.0) after.coeffs() *= -1.0;  // q and −q are one rotation
    splats_.rotations.row(row) =
        Eigen::RowVector4d(after.w(), after.x(), after.y(), after.z()).normalized().cast<float>();
    splats_.log_scales.row(row) = lengths.array().max(least_length).log().matrix().transpose().cast<float>();
    const Frame& frame = field_.frame();
    splats_.centers.row(row) = (frame.scale * jets.value(i) + frame.center).transpose().cast<float>();
    turn_harmonics(turn, splats_.harmonics.row(row));
  }

  const DeformationField& field_;
  GaussianSplats& splats_;
  double max_stretch_;
  Eigen::MatrixX3i depth_;  // how often each was divided along its axes
};

}  // namespace

GaussianSplats move_splats(const DeformationField& field, GaussianSplats splats, double max_stretch,
                           const Progress& progress) {
  splats.validate();
  require(max_stretch >= 1.0, "max_stretch", number_text(max_stretch), "at least 1 is needed");
  SplatMotion(field, splats, max_stretch).run(progress);
  return splats;
}

}  // namespace arapfields
