// SPDX-License-Identifier: GPL-3.0-or-later
#include "fields/inverse.h"

#include <Eigen/Geometry>
#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>
#include <unsupported/Eigen/BVH>

#include "core/errors.h"
#include "core/parallel.h"

namespace arapfields {

Points values_at(const DeformationField& field, PointsIn points, const Progress& progress) {
  constexpr Index chunk = 4096;
  Points values(points.rows(), 3);
  for (Index begin = 0; begin < points.rows(); begin += chunk) {
    progress.check();
    const Index rows = std::min<Index>(chunk, points.rows() - begin);
    field.evaluate(points.middleRows(begin, rows), {values.data() + 3 * begin, rows, JetOrder::value});
  }
  return values;
}

namespace {

/// Points x with their images f(x), searched by image.
class Starts {
 public:
  Starts(const DeformationField& field, Points rest, const Progress& progress)
      : rest_(std::move(rest)), images_(values_at(field, rest_, progress)) {
    std::vector<int> ids;
    std::vector<Eigen::AlignedBox3d> boxes;
    for (Index i = 0; i < images_.rows(); ++i) {
      if (!images_.row(i).allFinite()) continue;
      ids.push_back(static_cast<int>(i));
      boxes.emplace_back(Vec3(images_.row(i)), Vec3(images_.row(i)));
    }
    tree_.init(ids.begin(), ids.end(), boxes.begin(), boxes.end());
    empty_ = ids.empty();
  }

  bool empty() const { return empty_; }

  Vec3 nearest(const Vec3& image) const {
    Search search{images_, image};
    Eigen::BVMinimize(tree_, search);
    return rest_.row(search.best);
  }

  /// The point whose image is the (nearer + 1)-th nearest, or the farthest.
  Vec3 next_nearest(const Vec3& image, Index nearer) const {
    Vector squares = (images_.rowwise() - image.transpose()).rowwise().squaredNorm();
    std::vector<Index> order;
    for (Index i = 0; i < squares.size(); ++i)
      if (images_.row(i).allFinite()) order.push_back(i);  // a square may be infinite
    const auto wanted = order.begin() + std::min<std::ptrdiff_t>(nearer, std::ssize(order) - 1);
    std::nth_element(order.begin(), wanted, order.end(), [&](Index a, Index b) {
      return squares[a] != squares[b] ? squares[a] < squares[b] : a < b;
    });
    return rest_.row(*wanted);
  }

 private:
  struct Search {
    using Scalar = double;
    const Points& images;
    Vec3 target;
    int best = 0;
    double least = std::numeric_limits<double>::infinity();
    double minimumOnVolume(const Eigen::AlignedBox3d& box) const {
      return box.squaredExteriorDistance(target);
    }
    double minimumOnObject(int i) {
      const double distance = (images.row(i).transpose() - target).squaredNorm();
      if (distance < least) {
        least = distance;
        best = i;
      }
      return distance;
    }
  };

  Points rest_, images_;
  Eigen::KdBVH<double, 3, int> tree_;
  bool empty_ = true;
};

constexpr int further_starts = 24;  // of the surface's samples, and of the grid's

Points grid(int side) {
  Points points(side * side * side, 3);
  for (Index i = 0; i < points.rows(); ++i)
    points.row(i) = (2.0 / (side - 1)) * Vec3(i % side, i / side % side, i / side / side).transpose() -
                    Vec3::Ones().transpose();
  return points;
}

/// The state of one target's iteration: the best x so far, its residual r = f(x) − y, and its Newton step d.
struct Walker {
  Index row;
  Vec3 target, start, best, step = Vec3::Zero();
  double residual = std::numeric_limits<double>::infinity();
  double damping = 1.0;
  bool done = false;
};

Vec3 newton_step(const Mat3& jacobian, const Vec3& residual, double longest) {
  Vec3 step = -jacobian.inverse() * residual;
  if (!step.allFinite() || step.norm() > 1e3) {
    const Mat3 normal = jacobian.transpose() * jacobian + 1e-4 * Mat3::Identity();
    step = -normal.inverse() * (jacobian.transpose() * residual);
  }
  const double length = step.norm();
  return length > longest ? Vec3(step * (longest / length)) : step;
}

/// Iterates all walkers until they converge or fail; each evaluation is one batch.
void walk(const DeformationField& field, std::vector<Walker>& walkers, const NewtonInverseOptions& options,
          const Progress& progress) {
  constexpr double smallest_damping = 1.0 / 64.0;
  std::vector<std::size_t> active(walkers.size());
  std::iota(active.begin(), active.end(), 0);
  for (int iteration = 0; iteration < options.iterations && !active.empty(); ++iteration) {
    progress.check();
    const Index count = static_cast<Index>(active.size());
    Points trial(count, 3);
    for (Index k = 0; k < count; ++k) {
      const Walker& w = walkers[active[k]];
      trial.row(k) = iteration == 0 ? w.best : Vec3(w.best + w.damping * w.step);
    }
    JetBlock<double> block(count, JetOrder::first);
    field.evaluate(trial, block.view());
    const JetView<const double> jets = block.view();
    for (Index k = 0; k < count; ++k) {
      Walker& w = walkers[active[k]];
      const Vec3 residual = Vec3(jets.at(0, k)) - w.target;
      const double norm = residual.norm();
      if (norm < w.residual) {
        Mat3 jacobian;
        for (int j = 0; j < 3; ++j) jacobian.col(j) = Vec3(jets.at(first_column(j), k));
        w.best = trial.row(k);
        w.step = newton_step(jacobian, residual, options.longest_step);
        w.done = norm < 0.02 * options.tolerance;
        w.residual = norm;
        w.damping = std::min(1.0, 2.0 * w.damping);
      } else {
        w.damping *= 0.5;
        w.done = w.damping < smallest_damping || !(w.residual < std::numeric_limits<double>::infinity());
      }
    }
    std::erase_if(active, [&](std::size_t i) { return walkers[i].done; });
  }
}

/// f at the walkers' starts, where the continuation's lines begin.
Points values_at_starts(const DeformationField& field, const std::vector<Walker>& walkers,
                        const Progress& progress) {
  Points starts(static_cast<Index>(walkers.size()), 3);
  for (std::size_t i = 0; i < walkers.size(); ++i) starts.row(static_cast<Index>(i)) = walkers[i].start;
  return values_at(field, starts, progress);
}

/// Continuation: tracks the preimage of the line from f(start) to the target, in steps that are halved where
/// Newton's method does not converge. Without folds the preimage is unique.
void follow_lines(const DeformationField& field, std::vector<Walker>& walkers,
                  const NewtonInverseOptions& options, const Progress& progress) {
  constexpr double first_step = 0.25, least_step = 1.0 / 2048.0;
  constexpr int steps = 256;  // at most
  const Points from = values_at_starts(field, walkers, progress);
  std::vector<double> done(walkers.size(), 0.0), step(walkers.size(), first_step);
  std::vector<std::size_t> active;
  for (std::size_t i = 0; i < walkers.size(); ++i)
    if (from.row(static_cast<Index>(i)).allFinite()) active.push_back(i);
  for (int round = 0; round < steps && !active.empty(); ++round) {
    std::vector<Walker> tries;
    for (const std::size_t i : active) {
      const Vec3 begin = from.row(static_cast<Index>(i));
      const Vec3 at = walkers[i].start;
      Walker& next = tries.emplace_back(walkers[i]);
      next.target = begin + (done[i] + step[i]) * (walkers[i].target - begin);
      next.best = at;
    }
    walk(field, tries, options, progress);
    for (std::size_t k = 0; k < active.size(); ++k) {
      const std::size_t i = active[k];
      if (tries[k].residual <= options.tolerance) {
        walkers[i].start = tries[k].best;
        done[i] += step[i];
        step[i] = std::min(2.0 * step[i], 1.0 - done[i]);
      } else {
        step[i] *= 0.5;
      }
      if (done[i] < 1.0) continue;
      walkers[i].best = tries[k].best;
      walkers[i].residual = tries[k].residual;
    }
    std::erase_if(active, [&](std::size_t i) { return done[i] >= 1.0 || step[i] < least_step; });
  }
}

}  // namespace

struct NewtonInverse::Parts {
  const DeformationField& field;
  Starts surface, space;
};

namespace {

/// The result by a closed-form inverse; NaN for targets that are not finite.
InverseResult exact_inverse(const DeformationField& field, PointsIn targets, const Progress& progress) {
  constexpr Index chunk = 65536;
  InverseResult result{Points(targets.rows(), 3), 0, 0.0};
  for (Index begin = 0; begin < targets.rows(); begin += chunk) {
    progress.report(static_cast<double>(begin) / static_cast<double>(targets.rows()), "inverting");
    const Index rows = std::min<Index>(chunk, targets.rows() - begin);
    result.points.middleRows(begin, rows) = field.preimages(targets.middleRows(begin, rows));
  }
  for (Index i = 0; i < targets.rows(); ++i)
    if (!targets.row(i).allFinite() || !result.points.row(i).allFinite()) {
      result.points.row(i).setConstant(std::numeric_limits<double>::quiet_NaN());
      ++result.failures;
    }
  progress.report(1.0);
  return result;
}

}  // namespace

NewtonInverse::NewtonInverse(const DeformationField& field, Points rest, const Progress& progress)
    : parts_(field.has_preimages() ? new Parts{field, Starts(field, Points(0, 3), progress),
                                               Starts(field, Points(0, 3), progress)}
                                   : new Parts{field, Starts(field, std::move(rest), progress),
                                               Starts(field, grid(17), progress)}) {}
NewtonInverse::~NewtonInverse() = default;
NewtonInverse::NewtonInverse(NewtonInverse&&) noexcept = default;

InverseResult NewtonInverse::operator()(PointsIn targets, const NewtonInverseOptions& options,
                                        const Progress& progress) const {
  options.validate();
  constexpr Index chunk = 4096;
  const auto& [field, surface, space] = *parts_;
  if (field.has_preimages()) return exact_inverse(field, targets, progress);
  InverseResult result{Points::Constant(targets.rows(), 3, std::numeric_limits<double>::quiet_NaN()), 0, 0.0};
  for (Index begin = 0; begin < targets.rows(); begin += chunk) {
    progress.report(static_cast<double>(begin) / static_cast<double>(targets.rows()), "inverting");
    const Index rows = std::min<Index>(chunk, targets.rows() - begin);
    std::vector<Index> left;
    for (Index i = begin; i < begin + rows; ++i)
      if (targets.row(i).allFinite()) left.push_back(i);
    // Newton's method from three starts, then continuation from them, then both from further starts.
    const int attempts = std::isfinite(options.max_distance) ? 1 : 6 + 2 * further_starts;
    for (int attempt = 0; attempt < attempts && !left.empty(); ++attempt) {
      const int turn = attempt < 6 ? attempt % 3 : attempt % 2;
      const Starts* starts = turn == 0 ? &surface : turn == 1 ? &space : nullptr;
      if (starts != nullptr && starts->empty()) continue;
      std::vector<Walker> walkers(left.size());
      parallel_for(0, static_cast<Index>(left.size()), 64, [&](Index from, Index to) {
        for (Index k = from; k < to; ++k) {
          Walker& w = walkers[k];
          w.row = left[k];
          w.target = targets.row(w.row);
          w.start = starts == nullptr ? w.target
                    : attempt < 6     ? starts->nearest(w.target)
                                      : starts->next_nearest(w.target, (attempt - 4) / 2);
          w.best = w.start;
        }
      });
      (attempt / 3 == 1 ? follow_lines : walk)(field, walkers, options, progress);
      left.clear();
      for (const Walker& w : walkers) {
        if (w.residual <= options.tolerance && (w.best - w.start).norm() <= options.max_distance) {
          result.points.row(w.row) = w.best;
          result.worst_residual = std::max(result.worst_residual, w.residual);
        } else {
          left.push_back(w.row);
        }
      }
    }
  }
  for (Index i = 0; i < targets.rows(); ++i)
    if (!result.points.row(i).allFinite()) ++result.failures;
  progress.report(1.0);
  return result;
}

InverseResult invert(const DeformationField& field, PointsIn targets, const NewtonInverseOptions& options,
                     const Progress& progress) {
  return NewtonInverse(field, field.rest_points(), progress)(targets, options, progress);
}

}  // namespace arapfields
