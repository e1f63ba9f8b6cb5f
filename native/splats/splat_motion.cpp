// SPDX-License-Identifier: GPL-3.0-or-later
#include "splats/splat_motion.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <numeric>
#include <utility>

#include "core/parallel.h"
#include "distance/morton.h"
#include "splats/turn_kernel.h"

namespace arapfields {
namespace {

constexpr Index group_size = 1 << 15;  // splats between two looks at the task
constexpr int rounds = 4;              // of division: into at most 16
constexpr double wide = 0.01;  // standard deviation (cube) from which on a Gaussian is tested for bending
constexpr double most_bending = 0.2;          // change of J over a standard deviation, as a share of J
constexpr double apart = 0.8660254037844386;  // √3/2: two halves of σ/2 have the whole's variance

template <class Scalar>
Eigen::Map<const Eigen::Matrix<Scalar, 3, 1>> column(JetView<const Scalar> jets, int c, Index i) {
  return Eigen::Map<const Eigen::Matrix<Scalar, 3, 1>>(jets.at(c, i));
}

/// Rows at rest, and the axis along which each is divided.
using Divisions = std::vector<std::pair<Index, int>>;

/// Splats, where each goes, and how often it was divided along its axes.
struct Round {
  GaussianSplats splats;
  std::vector<Index> targets;
  std::vector<Eigen::Array3i> depths;
};

/// Moves the splats of one round, and collects the halves of those that are divided first.
template <class Scalar>
class RoundMotion {
 public:
  RoundMotion(const Frame& frame, const GaussianSplats& rest, const Index* targets,
              const Eigen::Array3i* depths, double max_stretch, GaussianSplats& moved)
      : frame_(frame),
        rest_(rest),
        targets_(targets),
        depths_(depths),
        max_stretch_(max_stretch),
        moved_(moved) {}

  void move(const SplatGroup& group, JetView<const Scalar> jets) {
    const Index count = std::ssize(group.rows);
    targets_of_group_.resize(group.rows.size());
    for (std::size_t i = 0; i < group.rows.size(); ++i)
      targets_of_group_[i] = targets_ != nullptr ? targets_[group.rows[i]] : group.rows[i];
    stretches_.resize(count, 3);
    const SplatBatch<Scalar> batch{jets.column(1),
                                   count,
                                   group.rows.data(),
                                   targets_of_group_.data(),
                                   rest_.rotations.data(),
                                   rest_.log_scales.data(),
                                   rest_.harmonics.data(),
                                   moved_.rotations.data(),
                                   moved_.log_scales.data(),
                                   moved_.harmonics.data(),
                                   static_cast<int>(rest_.harmonics.cols() / 3),
                                   &harmonic_tables<Scalar>(),
                                   stretches_.data()};
    parallel_for(0, count, 1024, [&](Index from, Index to) {
      ARAPFIELDS_DISPATCH(turn_splats(batch, from, to));
      for (Index i = from; i < to; ++i)
        moved_.centers.row(targets_of_group_[static_cast<std::size_t>(i)]) =
            (frame_.scale * column(jets, 0, i).template cast<double>() + frame_.center)
                .transpose()
                .template cast<float>();
    });
  }

  /// After move(): divides what was stretched or, by the second jets of the broad ones, bent too much.
  void divide(const SplatGroup& group, JetView<const Scalar> second, Divisions& divisions) const {
    std::vector<int> bent(group.rows.size(), -1);
    parallel_for(0, second.count, 256, [&](Index from, Index to) {
      for (Index k = from; k < to; ++k) {
        const auto place = static_cast<std::size_t>(group.broad[static_cast<std::size_t>(k)]);
        bent[place] = bent_axis(group.rows[place], second, k);
      }
    });
    for (std::size_t i = 0; i < group.rows.size(); ++i) {
      const int axis = bent[i] >= 0 ? bent[i] : stretched_axis(group.rows[i], static_cast<Index>(i));
      if (axis >= 0) divisions.emplace_back(group.rows[i], axis);
    }
  }

 private:
  /// The axis that is stretched too much for as often as it was divided; −1: none.
  int stretched_axis(Index row, Index i) const {
    int axis = -1;
    const double most = static_cast<double>(stretches_.row(i).maxCoeff(&axis));
    const int depth = depths_ != nullptr ? depths_[row][axis] : 0;
    return most > std::ldexp(max_stretch_, depth) ? axis : -1;
  }

  /// The axis of a broad Gaussian along which the field bends it most, where that is too much; −1: none.
  int bent_axis(Index row, JetView<const Scalar> jets, Index k) const {
    const Mat3 rest = axes_of(rest_.rotations.row(row));
    double most = most_bending;
    int axis = -1;
    for (int a = 0; a < 3; ++a) {
      Vec3 along = Vec3::Zero(), bend = Vec3::Zero();
      for (int i = 0; i < 3; ++i) {
        along += rest(i, a) * column(jets, first_column(i), k).template cast<double>();
        for (int j = 0; j < 3; ++j)
          bend += rest(i, a) * rest(j, a) * column(jets, second_column(i, j), k).template cast<double>();
      }
      const double width = std::exp(static_cast<double>(rest_.log_scales(row, a))) / frame_.scale;
      if (width * bend.norm() > most * along.norm()) most = width * bend.norm() / along.norm(), axis = a;
    }
    return axis;
  }

  const Frame& frame_;
  const GaussianSplats& rest_;
  const Index* targets_;          // null: the rows themselves
  const Eigen::Array3i* depths_;  // null: never divided
  double max_stretch_;
  GaussianSplats& moved_;
  std::vector<Index> targets_of_group_;
  PointsOf<Scalar> stretches_;
};

/// The halves of these splats, and places for them: a splat's own, and one at the end of `moved`.
Round halves(const GaussianSplats& rest, const Round* whole, const Divisions& divisions,
             GaussianSplats& moved) {
  Round result;
  std::vector<Index> twice, copied;
  const Index end = moved.size();
  for (const auto& [row, axis] : divisions) {
    copied.push_back(whole != nullptr ? whole->targets[static_cast<std::size_t>(row)] : row);
    result.targets.insert(result.targets.end(), {copied.back(), end + std::ssize(copied) - 1});
    twice.insert(twice.end(), {row, row});
  }
  result.splats = rest.copies(twice);
  moved.append_copies(copied);
  Index half = 0;
  for (const auto& [row, axis] : divisions) {
    Eigen::Array3i depth = Eigen::Array3i::Zero();
    if (whole != nullptr) depth = whole->depths[static_cast<std::size_t>(row)];
    ++depth[axis];
    result.depths.insert(result.depths.end(), {depth, depth});
    const Vec3 shift = apart * std::exp(static_cast<double>(rest.log_scales(row, axis))) *
                       axes_of(rest.rotations.row(row)).col(axis);
    for (const int side : {-1, 1}) {
      auto center = result.splats.centers.row(half);
      center = (center.cast<double>() + side * shift.transpose()).cast<float>();
      result.splats.log_scales(half++, axis) -= std::numbers::ln2_v<float>;
    }
  }
  return result;
}

/// One round; what is left for the next.
template <class Scalar>
Round moved_round(const DeformationField& field, const GaussianSplats& rest, const Round* whole,
                  const std::vector<SplatGroup>& groups, const SplatJets<Scalar>& jets, double max_stretch,
                  GaussianSplats& moved, const Progress& progress) {
  RoundMotion<Scalar> motion(field.frame(), rest, whole != nullptr ? whole->targets.data() : nullptr,
                             whole != nullptr ? whole->depths.data() : nullptr, max_stretch, moved);
  Divisions divisions;
  for (std::size_t g = 0; g < groups.size(); ++g) {
    progress.report(static_cast<double>(g) / static_cast<double>(groups.size()));
    JetBlock<Scalar> first(std::ssize(groups[g].rows), JetOrder::first);
    jets(g, first.view());
    motion.move(groups[g], std::as_const(first).view());
    if (!std::isfinite(max_stretch)) continue;
    JetBlock<Scalar> second(std::ssize(groups[g].broad), JetOrder::second);
    if (second.view().count > 0) jets(g, second.view());
    motion.divide(groups[g], std::as_const(second).view(), divisions);
  }
  std::sort(divisions.begin(), divisions.end());
  return divisions.empty() ? Round() : halves(rest, whole, divisions, moved);
}

}  // namespace

std::vector<SplatGroup> SplatGroup::of(const GaussianSplats& splats, double scale) {
  std::vector<SplatGroup> groups;
  if (splats.size() == 0) return groups;
  const std::vector<std::uint32_t> order = morton_order(splats.centers.cast<double>());
  const float broadest = static_cast<float>(std::log(wide * scale));
  for (Index first = 0; first < splats.size(); first += group_size) {
    SplatGroup group;
    group.rows.assign(order.begin() + first, order.begin() + std::min(first + group_size, splats.size()));
    for (std::size_t i = 0; i < group.rows.size(); ++i)
      if (splats.log_scales.row(group.rows[i]).maxCoeff() > broadest)
        group.broad.push_back(static_cast<Index>(i));
    groups.push_back(std::move(group));
  }
  return groups;
}

SplatJets<double> jets_of(const DeformationField& field, const GaussianSplats& rest,
                          const std::vector<SplatGroup>& groups) {
  return [&](std::size_t g, JetView<double> out) {
    field.evaluate(field.frame().to_cube(groups[g].places(rest, out.order)), out);
  };
}

Points SplatGroup::places(const GaussianSplats& rest, JetOrder order) const {
  if (order == JetOrder::first) return rest.centers(rows, Eigen::all).cast<double>();
  Points result(std::ssize(broad), 3);
  for (Index k = 0; k < result.rows(); ++k)
    result.row(k) =
        rest.centers.row(rows[static_cast<std::size_t>(broad[static_cast<std::size_t>(k)])]).cast<double>();
  return result;
}

template <class Scalar>
GaussianSplats moved_groups(GaussianSplats moved, const DeformationField& field, const GaussianSplats& rest,
                            const std::vector<SplatGroup>& groups, const SplatJets<Scalar>& jets,
                            double max_stretch, const Progress& progress) {
  moved.be_places_of(rest);
  Round left =
      moved_round<Scalar>(field, rest, nullptr, groups, jets, max_stretch, moved, progress.part(0.0, 0.5));
  for (int round = 1; left.splats.size() > 0; ++round) {
    const double share = 1.0 - std::ldexp(1.0, -round);  // of the progress that earlier rounds have
    const std::vector<SplatGroup> again = SplatGroup::of(left.splats, field.frame().scale);
    const double most = round < rounds ? max_stretch : std::numeric_limits<double>::infinity();
    left = moved_round<double>(field, left.splats, &left, again, jets_of(field, left.splats, again), most,
                               moved, progress.part(share, share + std::ldexp(1.0, -round - 1)));
  }
  return moved;
}
template GaussianSplats moved_groups(GaussianSplats, const DeformationField&, const GaussianSplats&,
                                     const std::vector<SplatGroup>&, const SplatJets<float>&, double,
                                     const Progress&);
template GaussianSplats moved_groups(GaussianSplats, const DeformationField&, const GaussianSplats&,
                                     const std::vector<SplatGroup>&, const SplatJets<double>&, double,
                                     const Progress&);

}  // namespace arapfields
