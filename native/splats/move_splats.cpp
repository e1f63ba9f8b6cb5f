// SPDX-License-Identifier: GPL-3.0-or-later
#include "splats/move_splats.h"

#include <mutex>
#include <typeinfo>

#include "core/errors.h"
#include "core/parallel.h"
#include "fields/radial_evaluator.h"
#include "fields/radial_field.h"
#include "splats/splat_motion.h"

namespace arapfields {
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
