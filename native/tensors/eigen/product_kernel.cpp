// SPDX-License-Identifier: GPL-3.0-or-later
// Eigen's own buffers must be aligned for the widest vectors here. They never leave this source.
#undef EIGEN_MAX_ALIGN_BYTES
#define EIGEN_MAX_ALIGN_BYTES 64
#include "tensors/eigen/product_kernel.h"

#include <Eigen/Cholesky>

namespace arapfields::SIMD_LEVEL {
namespace {

/// use(map) with the map of the matrix's own layout.
template <class Scalar, class Use>
void with_map(const Strided<Scalar>& m, const Use& use) {
  using Plain = std::remove_const_t<Scalar>;
  using Rows = Eigen::Matrix<Plain, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;
  using Columns = Eigen::Matrix<Plain, Eigen::Dynamic, Eigen::Dynamic>;
  const auto map = [&]<class Matrix>() {
    using Mapped = std::conditional_t<std::is_const_v<Scalar>, const Matrix, Matrix>;
    use(Eigen::Map<Mapped, 0, Eigen::OuterStride<>>(m.data, m.rows, m.columns, Eigen::OuterStride<>(m.stride)));
  };
  if (m.by_rows)
    map.template operator()<Rows>();
  else
    map.template operator()<Columns>();
}

template <class Scalar>
void multiply(const Strided<Scalar>& c, const Strided<const Scalar>& a, const Strided<const Scalar>& b, Scalar factor) {
  using Rows = Eigen::Matrix<Scalar, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;
  Eigen::Map<Rows, 0, Eigen::OuterStride<>> out(c.data, c.rows, c.columns, Eigen::OuterStride<>(c.stride));
  with_map(a, [&](const auto& left) {
    with_map(b, [&](const auto& right) { out.noalias() += factor * (left * right); });
  });
}

template <class Scalar>
bool factorize(const Strided<Scalar>& a) {
  bool definite = false;
  with_map(a, [&](auto map) {
    const Eigen::LLT<Eigen::Matrix<Scalar, Eigen::Dynamic, Eigen::Dynamic>> factor(map);
    definite = factor.info() == Eigen::Success;
    if (definite) map = factor.matrixL();
  });
  return definite;
}

template <int triangle, class Scalar>
void solve(const Strided<const Scalar>& a, const Strided<Scalar>& b) {
  with_map(a, [&](const auto& factor) {
    with_map(b, [&](auto right) { factor.template triangularView<triangle>().solveInPlace(right); });
  });
}

}  // namespace

#define ARAPFIELDS_BLOCKS(Scalar)                                                                             \
  void add_block_product(const Strided<Scalar>& c, const Strided<const Scalar>& a,                            \
                         const Strided<const Scalar>& b, Scalar factor) {                                     \
    multiply(c, a, b, factor);                                                                                \
  }                                                                                                           \
  bool factorize_block(const Strided<Scalar>& a) { return factorize(a); }                                     \
  void solve_lower_block(const Strided<const Scalar>& lower, const Strided<Scalar>& b) {                      \
    solve<Eigen::Lower>(lower, b);                                                                            \
  }                                                                                                           \
  void solve_upper_block(const Strided<const Scalar>& upper, const Strided<Scalar>& b) {                      \
    solve<Eigen::Upper>(upper, b);                                                                            \
  }
ARAPFIELDS_BLOCKS(float)
ARAPFIELDS_BLOCKS(double)

}  // namespace arapfields::SIMD_LEVEL
