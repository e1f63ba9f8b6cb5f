// SPDX-License-Identifier: GPL-3.0-or-later
// What the parts of the library that need no torch ask of those that do, by the standard library and Eigen.
#include <Eigen/Cholesky>
#include <algorithm>
#include <thread>

#include "core/dense.h"
#include "core/device.h"
#include "core/errors.h"
#include "core/torch_threads.h"
#include "fields/field.h"

namespace at {
class Tensor {};
}  // namespace at

namespace arapfields {
namespace {

thread_local int threads = 0;  // 0: as many as the processor has

}  // namespace

int torch_threads() {
  return threads > 0 ? threads : std::max(1, static_cast<int>(std::thread::hardware_concurrency()));
}

SerialTorch::SerialTorch() : openmp_(threads), mkl_(0) { threads = 1; }

SerialTorch::~SerialTorch() { threads = openmp_; }

void keep_torch_serial() { threads = 1; }

std::string resolve_device(const std::string& device) {
  require(device == "cpu" || device == "auto", "device", "'" + device + "'", "there is no torch here");
  return "cpu";
}

at::Tensor DeformationField::jets(const at::Tensor&, JetOrder) const {
  throw InvalidInput("there is no torch here");
}

template <class Scalar>
void gemm(Transpose transpose_a, Transpose transpose_b, Scalar alpha,
          const Eigen::Ref<const RowMatrix<Scalar>>& a, const Eigen::Ref<const RowMatrix<Scalar>>& b,
          Scalar beta, Eigen::Ref<RowMatrix<Scalar>> c) {
  const RowMatrix<Scalar> left = transpose_a == Transpose::yes ? a.transpose() : RowMatrix<Scalar>(a);
  const RowMatrix<Scalar> right = transpose_b == Transpose::yes ? b.transpose() : RowMatrix<Scalar>(b);
  if (beta == Scalar(0)) c.setZero();
  c = beta * c + alpha * (left * right);
}

template <class Scalar>
void lower_gram(Transpose transpose_a, const Eigen::Ref<const RowMatrix<Scalar>>& a, Scalar beta,
                Eigen::Ref<RowMatrix<Scalar>> c) {
  const Transpose other = transpose_a == Transpose::yes ? Transpose::no : Transpose::yes;
  gemm<Scalar>(transpose_a, other, Scalar(1), a, a, beta, c);
}

template <class Scalar>
RowMatrix<Scalar> cholesky(const Eigen::Ref<const RowMatrix<Scalar>>& a) {
  const Eigen::LLT<RowMatrix<Scalar>> factor(a);
  require(factor.info() == Eigen::Success, "matrix", "it is not positive definite",
          "a symmetric positive definite matrix is needed");
  return factor.matrixL();
}

template <class Scalar>
RowMatrix<Scalar> lower_inverse(const Eigen::Ref<const RowMatrix<Scalar>>& factor) {
  const auto size = factor.rows();
  return factor.template triangularView<Eigen::Lower>().solve(RowMatrix<Scalar>::Identity(size, size));
}

template <class Scalar>
RowMatrix<Scalar> cholesky_solve(const Eigen::Ref<const RowMatrix<Scalar>>& factor,
                                 const Eigen::Ref<const RowMatrix<Scalar>>& b) {
  const RowMatrix<Scalar> half = factor.template triangularView<Eigen::Lower>().solve(b);
  return factor.transpose().template triangularView<Eigen::Upper>().solve(half);
}

#define ARAPFIELDS_DENSE(Scalar)                                                                       \
  template void gemm<Scalar>(Transpose, Transpose, Scalar, const Eigen::Ref<const RowMatrix<Scalar>>&, \
                             const Eigen::Ref<const RowMatrix<Scalar>>&, Scalar,                       \
                             Eigen::Ref<RowMatrix<Scalar>>);                                           \
  template void lower_gram<Scalar>(Transpose, const Eigen::Ref<const RowMatrix<Scalar>>&, Scalar,      \
                                   Eigen::Ref<RowMatrix<Scalar>>);                                     \
  template RowMatrix<Scalar> cholesky<Scalar>(const Eigen::Ref<const RowMatrix<Scalar>>&);             \
  template RowMatrix<Scalar> lower_inverse<Scalar>(const Eigen::Ref<const RowMatrix<Scalar>>&);        \
  template RowMatrix<Scalar> cholesky_solve<Scalar>(const Eigen::Ref<const RowMatrix<Scalar>>&,        \
                                                    const Eigen::Ref<const RowMatrix<Scalar>>&);
ARAPFIELDS_DENSE(float)
ARAPFIELDS_DENSE(double)

}  // namespace arapfields
