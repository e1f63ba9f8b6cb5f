// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <memory>
#include <optional>

#include "energies/handles.h"
#include "mesh/surface_samples.h"
#include "options/handles.h"
#include "solve/jet_terms.h"
#include "solve/surface_stiffness.h"
#include "solve/trained/objective.h"

namespace arapfields {

class Tensor;

/// The terms of a trained deformation: those of jets, and handles.
struct ObjectiveTerms : JetTermSettings {
  Index batch = 0;             ///< samples an iteration
  Index estimates = 0;         ///< in a whole training, at most
  Index fresh = 0;             ///< number of the batch's samples that samples.redraw draws anew
  SurfaceStiffness stiffness;  ///< λ
  Vector weights;              ///< w, one a sample; empty: all 1
  BoundHandles handles;
  HandleOptions pull;
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
  TermBatch draw(Random& random);
  void ease_locality();
  bool pulled() const { return terms_.handles.count() > 0 && terms_.pull.handle_weight != 0.0; }
  template <class Scalar>
  double by_kernels(TrainableField& field, Random& random);
  Tensor by_compositions(TrainableField& field, Random& random);
  /// Calls call(term) for each term of jets.
  template <class Call>
  void for_terms(Call&& call) const;

  /// Row of `pool_` of the next fresh sample; redraws the pool, as large as the samples, when it is used up.
  Index next_fresh(Random& random);

  const SurfaceSamples& samples_;
  ObjectiveTerms terms_;
  std::vector<std::uint32_t> order_;
  Vector bending_;  // λ of the samples
  SurfaceSamples pool_;
  Vector pool_bending_;
  Index used_ = 0;
  Index estimated_ = 0, eased_ = -1;
  JetTermList list_;
  std::unique_ptr<EnergyTables> tables_;  // on the field's device
  // The last estimate's weighted terms, where they were computed.
  std::vector<LossTerm> parts_;
  std::vector<ComposedPart> composed_parts_;
};

}  // namespace arapfields
