// SPDX-License-Identifier: GPL-3.0-or-later
#include "optimize/muon.h"

#include <ATen/ATen.h>
#include <ATen/core/LegacyTypeDispatch.h>

#include <algorithm>
#include <cmath>
#include <vector>

#include "core/aten_path.h"
#include "core/parallel.h"

namespace arapfields {
namespace {

// p(s) = a s + b s³ + c s⁵ drives singular values in (0,1] to about 1 (0.7 to 1.2): the coefficients of
// Jordan et al., chosen for the slope at 0 rather than for the limit.
constexpr double slope = 3.4445, cubic = -4.7750, quintic = 2.0315;
constexpr Index rows_a_task = 64;

/// One weight matrix. `x` is the momentum with its shorter side as rows.
struct Matrix : MatrixPlace {
  at::Tensor momentum, x, next, gram, polynomial;
};

struct Task {
  Matrix* matrix = nullptr;
  Index first = 0, count = 0;  // rows of x

  at::Tensor rows_of(const at::Tensor& matrix_like) const { return matrix_like.narrow(0, first, count); }
  /// A symmetric product's rows are computed up to the diagonal; this fills in the columns above.
  at::Tensor up_to_diagonal(const at::Tensor& symmetric) const {
    return rows_of(symmetric).narrow(1, 0, first + count);
  }
  void mirror(const at::Tensor& symmetric) const {
    if (first > 0)
      symmetric.narrow(0, 0, first).narrow(1, first, count).copy_(rows_of(symmetric).narrow(1, 0, first).t());
  }
};

}  // namespace

struct Muon::State {
  MuonOptions options;
  AdamStep adam;
  std::vector<Matrix> matrices;
  std::vector<Task> tasks;
  bool on_device = false;  // whose queue is filled by one thread

  void for_each_task(const std::function<void(const Task&)>& body);
  void for_each_matrix(const std::function<void(Matrix&)>& body);

 private:
  template <class Items, class Body>
  void for_each(Items& items, const Body& body) const {
    const auto one = [&](Index i) {
      const at::AutoDispatchBelowADInplaceOrView quick;
      body(items[static_cast<std::size_t>(i)]);
    };
    const auto count = static_cast<Index>(items.size());
    if (!on_device) return parallel_jobs(count, one);
    for (Index i = 0; i < count; ++i) one(i);
  }
};

void Muon::State::for_each_task(const std::function<void(const Task&)>& body) { for_each(tasks, body); }

void Muon::State::for_each_matrix(const std::function<void(Matrix&)>& body) { for_each(matrices, body); }

Muon::Muon(const at::Tensor& parameters, const std::vector<MatrixPlace>& matrices, const MuonOptions& options)
    : state_(std::make_unique<State>(
          State{options, AdamStep(parameters, options.adam), {}, {}, on_aten_path(parameters)})) {
  const ThreadScope scope;
  const at::TensorOptions like = parameters.options();
  for (const MatrixPlace& place : matrices) {
    Matrix m;
    static_cast<MatrixPlace&>(m) = place;
    const Index small = std::min(m.rows, m.columns), large = std::max(m.rows, m.columns);
    m.momentum = at::zeros({m.rows, m.columns}, like);
    m.x = at::empty({small, large}, like);
    m.next = at::empty({small, large}, like);
    m.gram = at::empty({small, small}, like);
    m.polynomial = at::empty({small, small}, like);
    state_->matrices.push_back(m);
  }
  // The last rows first: their symmetric products are the longest.
  for (Matrix& m : state_->matrices) {
    const Index rows = m.x.size(0), each = state_->on_device ? rows : rows_a_task;
    for (Index first = (rows - 1) / each * each; first >= 0; first -= each)
      state_->tasks.push_back({&m, first, std::min(each, rows - first)});
  }
}

Muon::~Muon() = default;
Muon::Muon(Muon&&) noexcept = default;
Muon& Muon::operator=(Muon&&) noexcept = default;

void Muon::step(at::Tensor& parameters, at::Tensor& gradient, double learning_rate) {
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
  adam_up_to(parameters.numel());
  s.for_each_matrix([&](Matrix& m) {
    const at::Tensor g = gradient.slice(0, m.begin, m.end()).view({m.rows, m.columns});
    m.momentum.mul_(s.options.momentum).add_(g);
    const at::Tensor ahead = at::add(g, m.momentum, s.options.momentum);
    m.x.copy_(m.rows > m.columns ? ahead.t() : ahead);
    m.x.div_(at::norm(ahead).add_(1e-30));
  });
  for (int i = 0; i < s.options.iterations; ++i) {
    s.for_each_task([](const Task& t) {
      const at::Tensor& x = t.matrix->x;
      at::Tensor out = t.up_to_diagonal(t.matrix->gram);
      at::mm_out(out, t.rows_of(x), x.narrow(0, 0, t.first + t.count).t());
      t.mirror(t.matrix->gram);
    });
    s.for_each_task([](const Task& t) {
      const at::Tensor& gram = t.matrix->gram;
      at::Tensor out = t.up_to_diagonal(t.matrix->polynomial);
      at::addmm_out(out, t.up_to_diagonal(gram), t.rows_of(gram), gram.narrow(1, 0, t.first + t.count), cubic,
                    quintic);
      t.mirror(t.matrix->polynomial);
    });
    s.for_each_task([](const Task& t) {
      at::Tensor out = t.rows_of(t.matrix->next);
      at::addmm_out(out, t.rows_of(t.matrix->x), t.rows_of(t.matrix->polynomial), t.matrix->x, slope, 1.0);
    });
    for (Matrix& m : s.matrices) std::swap(m.x, m.next);
  }
  s.for_each_matrix([&](Matrix& m) {
    const double stretch =
        std::sqrt(std::max(1.0, static_cast<double>(m.rows) / static_cast<double>(m.columns)));
    at::Tensor weight = parameters.slice(0, m.begin, m.end()).view({m.rows, m.columns});
    weight.sub_(m.rows > m.columns ? m.x.t() : m.x, learning_rate * stretch);
  });
}

}  // namespace arapfields
