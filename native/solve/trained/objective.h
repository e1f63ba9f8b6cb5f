// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <functional>
#include <memory>
#include <optional>
#include <string>

#include "core/random.h"
#include "energies/handles.h"
#include "fields/field.h"
#include "fields/neural_field.h"
#include "mesh/surface_samples.h"
#include "optimize/training_loop.h"
#include "options/handles.h"
#include "solve/jet_terms.h"
#include "solve/surface_stiffness.h"
#include "tensors/views.h"

namespace arapfields {

class Tensor;

/// A loss of a trainable field, estimated anew at each iteration on a random subset.
class Objective {
 public:
  virtual ~Objective() = default;
  /// Adds the gradient of the estimate to field.gradient(); returns the estimate, a scalar on the device
  /// where it was computed.
  virtual Tensor accumulate(TrainableField& field, Random& random) = 0;
  /// The weighted terms of the last estimate, whose sum it is.
  virtual std::vector<LossTerm> terms() const { return {}; }
};

/// Called with the number of finished iterations after each of them.
using LoopObserver = std::function<void(int)>;

/// The parameters of a field, as an optimizer takes them.
inline Trainable trainable(TrainableField& field) {
  return {field.parameters(), field.gradient(), field.matrices()};
}

/// Minimises by run_training(), with random numbers of the options' seed. What it returns is finite at the
/// field's rest points.
LoopResult minimise(TrainableField& field, Objective& objective, const LoopOptions& options,
                    const Progress& progress, const LoopObserver& observer = {});

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

// Helpers of the two objectives that train an inverse (inverse_training, invertible_objective).

inline Points uniform_in(const Vec3& low, const Vec3& high, Index count, Random& random) {
  Points points(count, 3);
  for (Index p = 0; p < count; ++p)
    for (int i = 0; i < 3; ++i) points(p, i) = random.uniform(low[i], high[i]);
  return points;
}

/// Rows J_pᵀ r_p.
inline Tensor transposed_times(const Tensor& jets, const Tensor& residuals) {
  return sum(jets.slice(0, first_column(0), first_column(3)) * residuals, {2}).t();
}

class Tensor;

/// An inner objective plus weight · mean ‖g(f(x)) − x‖² over samples and uniform points of the cube, with a
/// network g ≈ f⁻¹ that is trained alongside f. Where f folds no inverse exists, so the term penalises folds.
class InvertibleObjective final : public Objective {
 public:
  InvertibleObjective(Objective& inner, const SurfaceSamples& samples, Index batch, double weight,
                      const MlpShape& shape, const LoopOptions& options, const std::string& device);
  Tensor accumulate(TrainableField& field, Random& random) override;
  std::vector<LossTerm> terms() const override;

 private:
  Objective& inner_;
  const SurfaceSamples& samples_;
  Index batch_;
  double weight_;
  LoopOptions options_;
  int done_ = 0;
  NeuralField inverse_;
  Optimizer optimizer_;
  std::shared_ptr<Tensor> cycle_;  // the last estimate of the weighted term
};

}  // namespace arapfields
