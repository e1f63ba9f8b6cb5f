// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <optional>

#include "energies/gauss.h"
#include "energies/handles.h"
#include "mesh/surface_samples.h"
#include "solve/training_loop.h"

namespace arapfields {

/// What a deformation is asked for, as weights of the terms:
///   rigidity·(stretch + bending·bend) + gauss·mean(1 − g) + barrier·fold_barrier + handles.
struct ObjectiveTerms {
  Index batch = 300;
  Index fresh = 0;  ///< of the batch, samples that the surface is asked for anew; needs samples.redraw
  double rigidity = 1.0, bending = 0.01;
  std::optional<GaussPreference> preference;
  double gauss = 0.0;
  Vector preference_weights;  ///< a weight a sample; empty: all 1
  double barrier = 0.0, barrier_threshold = 0.1;
  BoundHandles handles;
  double handle_weight = 100.0;
  Index handle_batch = 256;
};

/// Estimates the terms on random subsets of the samples: the samples are put in spatial order and one is
/// drawn from each of `batch` equal stretches of it, which covers the surface more evenly than independent
/// draws. Jets are of the lowest order that the terms allow; handles need values alone.
class FieldObjective final : public Objective {
 public:
  FieldObjective(const SurfaceSamples& samples, ObjectiveTerms terms);
  double accumulate(TrainableField& field, Random& random) override;
  const ObjectiveTerms& terms() const { return terms_; }

 private:
  template <class Scalar>
  double accumulate_as(TrainableField& field, Random& random);
  template <class Scalar>
  double surface_terms(TrainableField& field, Random& random);
  template <class Scalar>
  double handle_terms(TrainableField& field, Random& random) const;

  /// The next fresh sample; draws another pool of as many as there are samples when one is used up.
  Index next_fresh(Random& random);

  const SurfaceSamples& samples_;
  ObjectiveTerms terms_;
  std::vector<std::uint32_t> order_;
  SurfaceSamples pool_;
  Index used_ = 0;
};

}  // namespace arapfields
