// SPDX-License-Identifier: GPL-3.0-or-later
#include "splats/move_splats.h"

#include <algorithm>
#include <cmath>
#include <functional>
#include <mutex>
#include <numbers>
#include <numeric>
#include <typeinfo>
#include <utility>
#include <vector>

#include "core/errors.h"
#include "core/parallel.h"
#include "core/task.h"
#include "distance/morton.h"
#include "fields/field.h"
#include "fields/radial_evaluator.h"
#include "fields/radial_field.h"
#include "splats/gaussian_splats.h"
#include "splats/splat_column.h"
#include "splats/turn_kernel.h"

namespace arapfields {

/// Splats that are moved together: neighbours in space.
struct SplatGroup {
  std::vector<Index> rows;   ///< of the splats at rest
  std::vector<Index> broad;  ///< of `rows`, by their place there: those that a field may bend

  /// Centers (mesh coordinates) at which the field's jets of this order are needed: all, or the broad ones'.
  Points places(const GaussianSplats& rest, JetOrder order) const;
  /// All splats, in groups. `scale`: the cube's, in mesh units.
  static std::vector<SplatGroup> of(const GaussianSplats& splats, double scale);
};

/// Jets at a group's centers in the cube: first ones of all, or second ones of the broad.
template <class Scalar>
using SplatJets = std::function<void(std::size_t group, JetView<Scalar>)>;

/// What is moved by a field with these jets, and divided where that needs it (move_splats.h). The jets of new
/// splats are those of `field`. Memory that `moved` has is used again.
template <class Scalar>
GaussianSplats moved_groups(GaussianSplats moved, const DeformationField& field, const GaussianSplats& rest,
                            const std::vector<SplatGroup>& groups, const SplatJets<Scalar>& jets,
                            double max_stretch, const Progress& progress);

/// Centers (n,3) that are moved by a field with these jets, and what it adds to these columns
/// (PreparedSplats::changes()); none is divided.
template <class Scalar>
PointsF changed_columns(const Frame& frame, const GaussianSplats& rest, const std::vector<SplatGroup>& groups,
                        const SplatJets<Scalar>& jets, const std::vector<SplatColumn>& columns,
                        const Progress& progress);

/// Jets that the field is asked for.
SplatJets<double> jets_of(const DeformationField& field, const GaussianSplats& rest,
                          const std::vector<SplatGroup>& groups);

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

namespace {

void require_stretch(double max_stretch) {
  require(max_stretch >= 1.0, "max_stretch", number_text(max_stretch), "at least 1 is needed");
}

GaussianSplats moved_directly(const DeformationField& field, const GaussianSplats& splats, double max_stretch,
                              const Progress& progress) {
  const auto groups = SplatGroup::of(splats, field.frame().scale);
  return moved_groups(GaussianSplats(), field, splats, groups, jets_of(field, splats, groups), max_stretch,
                      progress);
}

/// What fields of one basis have in common at splats' centers.
class SplatPlaces {
 public:
  SplatPlaces(const RadialField& field, const GaussianSplats& splats, const Progress& progress)
      : field_(field), groups_(SplatGroup::of(splats, field.frame().scale)) {
    for (const SplatGroup& group : groups_) {
      progress.report(static_cast<double>(first_.size()) / static_cast<double>(groups_.size()));
      for (const JetOrder order : {JetOrder::first, JetOrder::second})
        (order == JetOrder::first ? first_ : second_)
            .emplace_back(field.basis(), field.frame().to_cube(group.places(splats, order)), order);
    }
  }
  bool serve(const RadialField& field) const { return field.shares_places_with(field_); }

  GaussianSplats moved(const RadialField& field, const GaussianSplats& splats, double max_stretch,
                       const Progress& progress, GaussianSplats into) const {
    return moved_groups(std::move(into), field, splats, groups_, jets_of(field), max_stretch, progress);
  }
  PointsF changes(const RadialField& field, const GaussianSplats& splats,
                  const std::vector<SplatColumn>& columns, const Progress& progress) const {
    return changed_columns(field.frame(), splats, groups_, jets_of(field), columns, progress);
  }

 private:
  SplatJets<float> jets_of(const RadialField& field) const {
    return [&](std::size_t g, JetView<float> out) {
      (out.order == JetOrder::first ? first_ : second_)[g].evaluate(field.coefficients(), out);
    };
  }

  RadialField field_;
  std::vector<SplatGroup> groups_;
  std::vector<RadialEvaluator<float>> first_, second_;
};

/// The field, where its places can be prepared; null for others.
const RadialField* preparable(const DeformationField& field) {
  const auto* radial =
      typeid(field) == typeid(RadialField) ? dynamic_cast<const RadialField*>(&field) : nullptr;
  return radial == nullptr || radial->influence() ? nullptr : radial;
}

}  // namespace

GaussianSplats move_splats(const DeformationField& field, const GaussianSplats& splats, double max_stretch,
                           const Progress& progress) {
  splats.validate();
  require_stretch(max_stretch);
  return moved_directly(field, splats, max_stretch, progress);
}

class PreparedSplats::State {
 public:
  explicit State(GaussianSplats splats) : splats_(std::move(splats)) { splats_.validate(); }

  std::shared_ptr<const SplatPlaces> places(const RadialField& field, const Progress& progress) const {
    {
      const std::lock_guard lock(mutex_);
      if (places_ && places_->serve(field)) return places_;
    }
    auto places = std::make_shared<const SplatPlaces>(field, splats_, progress);
    const std::lock_guard lock(mutex_);
    return places_ = std::move(places);
  }

  const GaussianSplats splats_;

 private:
  mutable std::mutex mutex_;
  mutable std::shared_ptr<const SplatPlaces> places_;
};

PreparedSplats::PreparedSplats(GaussianSplats splats) : state_(std::make_unique<State>(std::move(splats))) {}
PreparedSplats::~PreparedSplats() = default;
PreparedSplats::PreparedSplats(PreparedSplats&&) noexcept = default;

GaussianSplats PreparedSplats::moved(const DeformationField& field, double max_stretch,
                                     const Progress& progress, GaussianSplats into) const {
  require_stretch(max_stretch);
  const ThreadScope threads;
  const RadialField* radial = preparable(field);
  if (radial == nullptr) return moved_directly(field, state_->splats_, max_stretch, progress);
  return state_->places(*radial, progress.part(0.0, 0.5))
      ->moved(*radial, state_->splats_, max_stretch, progress.part(0.5, 1.0), std::move(into));
}

PointsF PreparedSplats::changes(const DeformationField& field, const std::vector<SplatColumn>& columns,
                                const Progress& progress) const {
  const GaussianSplats& splats = state_->splats_;
  const Index needed = 4 + splats.harmonics.cols();
  require(std::ssize(columns) == needed, "columns", std::to_string(columns.size()),
          std::to_string(needed) + " are needed");
  const ThreadScope threads;
  if (const RadialField* radial = preparable(field))
    return state_->places(*radial, progress.part(0.0, 0.5))
        ->changes(*radial, splats, columns, progress.part(0.5, 1.0));
  const auto groups = SplatGroup::of(splats, field.frame().scale);
  return changed_columns(field.frame(), splats, groups, jets_of(field, splats, groups), columns, progress);
}

const GaussianSplats& PreparedSplats::rest() const { return state_->splats_; }

}  // namespace arapfields
