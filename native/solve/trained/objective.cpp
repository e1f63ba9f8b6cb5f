// SPDX-License-Identifier: GPL-3.0-or-later
#include "solve/trained/objective.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <utility>

#include "core/jets.h"
#include "distance/morton.h"
#include "energies/composed_energies.h"
#include "tensors/device.h"
#include "tensors/operations.h"
#include "tensors/views.h"

namespace arapfields {
namespace {

class FieldLoop final : public LoopBody {
 public:
  FieldLoop(TrainableField& field, Objective& objective, const LoopOptions& options,
            const LoopObserver& observer)
      : field_(field),
        objective_(objective),
        options_(options),
        observer_(observer),
        random_(static_cast<std::uint64_t>(options.training.seed), 0x5eed) {}

  Tensor accumulate(int) override { return objective_.accumulate(field_, random_); }
  /// At the field's rest points, with all derivatives that a report measures.
  bool is_finite() override {
    constexpr Index rows = 1024;
    const Points& rest = field_.rest_points();
    for (Index begin = 0; begin < rest.rows(); begin += rows) {
      const Points part = rest.middleRows(begin, std::min(rows, rest.rows() - begin));
      JetBlock<double> jets(part.rows(), JetOrder::second);
      field_.evaluate(part, jets.view());
      if (!Eigen::Map<const Vector>(jets.view().data, jets.view().size()).allFinite()) return false;
    }
    return true;
  }
  std::vector<LossTerm> terms() const override { return objective_.terms(); }
  void iterated(int count) override {
    if (observer_) observer_(count);
  }
  std::string message(int count, double loss, double seconds_left) const override {
    char text[160];
    std::snprintf(text, sizeof text, "iteration %d of %d, loss %.5g, %.0f s left", count,
                  options_.training.iterations, loss, seconds_left);
    return text;
  }

 private:
  TrainableField& field_;
  Objective& objective_;
  const LoopOptions& options_;
  const LoopObserver& observer_;
  Random random_;
};

}  // namespace

LoopResult minimise(TrainableField& field, Objective& objective, const LoopOptions& options,
                    const Progress& progress, const LoopObserver& observer) {
  FieldLoop body(field, objective, options, observer);
  return run_training(trainable(field), body, options, progress);
}

namespace {

/// The field's jets in main memory and a zero block for their cotangents, which pull_back() hands over.
template <class Scalar>
struct HostJets {
  HostJets(TrainableField& field, const PointsOf<Scalar>& points, JetOrder order)
      : trained(field),
        jets(field.forward(tensor_view(points), order)),
        cotangents(zeros_like(jets)),
        count(points.rows()),
        jet_order(order) {}
  JetView<const Scalar> view() const { return {jets.data<Scalar>(), count, jet_order}; }
  JetView<Scalar> cotangent_view() { return {cotangents.data<Scalar>(), count, jet_order}; }
  void pull_back() { trained.pull_back(cotangents); }

  TrainableField& trained;
  Tensor jets, cotangents;
  Index count;
  JetOrder jet_order;
};

JetTermSettings with_bend(JetTermSettings settings, const SurfaceStiffness& stiffness) {
  settings.bends = stiffness.bends();
  return settings;
}

// A network moves all of the shape in its first steps, and ends in the valley where these lead: so it is held
// to the rest shape most at first, however far it goes.
constexpr double eased_from = 0.3,
                 eased_until = 0.8;   // of a training: after it the options hold as they are given
constexpr double first_weight = 5.0;  // before it, relative to the weight of the options
constexpr double first_limit = 1.0;   // before it, in cube units
constexpr Index eased_stages = 32;    // between the two

/// Weight and limit fall geometrically to those given; `left` falls from 1 to 0.
LocalityOptions eased(LocalityOptions options, double left) {
  options.locality *= std::pow(first_weight, left);
  if (options.locality_limit < first_limit)
    options.locality_limit *= std::pow(first_limit / options.locality_limit, left);
  return options;
}

}  // namespace

FieldObjective::FieldObjective(const SurfaceSamples& samples, ObjectiveTerms terms)
    : samples_(samples),
      terms_(std::move(terms)),
      order_(morton_order(samples.points)),
      bending_(bending_at(samples, terms_.stiffness)),
      list_(with_bend(terms_, terms_.stiffness)) {}

FieldObjective::~FieldObjective() = default;

Index FieldObjective::next_fresh(Random& random) {
  if (used_ == pool_.size()) {
    pool_ = samples_.redraw(samples_.size(), random.bits() >> 1);
    pool_bending_ = bending_at(pool_, terms_.stiffness);
    used_ = 0;
  }
  return used_++;
}

void FieldObjective::ease_locality() {
  if (!terms_.locality.acts() || terms_.estimates == 0) return;
  const double done = static_cast<double>(estimated_++) / static_cast<double>(terms_.estimates);
  const auto stage = static_cast<Index>(
      eased_stages * std::clamp((done - eased_from) / (eased_until - eased_from), 0.0, 1.0));
  if (std::exchange(eased_, stage) == stage) return;
  JetTermSettings settings = terms_;
  settings.locality.options =
      eased(terms_.locality.options, 1.0 - static_cast<double>(stage) / static_cast<double>(eased_stages));
  list_ = JetTermList(with_bend(std::move(settings), terms_.stiffness));
}

TermBatch FieldObjective::draw(Random& random) {
  ease_locality();
  const Index available = samples_.size(), count = std::min(terms_.batch, available);
  const bool has_normals = samples_.normals.rows() == available;
  TermBatch batch{Points(count, 3), Points(has_normals ? count : 0, 3),
                  Vector(terms_.weights.size() > 0 ? count : 0), Vector(count),
                  std::vector<Index>(static_cast<std::size_t>(count), -1)};
  // Fresh samples are evenly spaced: interval b has one if ⌊b·fresh/count⌋ is below that of b + 1.
  for (Index b = 0; b < count; ++b) {
    if (terms_.fresh > 0 && b * terms_.fresh / count != (b + 1) * terms_.fresh / count) {
      const Index i = next_fresh(random);
      batch.points.row(b) = pool_.points.row(i);
      batch.bending[b] = pool_bending_[i];
      if (has_normals) batch.normals.row(b) = pool_.normals.row(i);
      if (batch.weights.size() > 0) batch.weights[b] = pool_.weights.size() > 0 ? pool_.weights[i] : 1.0;
      continue;
    }
    const double place = (static_cast<double>(b) + random.uniform()) * static_cast<double>(available) /
                         static_cast<double>(count);
    const Index i = order_[static_cast<std::size_t>(std::min(available - 1, static_cast<Index>(place)))];
    batch.rows[static_cast<std::size_t>(b)] = i;
    batch.points.row(b) = samples_.points.row(i);
    batch.bending[b] = bending_[i];
    if (has_normals) batch.normals.row(b) = samples_.normals.row(i);
    if (batch.weights.size() > 0) batch.weights[b] = terms_.weights[i];
  }
  return batch;
}

template <class Call>
void FieldObjective::for_terms(Call&& call) const {
  for (const auto& term : list_.own) call(*term);
  for (const auto& term : list_.callers) call(*term);
}

Tensor FieldObjective::accumulate(TrainableField& field, Random& random) {
  if (on_device_path(field.parameters())) return by_compositions(field, random);
  const bool wide = field.parameters().is_double();
  return scalar(wide ? by_kernels<double>(field, random) : by_kernels<float>(field, random));
}

template <class Scalar>
double FieldObjective::by_kernels(TrainableField& field, Random& random) {
  const TermBatch batch = draw(random);
  list_.set_batch(batch);
  HostJets<Scalar> jets(field, batch.points.cast<Scalar>(), list_.order());
  parts_.clear();
  double value = 0.0;
  for_terms(
      [&](const JetTerm& term) { value += term.evaluate(jets.view(), jets.cotangent_view(), &parts_); });
  jets.pull_back();
  if (!pulled()) return value;
  const HandleBatch<Scalar> pairs = terms_.handles.batch<Scalar>(terms_.pull.handle_batch, random);
  HostJets<Scalar> ends(field, pairs.sources, JetOrder::value);
  const double off =
      terms_.pull.handle_weight *
      handle_energy<Scalar>(ends.view(), pairs, terms_.pull.handle_weight, ends.cotangent_view());
  ends.pull_back();
  parts_.push_back({"handles", off});
  return value + off;
}

Tensor FieldObjective::by_compositions(TrainableField& field, Random& random) {
  const Tensor& like = field.parameters();
  if (!tables_) tables_ = std::make_unique<EnergyTables>(like);
  const TermBatch batch = draw(random);
  list_.set_batch(batch);
  const Tensor jets = field.forward_at(batch.points, list_.order());
  const Tensor cotangents = zeros_like(jets);
  composed_parts_.clear();
  const Tensor value = zeros({}, jets);
  for_terms([&](const JetTerm& term) { value += term.compose(jets, *tables_, cotangents, composed_parts_); });
  field.pull_back(cotangents);
  if (!pulled()) return value;
  const HandleBatch<double> pairs = terms_.handles.batch<double>(terms_.pull.handle_batch, random);
  const Tensor ends = field.forward_at(pairs.sources, JetOrder::value);
  const Tensor pull = zeros_like(ends);
  const Tensor off = terms_.pull.handle_weight * composed_handles(ends, tensor_like(pairs.targets, like),
                                                                  tensor_like(pairs.weights, like),
                                                                  terms_.pull.handle_weight, pull);
  composed_parts_.push_back({"handles", off});
  value += off;
  field.pull_back(pull);
  return value;
}

std::vector<LossTerm> FieldObjective::terms() const {
  std::vector<LossTerm> result = parts_;
  for (const ComposedPart& part : composed_parts_) result.push_back({part.name, part.value.number()});
  return result;
}

InvertibleObjective::InvertibleObjective(Objective& inner, const SurfaceSamples& samples, Index batch,
                                         double weight, const MlpShape& shape, const LoopOptions& options,
                                         const std::string& device)
    : inner_(inner),
      samples_(samples),
      batch_(batch),
      weight_(weight),
      options_(options),
      inverse_(shape, static_cast<std::uint64_t>(options.training.seed) + 1, false, device),
      optimizer_(trainable(inverse_), options.training, options.optimizer) {}

Tensor InvertibleObjective::accumulate(TrainableField& field, Random& random) {
  const Tensor inner = inner_.accumulate(field, random);
  Points x = uniform_in(-Vec3::Ones(), Vec3::Ones(), batch_, random);
  for (Index p = 0; p < batch_ / 2; ++p) x.row(p) = samples_.points.row(random.below(samples_.size()));
  const Tensor images = field.forward_at(x, JetOrder::value)[0];
  const Tensor jets = inverse_.forward(images, JetOrder::first);
  const Tensor residual = jets[0] - tensor_like(x, jets);
  const double scale = weight_ / static_cast<double>(batch_);
  Tensor inverse_cotangents = zeros_like(jets);
  inverse_cotangents[0].assign(residual * (2.0 / static_cast<double>(batch_)));
  field.pull_back((2.0 * scale * transposed_times(jets, residual)).unsqueeze(0));
  inverse_.gradient().set_zero();
  inverse_.pull_back(inverse_cotangents);
  const double done = static_cast<double>(done_) / std::max(1, options_.training.iterations);
  optimizer_.step(options_.schedule.share(done_++, done));
  cycle_ = std::make_shared<Tensor>(scale * sum(square(residual)));
  return inner + *cycle_;
}

std::vector<LossTerm> InvertibleObjective::terms() const {
  std::vector<LossTerm> terms = inner_.terms();
  if (cycle_) terms.push_back({"invertibility", cycle_->number()});
  return terms;
}

}  // namespace arapfields
