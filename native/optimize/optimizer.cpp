// SPDX-License-Identifier: GPL-3.0-or-later
#include "optimize/optimizer.h"

#include <algorithm>
#include <cmath>
#include <optional>
#include <vector>

#include "core/parallel.h"
#include "optimize/adam_kernel.h"
#include "tensors/device.h"
#include "tensors/operations.h"

namespace arapfields {
namespace {

constexpr Index grain = 16384;

template <class Scalar>
void step_on_cpu(AdamBlock<Scalar> block, const Tensor& parameters, const Tensor& gradient,
                 const Tensor& mean, const Tensor& square, Index first, Index last) {
  parallel_for(first, last, grain, [&](Index begin, Index end) {
    AdamBlock<Scalar> part = block;
    part.parameters = parameters.data<Scalar>() + begin;
    part.gradient = gradient.data<Scalar>() + begin;
    part.mean = mean.data<Scalar>() + begin;
    part.square = square.data<Scalar>() + begin;
    part.count = end - begin;
    ARAPFIELDS_DISPATCH(adam(part));
  });
}

template <class Scalar>
AdamBlock<Scalar> block_with(const AdamOptions& options, double rate, double scale) {
  AdamBlock<Scalar> block;
  block.beta1 = static_cast<Scalar>(options.beta1);
  block.beta2 = static_cast<Scalar>(options.beta2);
  block.rate = static_cast<Scalar>(rate);
  block.scale = static_cast<Scalar>(scale);
  block.epsilon = static_cast<Scalar>(options.epsilon);
  return block;
}

}  // namespace

struct AdamStep::State {
  AdamOptions options;
  Tensor mean, square;
  int steps = 0;
};

AdamStep::AdamStep(const Tensor& parameters, const AdamOptions& options)
    : state_(std::make_unique<State>(State{options, zeros_like(parameters), zeros_like(parameters), 0})) {}
AdamStep::~AdamStep() = default;
AdamStep::AdamStep(AdamStep&&) noexcept = default;
AdamStep& AdamStep::operator=(AdamStep&&) noexcept = default;

void AdamStep::next_step() { ++state_->steps; }

void AdamStep::step(Tensor& parameters, const Tensor& gradient, double learning_rate) {
  next_step();
  step_range(parameters, gradient, learning_rate, 0, parameters.count());
}

void AdamStep::step_range(Tensor& parameters, const Tensor& gradient, double learning_rate, Index begin,
                          Index end) {
  State& s = *state_;
  const double rate = learning_rate / (1.0 - std::pow(s.options.beta1, s.steps));
  const double scale = 1.0 / std::sqrt(1.0 - std::pow(s.options.beta2, s.steps));
  if (on_device_path(parameters)) {
    Tensor mean = s.mean.slice(0, begin, end), square = s.square.slice(0, begin, end);
    const Tensor g = gradient.slice(0, begin, end);
    (mean *= s.options.beta1).add(g, 1.0 - s.options.beta1);
    (square *= s.options.beta2).add_product(g, g, 1.0 - s.options.beta2);
    parameters.slice(0, begin, end).add_quotient(mean, sqrt(square) * scale + s.options.epsilon, -rate);
  } else if (parameters.is_double()) {
    step_on_cpu(block_with<double>(s.options, rate, scale), parameters, gradient, s.mean, s.square, begin,
                end);
  } else {
    step_on_cpu(block_with<float>(s.options, rate, scale), parameters, gradient, s.mean, s.square, begin,
                end);
  }
}

namespace {

// p(s) = a s + b s³ + c s⁵ drives singular values in (0,1] to about 1 (0.7 to 1.2): the coefficients of
// Jordan et al., chosen for the slope at 0 rather than for the limit.
constexpr double slope = 3.4445, cubic = -4.7750, quintic = 2.0315;
constexpr Index rows_a_task = 64;

/// One weight matrix. `x` is the momentum with its shorter side as rows.
struct Matrix : MatrixPlace {
  Tensor momentum, x, next, gram, polynomial;
};

struct RowsTask {
  Matrix* matrix = nullptr;
  Index first = 0, count = 0;  // rows of x

  Tensor rows_of(const Tensor& matrix_like) const { return matrix_like.narrow(0, first, count); }
  /// A symmetric product's rows are computed up to the diagonal; this fills in the columns above.
  Tensor up_to_diagonal(const Tensor& symmetric) const {
    return rows_of(symmetric).narrow(1, 0, first + count);
  }
  void mirror(const Tensor& symmetric) const {
    if (first > 0)
      symmetric.narrow(0, 0, first)
          .narrow(1, first, count)
          .assign(rows_of(symmetric).narrow(1, 0, first).t());
  }
};

}  // namespace

struct Muon::State {
  MuonOptions options;
  AdamStep adam;
  std::vector<Matrix> matrices;
  std::vector<RowsTask> tasks;
  bool on_device = false;  // then one thread fills the device's queue

  void for_each_task(const std::function<void(const RowsTask&)>& body);
  void for_each_matrix(const std::function<void(Matrix&)>& body);

 private:
  template <class Items, class Body>
  void for_each(Items& items, const Body& body) const {
    const auto one = [&](Index i) { body(items[static_cast<std::size_t>(i)]); };
    const auto count = static_cast<Index>(items.size());
    if (!on_device) return parallel_jobs(count, one);
    for (Index i = 0; i < count; ++i) one(i);
  }
};

void Muon::State::for_each_task(const std::function<void(const RowsTask&)>& body) { for_each(tasks, body); }

void Muon::State::for_each_matrix(const std::function<void(Matrix&)>& body) { for_each(matrices, body); }

Muon::Muon(const Tensor& parameters, const std::vector<MatrixPlace>& matrices, const MuonOptions& options)
    : state_(std::make_unique<State>(
          State{options, AdamStep(parameters, options.adam), {}, {}, on_device_path(parameters)})) {
  const ThreadScope scope;
  for (const MatrixPlace& place : matrices) {
    Matrix m;
    static_cast<MatrixPlace&>(m) = place;
    const Index small = std::min(m.rows, m.columns), large = std::max(m.rows, m.columns);
    m.momentum = zeros({m.rows, m.columns}, parameters);
    m.x = empty({small, large}, parameters);
    m.next = empty({small, large}, parameters);
    m.gram = empty({small, small}, parameters);
    m.polynomial = empty({small, small}, parameters);
    state_->matrices.push_back(m);
  }
  // The last rows first: they have the longest rows of the lower triangle.
  for (Matrix& m : state_->matrices) {
    const Index rows = m.x.size(0), each = state_->on_device ? rows : rows_a_task;
    for (Index first = (rows - 1) / each * each; first >= 0; first -= each)
      state_->tasks.push_back({&m, first, std::min(each, rows - first)});
  }
}

Muon::~Muon() = default;
Muon::Muon(Muon&&) noexcept = default;
Muon& Muon::operator=(Muon&&) noexcept = default;

void Muon::step(Tensor& parameters, Tensor& gradient, double learning_rate) {
  const ThreadScope scope;
  State& s = *state_;
  s.adam.next_step();
  Index done = 0;
  const auto adam_up_to = [&](Index end) {
    s.adam.step_range(parameters, gradient, s.options.adam_share * learning_rate, done, end);
  };
  for (Matrix& m : s.matrices) {
    adam_up_to(m.begin);
    done = m.end();
  }
  adam_up_to(parameters.count());
  s.for_each_matrix([&](Matrix& m) {
    const Tensor g = gradient.slice(0, m.begin, m.end()).view({m.rows, m.columns});
    (m.momentum *= s.options.momentum) += g;
    const Tensor ahead = g.clone();
    ahead.add(m.momentum, s.options.momentum);
    m.x.assign(m.rows > m.columns ? ahead.t() : ahead);
    m.x /= norm(ahead) + 1e-30;
  });
  for (int i = 0; i < s.options.iterations; ++i) {
    s.for_each_task([](const RowsTask& t) {
      const Tensor& x = t.matrix->x;
      Tensor out = t.up_to_diagonal(t.matrix->gram);
      multiply(out, t.rows_of(x), x.narrow(0, 0, t.first + t.count).t());
      t.mirror(t.matrix->gram);
    });
    s.for_each_task([](const RowsTask& t) {
      const Tensor& gram = t.matrix->gram;
      Tensor out = t.up_to_diagonal(t.matrix->polynomial);
      out.assign(t.up_to_diagonal(gram));
      multiply(out, t.rows_of(gram), gram.narrow(1, 0, t.first + t.count), quintic, cubic);
      t.mirror(t.matrix->polynomial);
    });
    s.for_each_task([](const RowsTask& t) {
      Tensor out = t.rows_of(t.matrix->next);
      out.assign(t.rows_of(t.matrix->x));
      multiply(out, t.rows_of(t.matrix->polynomial), t.matrix->x, 1.0, slope);
    });
    for (Matrix& m : s.matrices) std::swap(m.x, m.next);
  }
  s.for_each_matrix([&](Matrix& m) {
    const double stretch =
        std::sqrt(std::max(1.0, static_cast<double>(m.rows) / static_cast<double>(m.columns)));
    Tensor weight = parameters.slice(0, m.begin, m.end()).view({m.rows, m.columns});
    weight.add(m.rows > m.columns ? m.x.t() : m.x, -learning_rate * stretch);
  });
}

struct Optimizer::State {
  Trainable trained;
  std::optional<Muon> muon;
  std::optional<AdamStep> adam;
  double learning_rate = 0.0;
};

Optimizer::Optimizer(const Trainable& trained, const TrainingOptions& training,
                     const OptimizerOptions& options)
    : state_(std::make_unique<State>(State{trained, {}, {}, training.learning_rate})) {
  const AdamOptions adam{options.beta1, options.beta2, 1e-8};
  if (training.optimizer == OptimizerKind::muon && !trained.matrices.empty())
    state_->muon.emplace(trained.parameters, trained.matrices,
                         MuonOptions{options.momentum, 5, options.adam_share, adam});
  else
    state_->adam.emplace(trained.parameters, adam);
  if (state_->learning_rate == 0.0)
    state_->learning_rate =
        TrainingOptions::automatic_learning_rate(state_->muon ? OptimizerKind::muon : OptimizerKind::adam);
}

Optimizer::~Optimizer() = default;

void Optimizer::step(double share) {
  const Trainable& t = state_->trained;
  const double learning_rate = share * state_->learning_rate;
  if (state_->muon)
    state_->muon->step(t.parameters, t.gradient, learning_rate);
  else
    state_->adam->step(t.parameters, t.gradient, learning_rate);
}

}  // namespace arapfields
