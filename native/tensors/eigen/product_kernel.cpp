// SPDX-License-Identifier: GPL-3.0-or-later
#include "tensors/eigen/product_kernel.h"

#include "core/pack.h"

namespace arapfields::SIMD_LEVEL {
namespace {

using std::int64_t;

// A register holds the sums of one row and one pack of columns: 24 of 32 registers, or 12 of 16.
#if defined(__AVX512F__)
constexpr int rows_at_once = 12;
#elif defined(ARAPFIELDS_NEON)
constexpr int rows_at_once = 8;
#else
constexpr int rows_at_once = 6;
#endif
constexpr int packs_at_once = 2;
template <class Scalar>
constexpr int columns_at_once = packs_at_once * lanes<Scalar>;

template <class Scalar, int count>
using Sums = Pack<Scalar>[count][packs_at_once];

template <class Scalar>
const Scalar* entry(const Strided<const Scalar>& m, int64_t i, int64_t j) {
  return m.data + i * m.row + j * m.column;
}

/// Four numbers each of four rows `stride` apart, turned: out gets four rows `width` apart.
template <class Scalar>
inline void transpose_quad(const Scalar* from, int64_t stride, Scalar* out, int64_t width) {
  typedef Scalar Quad __attribute__((vector_size(4 * sizeof(Scalar))));
  Quad rows[4];
  for (int r = 0; r < 4; ++r) __builtin_memcpy(&rows[r], from + r * stride, sizeof(Quad));
  const Quad a = __builtin_shufflevector(rows[0], rows[1], 0, 4, 1, 5);
  const Quad b = __builtin_shufflevector(rows[0], rows[1], 2, 6, 3, 7);
  const Quad c = __builtin_shufflevector(rows[2], rows[3], 0, 4, 1, 5);
  const Quad d = __builtin_shufflevector(rows[2], rows[3], 2, 6, 3, 7);
  const Quad turned[4] = {
      __builtin_shufflevector(a, c, 0, 1, 4, 5), __builtin_shufflevector(a, c, 2, 3, 6, 7),
      __builtin_shufflevector(b, d, 0, 1, 4, 5), __builtin_shufflevector(b, d, 2, 3, 6, 7)};
  for (int r = 0; r < 4; ++r) __builtin_memcpy(out + r * width, &turned[r], sizeof(Quad));
}

/// b (inner, columns) as strips of columns_at_once, row by row; zero beyond the last column.
template <class Scalar>
void pack_columns(const Strided<const Scalar>& b, int64_t inner, int64_t columns, Scalar* out) {
  constexpr int width = columns_at_once<Scalar>;
  for (int64_t first = 0; first < columns; first += width, out += inner * width) {
    const int64_t used = columns - first < width ? columns - first : width;
    if (b.column == 1 && used == width) {
      for (int64_t k = 0; k < inner; ++k)
        for (int p = 0; p < width; p += lanes<Scalar>)
          store(out + k * width + p, load(entry(b, k, first) + p));
      continue;
    }
    int64_t turned = 0;  // rows of which all columns are there already
    if (b.row == 1 && used == width)
      for (; turned + 4 <= inner; turned += 4)
        for (int j = 0; j < width; j += 4)
          transpose_quad(entry(b, turned, first + j), b.column, out + turned * width + j, width);
    for (int64_t j = 0; j < width; ++j) {
      const Scalar* from = entry(b, 0, first + (j < used ? j : 0));
      for (int64_t k = turned; k < inner; ++k) out[k * width + j] = j < used ? from[k * b.row] : Scalar(0);
    }
  }
}

/// The products of `count` rows of a, `step` from entry to entry, with a strip of b.
template <class Scalar, int count>
inline void sum_products(const Scalar* const (&rows)[rows_at_once], int64_t step, const Scalar* strip,
                         int64_t inner, Sums<Scalar, count>& sums) {
  for (auto& row : sums)
    for (auto& sum : row) sum = Pack<Scalar>{};
  for (int64_t k = 0; k < inner; ++k, strip += columns_at_once<Scalar>) {
    Pack<Scalar> b[packs_at_once];
    for (int p = 0; p < packs_at_once; ++p) b[p] = load(strip + p * lanes<Scalar>);
    for (int r = 0; r < count; ++r) {
      const Scalar x = rows[r][k * step];
      for (int p = 0; p < packs_at_once; ++p) sums[r][p] += x * b[p];
    }
  }
}

/// `used` rows of c, from the sums of as many or more.
template <class Scalar, int count>
inline void write_sums(const Sums<Scalar, count>& sums, const ProductBlock<Scalar>& m, Scalar* c,
                       int64_t used, int64_t columns) {
  for (int r = 0; r < count; ++r, c += m.c.row) {
    if (r >= used) return;
    if (columns == columns_at_once<Scalar>) {
      for (int p = 0; p < packs_at_once; ++p) {
        Scalar* const to = c + p * lanes<Scalar>;
        store(to, m.add ? load(to) + m.factor * sums[r][p] : m.factor * sums[r][p]);
      }
      continue;
    }
    Scalar numbers[columns_at_once<Scalar>];
    for (int p = 0; p < packs_at_once; ++p) store(numbers + p * lanes<Scalar>, sums[r][p]);
    for (int64_t j = 0; j < columns; ++j) c[j] = m.factor * numbers[j] + (m.add ? c[j] : Scalar(0));
  }
}

/// Rows i … i+used−1 of c, of which there are `count` at the most. Rows of a that are not contiguous are
/// copied.
template <class Scalar, int count>
void multiply_rows(const ProductBlock<Scalar>& m, int64_t i, int64_t used) {
  constexpr int width = columns_at_once<Scalar>;
  const Scalar* rows[rows_at_once];
  for (int r = 0; r < count; ++r) rows[r] = entry(m.a, i + (r < used ? r : 0), 0);
  Scalar copies[count * product_inner];
  if (m.a.column != 1) {
    for (int64_t k = 0; k < m.inner; ++k) {
      if (m.a.row == 1 && used == count)
        __builtin_memcpy(copies + k * count, rows[0] + k * m.a.column, sizeof(Scalar) * count);
      else
        for (int r = 0; r < count; ++r) copies[k * count + r] = rows[r][k * m.a.column];
    }
    for (int r = 0; r < count; ++r) rows[r] = copies + r;
  }
  const Scalar* strip = m.buffer;
  for (int64_t j = 0; j < m.columns; j += width, strip += m.inner * width) {
    Sums<Scalar, count> sums;
    if (m.a.column == 1)
      sum_products<Scalar, count>(rows, 1, strip, m.inner, sums);
    else
      sum_products<Scalar, count>(rows, count, strip, m.inner, sums);
    write_sums<Scalar, count>(sums, m, m.c.data + i * m.c.row + j, used,
                              m.columns - j < width ? m.columns - j : width);
  }
}

/// c += or = a b for a part of b that fits the buffer.
template <class Scalar>
void multiply_part(const ProductBlock<Scalar>& m) {
  constexpr int few = rows_at_once / 2;
  pack_columns(m.b, m.inner, m.columns, m.buffer);
  for (int64_t i = 0; i < m.rows; i += rows_at_once) {
    const int64_t used = m.rows - i < rows_at_once ? m.rows - i : rows_at_once;
    if (used <= few)
      multiply_rows<Scalar, few>(m, i, used);
    else
      multiply_rows<Scalar, rows_at_once>(m, i, used);
  }
}

/// Few columns, as dot products of the rows of a with the columns of b, all of which are contiguous.
template <class Scalar, int columns>
void multiply_dots(const ProductBlock<Scalar>& m) {
  constexpr int at_once = 4;
  const int64_t whole = m.inner / lanes<Scalar> * lanes<Scalar>;
  for (int64_t i = 0; i < m.rows; i += at_once) {
    const int64_t used = m.rows - i < at_once ? m.rows - i : at_once;
    const Scalar* rows[at_once];
    for (int r = 0; r < at_once; ++r) rows[r] = entry(m.a, i + (r < used ? r : 0), 0);
    Pack<Scalar> sums[at_once][columns] = {};
    for (int64_t k = 0; k < whole; k += lanes<Scalar>)
      for (int j = 0; j < columns; ++j) {
        const Pack<Scalar> y = load(m.b.data + j * m.b.column + k);
        for (int r = 0; r < at_once; ++r) sums[r][j] += load(rows[r] + k) * y;
      }
    for (int r = 0; r < at_once && r < used; ++r)
      for (int j = 0; j < columns; ++j) {
        Scalar value = sum_of_lanes<Scalar>(sums[r][j]);
        for (int64_t k = whole; k < m.inner; ++k) value += rows[r][k] * m.b.data[j * m.b.column + k];
        Scalar& to = m.c.data[(i + r) * m.c.row + j];
        to = m.factor * value + (m.add ? to : Scalar(0));
      }
  }
}

template <class Scalar>
void multiply(const ProductBlock<Scalar>& m) {
  if (m.columns <= 3 && m.a.column == 1 && m.b.row == 1)
    return m.columns == 1   ? multiply_dots<Scalar, 1>(m)
           : m.columns == 2 ? multiply_dots<Scalar, 2>(m)
                            : multiply_dots<Scalar, 3>(m);
  for (int64_t k = 0; k < m.inner; k += product_inner)
    for (int64_t j = 0; j < m.columns; j += product_columns) {
      ProductBlock<Scalar> part = m;
      part.c.data += j;
      part.a.data = entry(m.a, 0, k);
      part.b.data = entry(m.b, k, j);
      part.inner = m.inner - k < product_inner ? m.inner - k : product_inner;
      part.columns = m.columns - j < product_columns ? m.columns - j : product_columns;
      part.add = m.add || k > 0;
      multiply_part(part);
    }
}

template <class Scalar>
void substitute(const SubstitutionBlock<Scalar>& m) {
  for (int64_t place = 0; place < m.size; ++place) {
    const int64_t i = m.upper ? m.size - 1 - place : place;
    Scalar* const row = m.b.data + i * m.b.row;
    for (int64_t before = 0; before < place; ++before) {
      const int64_t j = m.upper ? m.size - 1 - before : before;
      const Scalar x = *entry(m.a, i, j);
      const Scalar* const other = m.b.data + j * m.b.row;
      for (int64_t c = 0; c < m.columns; ++c) row[c] -= x * other[c];
    }
    const Scalar pivot = *entry(m.a, i, i);
    for (int64_t c = 0; c < m.columns; ++c) row[c] /= pivot;
  }
}

}  // namespace

void multiply_block(const ProductBlock<float>& block) { multiply(block); }
void multiply_block(const ProductBlock<double>& block) { multiply(block); }
void substitute_block(const SubstitutionBlock<float>& block) { substitute(block); }
void substitute_block(const SubstitutionBlock<double>& block) { substitute(block); }

}  // namespace arapfields::SIMD_LEVEL
