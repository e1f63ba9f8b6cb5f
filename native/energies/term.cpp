// SPDX-License-Identifier: GPL-3.0-or-later
#include "energies/term.h"

#include "energies/composed_energies.h"
#include "tensors/views.h"

namespace arapfields {
namespace {

class ScaledTerm final : public JetTerm {
 public:
  ScaledTerm(std::shared_ptr<JetTerm> term, double factor) : term_(std::move(term)), factor_(factor) {}
  std::string name() const override { return term_->name(); }
  JetOrder order() const override { return term_->order(); }
  void set_batch(const TermBatch& batch) override { term_->set_batch(batch); }
  double evaluate(const JetView<const float>& jets, const JetView<float>& cotangents,
                  std::vector<LossTerm>* parts) const override {
    return value(jets, cotangents, parts);
  }
  double evaluate(const JetView<const double>& jets, const JetView<double>& cotangents,
                  std::vector<LossTerm>* parts) const override {
    return value(jets, cotangents, parts);
  }

 private:
  template <class Scalar>
  double value(const JetView<const Scalar>& jets, const JetView<Scalar>& cotangents,
               std::vector<LossTerm>* parts) const {
    const bool slopes = cotangents.data != nullptr;
    JetBlock<Scalar> own(slopes ? jets.count : 0, cotangents.order);
    std::vector<LossTerm> listed;
    const double result = term_->evaluate(jets, slopes ? own.view() : JetView<Scalar>{}, &listed);
    if (slopes)
      Eigen::Map<Eigen::VectorX<Scalar>>(cotangents.data, cotangents.size()) +=
          static_cast<Scalar>(factor_) *
          Eigen::Map<const Eigen::VectorX<Scalar>>(own.view().data, cotangents.size());
    for (LossTerm& part : listed)
      if (parts != nullptr) parts->push_back({std::move(part.name), factor_ * part.value});
    return factor_ * result;
  }

  std::shared_ptr<JetTerm> term_;
  double factor_;
};

}  // namespace

JetTerm::~JetTerm() = default;

Tensor JetTerm::compose(const Tensor& jets, const EnergyTables&, Tensor cotangents,
                        std::vector<ComposedPart>& parts) const {
  const Tensor host = doubles_of(jets), derivatives = zeros_like(host);
  const JetOrder jet_order = static_cast<JetOrder>(host.size(0));
  const Index count = host.size(1);
  std::vector<LossTerm> own;
  const double value = evaluate(JetView<const double>{host.data<double>(), count, jet_order},
                                JetView<double>{derivatives.data<double>(), count, jet_order}, &own);
  cotangents += tensor_like(derivatives, jets);
  const auto number = [&](double of) {
    const Tensor result = zeros({}, jets);
    result += of;
    return result;
  };
  for (const LossTerm& part : own) parts.push_back({part.name, number(part.value)});
  return number(value);
}

JetOrder highest_order(const JetTerms& terms) {
  JetOrder order = JetOrder::value;
  for (const auto& term : terms)
    if (columns(term->order()) > columns(order)) order = term->order();
  return order;
}

std::shared_ptr<JetTerm> scaled(std::shared_ptr<JetTerm> term, double factor) {
  return std::make_shared<ScaledTerm>(std::move(term), factor);
}

}  // namespace arapfields
