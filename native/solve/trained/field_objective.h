// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <memory>
#include <optional>

#include "energies/external_energy.h"
#include "energies/handles.h"
#include "energies/stance.h"
#include "energies/style.h"
#include "mesh/surface_samples.h"
#include "options/handles.h"
#include "solve/surface_stiffness.h"
#include "solve/trained/objective.h"

namespace arapfields {

class Tensor;

/// The terms of a trained deformation, with their weights:
///   rigidity·mean w(stretch + λ·bend) + gauss·style + keep_stance·stance + barrier·fold_barrier +
///   handles + external.
struct ObjectiveTerms {
  Index batch = 0;  ///< samples an iteration
  Index fresh = 0;  ///< number of the batch's samples that samples.redraw draws anew
  double rigidity = 1.0;
  SurfaceStiffness stiffness;  ///< λ
  Vector weights;              ///< w, one a sample; empty: all 1
  double barrier = 0.0;
  double barrier_threshold = SurfaceOptions().barrier_threshold;
  StyleAtSamples style;  ///< its weights: one a sample, or empty: all 1
  double gauss = 0.0;    ///< weight of the style
  double keep_stance = 0.0;
  Stance stance;  ///< of the samples
  BoundHandles handles;
  HandleOptions pull;
  ExternalEnergies external;
};

/// Estimates the terms on random subsets of the samples, by stratified sampling: the samples are put in
/// spatial order and one is drawn from each of `batch` equal intervals of it, which covers the surface more
/// evenly than independent draws. Jets are of the lowest order that the terms allow; handles need values
/// alone. Subsets are drawn on the CPU, from the same random numbers whatever the field's device.
class FieldObjective final : public Objective {
 public:
  FieldObjective(const SurfaceSamples& samples, ObjectiveTerms terms);
  ~FieldObjective() override;
  Tensor accumulate(TrainableField& field, Random& random) override;
  std::vector<LossTerm> terms() const override;
  const ObjectiveTerms& objective_terms() const { return terms_; }

 private:
  /// Samples of one iteration: λ and w, and normals and the style's targets and weights where the terms use
  /// them.
  struct Batch {
    Points points;
    Points normals;
    Points targets;
    Vector bending;
    Vector weights;
    Vector style_weights;
    Stance stance;
  };
  /// Tensors on the field's device that do not change between batches.
  struct Constants;

  Batch draw(Random& random);
  bool styled() const { return terms_.style.any() && terms_.gauss > 0.0; }
  bool stands() const { return terms_.keep_stance > 0.0; }
  bool pulled() const { return terms_.handles.count() > 0 && terms_.pull.handle_weight != 0.0; }
  JetOrder order_of_terms() const {
    return highest_order(terms_.external, terms_.stiffness.bends() ? JetOrder::second : JetOrder::first);
  }
  template <class Scalar>
  double by_kernels(TrainableField& field, Random& random);
  Tensor by_compositions(TrainableField& field, Random& random);
  /// Adds the external energies of jets on a device, and their cotangents.
  void add_external(const Points& points, const Tensor& jets, Tensor cotangents, Tensor& value);

  /// Row of `pool_` of the next fresh sample; redraws the pool, as large as the samples, when it is used up.
  Index next_fresh(Random& random);

  const SurfaceSamples& samples_;
  ObjectiveTerms terms_;
  std::vector<std::uint32_t> order_;
  Vector bending_;  // λ of the samples
  SurfaceSamples pool_;
  Vector pool_bending_;
  Index used_ = 0;
  std::unique_ptr<Constants> constants_;
  /// The last estimate's weighted terms, on the device where they were computed.
  struct Computed;
  std::vector<Computed> computed_;
  std::vector<double> external_;  // the last estimate's external energies, weighted
};

}  // namespace arapfields
