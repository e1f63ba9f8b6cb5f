// SPDX-License-Identifier: GPL-3.0-or-later
#include "backends/tensor_operations.h"

#include "core/random.h"
#include "tensors/dense.h"
#include "tensors/views.h"

namespace arapfields {
namespace {

class Operations {
 public:
  explicit Operations(NumberType type) : type_(type) {}

  std::vector<OperationResult> run() {
    views();
    in_place();
    elements();
    reductions();
    selections();
    products();
    factors();
    return std::move(results_);
  }

 private:
  Tensor draw(SizeList sizes) {
    const Tensor tensor = empty(sizes, NumberType::float64);
    for (Index i = 0; i < tensor.count(); ++i) tensor.data<double>()[i] = random_.uniform(-2.0, 2.0);
    return tensor.to(type_);
  }
  Tensor positive(SizeList sizes) { return abs(draw(sizes)) + 0.1; }

  void keep(const std::string& name, const Tensor& tensor) {
    const Vector values = vector_of(tensor);
    results_.push_back({name, {values.begin(), values.end()}});
    for (Index d = 0; d < tensor.dims(); ++d)
      results_.back().values.push_back(static_cast<double>(tensor.size(d)));
  }

  void views() {
    const Tensor a = draw({4, 5, 6});
    keep("narrow", a.narrow(1, 1, 3));
    keep("slice", a.slice(-1, 2, 5));
    keep("from", a.from(0, 1));
    keep("select", a.select(1, 2));
    keep("[]", a[3]);
    keep("transpose", a.transpose(0, 2));
    keep("t", a[0].t());
    keep("permute", a.permute({2, 0, 1}));
    keep("unsqueeze", a.unsqueeze(-1).unsqueeze(1));
    keep("expand", a.narrow(1, 0, 1).expand({4, 3, 6}));
    keep("view", a.view({-1, 10}));
    keep("view_like", a.view_like(draw({6, 20})));
    keep("reshape", a.transpose(0, 1).reshape({10, -1}));
    keep("flat", a.flat());
    keep("clone", a.permute({1, 2, 0}).clone());
    keep("to", a.to(NumberType::float64).to(NumberType::float32));
    keep("bfloat16", a.to(NumberType::float32).to(NumberType::bfloat16));
  }

  void in_place() {
    const Tensor b = draw({3, 4}), row = draw({4}), column = positive({3, 1}), wide = draw({4, 3}).t();
    const auto changed = [&](const std::string& name, const auto& change) {
      const Tensor dense = draw({3, 4}), strided = draw({4, 3}).t();
      change(dense), keep(name, dense);
      change(strided), keep(name + " strided", strided);
    };
    changed("assign", [&](const Tensor& a) { a.assign(row); });
    changed("assign converted", [&](const Tensor& a) { a.assign(wide.to(NumberType::float64)); });
    changed("fill", [&](const Tensor& a) { a.fill(0.3); });
    changed("add", [&](const Tensor& a) { a.add(wide, -0.7); });
    changed("+=", [&](const Tensor& a) { (a += row) += 0.25; });
    changed("-=", [&](const Tensor& a) { a -= column; });
    changed("*=", [&](const Tensor& a) { (a *= b) *= 1.5; });
    changed("/=", [&](const Tensor& a) { (a /= column) /= 3.0; });
    changed("add_product", [&](const Tensor& a) { a.add_product(b, row, 0.4); });
    changed("add_quotient", [&](const Tensor& a) { a.add_quotient(b, column, -0.4); });
    changed("multiply_elements", [&](const Tensor& a) { multiply_elements(a, wide, row); });
  }

  void elements() {
    const Tensor a = draw({3, 4, 5}), b = draw({4, 1}), c = draw({3, 1, 5}), p = positive({3, 4, 5});
    keep("+", a + b), keep("-", a - b), keep("*", c * b), keep("/", c / p);
    keep("numbers", (2.0 * (a + 0.5) / 3.0 - 1.0) * (1.0 / p) + (0.5 - a) + -c);
    keep("hypot", hypot(a, b)), keep("copysign", copysign(p, a));
    keep("abs", abs(a)), keep("sign", sign(a)), keep("square", square(a)), keep("sqrt", sqrt(p));
    keep("rsqrt", rsqrt(p)), keep("reciprocal", reciprocal(p)), keep("exp", exp(a)), keep("log1p", log1p(p));
    keep("sigmoid", sigmoid(a)), keep("sin", sin(a)), keep("cos", cos(a)),
        keep("clamp_min", clamp_min(a, 0.2));
    keep("where_positive", where_positive(a, p, c));
    keep("zeros", zeros({2, 3}, a) + zeros_like(b.view({4, 1, 1})));
    keep("ones", ones({2, 1}, a) + ones_like(b.view({1, 4})));
    keep("scalar", scalar(0.25));
  }

  void reductions() {
    const Tensor a = draw({3, 40, 5}), gap = a.transpose(0, 1);
    keep("sum", sum(a)), keep("sum strided", sum(gap));
    for (Index d = 0; d < 3; ++d) keep("sum of one", sum(gap, {d})), keep("sum kept", sum(a, {d}, true));
    keep("sum of two", sum(a, {0, 2})), keep("sum of the last two", sum(gap, {1, 2}, true));
    keep("mean", mean(gap)), keep("max", max(a)), keep("max of rows", max(a, 1)), keep("norm", norm(gap));
    keep("argmax", argmax(a)), keep("argmax strided", argmax(gap));
    const Tensor finite = draw({9});
    keep("all_finite", scalar(all_finite(finite) ? 1.0 : 0.0));
    finite.narrow(0, 4, 1).fill(1.0 / 0.0);
    keep("infinite", scalar(all_finite(finite) ? 1.0 : 0.0));
  }

  void selections() {
    const Tensor a = draw({4, 5, 6});
    const std::vector<Index> rows{3, 0, 0, 2};
    const Tensor which = tensor_view(rows.data(), {4});
    for (Index d = 0; d < 3; ++d) keep("index_select", index_select(a, d, which));
    keep("index_select strided", index_select(a.transpose(0, 2), 1, which));
    for (Index d = -1; d < 4; ++d) keep("stack", stack({a, 2.0 * a}, d));
    keep("cross", cross(draw({7, 3}), draw({1, 3}).expand({7, 3})));
  }

  /// A matrix with contiguous rows, with contiguous columns, with gaps.
  std::vector<Tensor> layouts(Index rows, Index columns) {
    return {draw({rows, columns}), draw({columns, rows}).t(), draw({rows, columns + 3}).narrow(1, 1, columns),
            draw({rows, columns, 2}).select(2, 1)};
  }

  void products() {
    const Index shapes[][3] = {{1, 1, 1}, {1, 7, 5}, {6, 1, 4},     {5, 3, 1},      {17, 9, 31},
                               {0, 3, 2}, {3, 2, 0}, {70, 65, 130}, {130, 200, 67}, {512, 24, 40}};
    for (const auto& [m, n, k] : shapes)
      for (const Tensor& a : layouts(m, k))
        for (const Tensor& b : layouts(k, n)) keep("product", product(a, b));
    for (const Tensor& c : layouts(33, 20)) {
      const Tensor a = draw({33, 48}), b = draw({20, 48}).t();
      multiply(c, a, b), keep("multiply", c);
      multiply(c, a, b, -0.5, 0.25), keep("multiply scaled", c);
      add_multiplied(c, a, b), keep("add_multiplied", c);
    }
    keep("batch_product", batch_product(draw({6, 3, 4}), draw({6, 5, 4}).transpose(1, 2)));
    const Tensor a = draw({40, 70}).to(NumberType::float32), b = draw({70, 30}).to(NumberType::float32);
    keep("product in bfloat16", product(a.to(NumberType::bfloat16), b.to(NumberType::bfloat16)));
  }

  void factors() {
    for (const Index n : {1, 4, 60, 200}) {
      const Tensor root = draw({n, n + 5});
      Tensor matrix = product(root, root.t());
      for (Index i = 0; i < n; ++i) matrix[i].narrow(0, i, 1) += static_cast<double>(n);
      const Tensor lower = cholesky_factor(matrix), b = draw({n, 3});
      keep("cholesky_factor", lower);
      keep("lower, left", solve_triangular(lower, b, false, Side::left));
      keep("upper, left", solve_triangular(lower.t(), b, true, Side::left));
      keep("upper, right", solve_triangular(lower.t(), draw({7, n}), true, Side::right));
      keep("lower, right", solve_triangular(lower, draw({n, 7}).t(), false, Side::right));
      keep("solve_by_factor", solve_by_factor(lower, b));
      matrix[n - 1].narrow(0, n - 1, 1).fill(-1.0);
      keep("not definite", scalar(cholesky_factor(matrix).defined() ? 1.0 : 0.0));
    }
    if (type_ == NumberType::float64)
      dense<double>();
    else
      dense<float>();
  }

  template <class Scalar>
  void dense() {
    const auto matrix = [&](Index rows, Index columns) -> RowMatrix<Scalar> {
      const Tensor numbers = draw({rows, columns});
      return Eigen::Map<const RowMatrix<Scalar>>(numbers.data<Scalar>(), rows, columns);
    };
    const RowMatrix<Scalar> a = matrix(300, 210);
    RowMatrix<Scalar> c = matrix(210, 210);
    gemm<Scalar>(Transpose::yes, Transpose::no, Scalar(0.5), a, a, Scalar(2), c);
    keep("gemm", tensor_view(c));
    RowMatrix<Scalar> gram = RowMatrix<Scalar>::Zero(210, 210);
    lower_gram<Scalar>(Transpose::yes, a, Scalar(0), gram);
    gram.diagonal().array() += Scalar(300);
    gram = gram.template triangularView<Eigen::Lower>();
    keep("lower_gram", tensor_view(gram));
    const RowMatrix<Scalar> lower = cholesky<Scalar>(gram), right = matrix(210, 4);
    keep("cholesky", tensor_view(lower));
    keep("lower_inverse", tensor_view(lower_inverse<Scalar>(lower)));
    keep("cholesky_solve", tensor_view(cholesky_solve<Scalar>(lower, right)));
  }

  NumberType type_;
  Random random_{1, 0x7e50};
  std::vector<OperationResult> results_;
};

}  // namespace

std::vector<OperationResult> run_tensor_operations(bool double_precision) {
  return Operations(double_precision ? NumberType::float64 : NumberType::float32).run();
}

}  // namespace arapfields
