// SPDX-License-Identifier: GPL-3.0-or-later
#include "splats/turn_kernel.h"

#include "core/pack.h"
#include "energies/rotation_pack.h"

namespace arapfields::SIMD_LEVEL {

// Packs of splats from memory and back, for SIMD sources.

/// Entry k of each lane's row; lanes past the last repeat it.
template <class Scalar>
struct Rows {
  std::int64_t at[lanes<Scalar>];
  int valid;

  Rows(const std::int64_t* rows, std::int64_t first, std::int64_t end)
      : valid(static_cast<int>(end - first < lanes<Scalar> ? end - first : lanes<Scalar>)) {
    for (int i = 0; i < lanes<Scalar>; ++i) at[i] = rows[first + (i < valid ? i : valid - 1)];
  }
  template <int columns>
  void gather(const float* from, int stride, Pack<Scalar>* out) const {
    Scalar split[columns][lanes<Scalar>];
    for (int i = 0; i < lanes<Scalar>; ++i)
      for (int c = 0; c < columns; ++c) split[c][i] = static_cast<Scalar>(from[stride * at[i] + c]);
    for (int c = 0; c < columns; ++c) out[c] = load(split[c]);
  }
  template <int columns>
  void scatter(const Pack<Scalar>* values, int stride, float* to) const {
    Scalar split[columns][lanes<Scalar>];
    for (int c = 0; c < columns; ++c) store(split[c], values[c]);
    for (int i = 0; i < valid; ++i)
      for (int c = 0; c < columns; ++c) to[stride * at[i] + c] = static_cast<float>(split[c][i]);
  }
};

/// Packs of splats that are rows of GaussianSplats.
template <class Scalar>
struct RowAccess {
  const SplatBatch<Scalar>& batch;
  Rows<Scalar> from;
  Rows<Scalar> to;

  RowAccess(const SplatBatch<Scalar>& splats, std::int64_t first, std::int64_t end)
      : batch(splats), from(splats.from, first, end), to(splats.to, first, end) {}
  void load_shape(Pack<Scalar> (&quaternion)[4], Pack<Scalar> (&log_scales)[3]) const {
    from.template gather<4>(batch.rotations, 4, quaternion);
    from.template gather<3>(batch.log_scales, 3, log_scales);
  }
  void store_shape(const Pack<Scalar> (&quaternion)[4], const Pack<Scalar> (&log_scales)[3]) const {
    to.template scatter<4>(quaternion, 4, batch.moved_rotations);
    to.template scatter<3>(log_scales, 3, batch.moved_log_scales);
  }
  template <int functions>
  void load_colours(Pack<Scalar>* colours) const {
    from.template gather<3 * functions>(batch.harmonics, 3 * functions, colours);
  }
  template <int functions>
  void store_colours(const Pack<Scalar>* colours) const {
    to.template scatter<3 * functions>(colours, 3 * functions, batch.moved_harmonics);
  }
};

/// Packs of splats whose quantities are columns; the first harmonic's colours, which nothing turns, are not.
struct ColumnAccess {
  const SplatColumnBatch& batch;
  std::int64_t first;
  int valid;

  Pack<float> rest(int column) const {
    const SplatColumn& one = batch.columns[column];
    const float* from = one.rest + first * one.rest_stride;
    if (one.rest_stride == 1 && valid == lanes<float>) return load(from);
    float split[lanes<float>];
    for (int i = 0; i < lanes<float>; ++i) split[i] = from[one.rest_stride * (i < valid ? i : valid - 1)];
    return load(split);
  }
  void put(int column, Pack<float> moved) const {
    const SplatColumn& one = batch.columns[column];
    const Pack<float> change = moved - rest(column);
    float* to = one.change + first * one.change_stride;
    if (one.change_stride == 1 && valid == lanes<float>) return store(to, change);
    for (int i = 0; i < valid; ++i) to[one.change_stride * i] = change[i];
  }
  void load_shape(Pack<float> (&quaternion)[4], Pack<float> (&log_scales)[3]) const {
    for (int k = 0; k < 4; ++k) quaternion[k] = rest(k);
    for (int a = 0; a < 3; ++a) log_scales[a] = rest(4 + a);
  }
  void store_shape(const Pack<float> (&quaternion)[4], const Pack<float> (&log_scales)[3]) const {
    for (int k = 0; k < 4; ++k) put(k, quaternion[k]);
    for (int a = 0; a < 3; ++a) put(4 + a, log_scales[a]);
  }
  template <int functions>
  void load_colours(Pack<float>* colours) const {
    for (int c = 0; c < 3; ++c)
      for (int f = 1; f < functions; ++f) colours[3 * f + c] = rest(6 + c * (functions - 1) + f);
  }
  template <int functions>
  void store_colours(const Pack<float>* colours) const {
    for (int c = 0; c < 3; ++c)
      for (int f = 1; f < functions; ++f) put(6 + c * (functions - 1) + f, colours[3 * f + c]);
  }
  void load_jacobian(Pack<float> (&out)[3][3]) const {
    float split[9][lanes<float>];
    const float* from = batch.jacobians + 9 * first;
    for (int i = 0; i < lanes<float>; ++i)
      for (int c = 0; c < 9; ++c) split[c][i] = from[9 * (i < valid ? i : valid - 1) + c];
    for (int k = 0; k < 3; ++k)
      for (int i = 0; i < 3; ++i) out[i][k] = load(split[3 * k + i]);
  }
  /// Asks for what comes later: there are more columns than the processor foresees by itself.
  void prefetch_ahead() const {
    for (int column = 0; column < 4 + 3 * batch.functions; ++column) {
      const SplatColumn& one = batch.columns[column];
      __builtin_prefetch(one.rest + (first + 4 * lanes<float>)*one.rest_stride);
      __builtin_prefetch(one.change + (first + 4 * lanes<float>)*one.change_stride, 1);
    }
  }
};

namespace {

constexpr int sweeps = 12;
/// A width's logarithm below the widest one's at which squares still have digits; finer axes are scaled up.
constexpr float finest = -23.0f;
template <class Scalar>
constexpr Scalar orthogonal = sizeof(Scalar) == 4 ? Scalar(2e-7) : Scalar(1e-15);

template <class Scalar>
inline void axes_of(const Pack<Scalar> (&q)[4], Pack33<Scalar>& out) {
  using P = Pack<Scalar>;
  const P twice = Scalar(2) / (q[0] * q[0] + q[1] * q[1] + q[2] * q[2] + q[3] * q[3]);
  for (int i = 0; i < 3; ++i) {
    const int j = (i + 1) % 3, k = (i + 2) % 3;
    out[i][i] = Scalar(1) - twice * (q[1 + j] * q[1 + j] + q[1 + k] * q[1 + k]);
    out[j][i] = twice * (q[1 + i] * q[1 + j] + q[0] * q[1 + k]);
    out[i][j] = twice * (q[1 + i] * q[1 + j] - q[0] * q[1 + k]);
  }
}

template <class Scalar>
inline Pack<Scalar> product(const Pack33<Scalar>& a, int p, int q) {
  return a[0][p] * a[0][q] + a[1][p] * a[1][q] + a[2][p] * a[2][q];
}

/// The rotation closest to J, by Newton's iteration for the polar decomposition (Higham 1986), which is
/// several times as fast as closest_rotation(); that one takes what is flat, mirrored or far from rotations.
template <class Scalar>
inline void rotation_of(const Pack33<Scalar>& jacobian, Pack33<Scalar>& out) {
  using P = Pack<Scalar>;
  constexpr int most_steps = 8;
  constexpr Scalar settled = sizeof(Scalar) == 4 ? Scalar(1e-7) : Scalar(1e-14);
  const P zero = {}, one = broadcast(Scalar(1));
  P x[3][3], wrong = zero;
  for (int i = 0; i < 3; ++i)
    for (int k = 0; k < 3; ++k) x[i][k] = jacobian[i][k];
  for (int step = 0; step < most_steps; ++step) {
    P cofactors[3][3];
    for (int i = 0; i < 3; ++i)
      for (int k = 0; k < 3; ++k) {
        const int i1 = (i + 1) % 3, i2 = (i + 2) % 3, k1 = (k + 1) % 3, k2 = (k + 2) % 3;
        cofactors[i][k] = x[i1][k1] * x[i2][k2] - x[i1][k2] * x[i2][k1];
      }
    const P determinant = x[0][0] * cofactors[0][0] + x[0][1] * cofactors[0][1] + x[0][2] * cofactors[0][2];
    if (step == 0)
      wrong = determinant > zero ? zero : one;  // in those, and for NaN, the limit is no rotation
    const P half_inverse = Scalar(0.5) / determinant;
    P change = zero;
    for (int i = 0; i < 3; ++i)
      for (int k = 0; k < 3; ++k) {
        const P next = Scalar(0.5) * x[i][k] + half_inverse * cofactors[i][k], moved = next - x[i][k];
        change += moved * moved;
        x[i][k] = next;
      }
    if (sum_of_lanes<Scalar>(change < settled ? wrong : one) == 0) {
      for (int i = 0; i < 3; ++i)
        for (int k = 0; k < 3; ++k) out[i][k] = x[i][k];
      return;
    }
  }
  RotationPack<Scalar> closest;
  closest_rotation<Scalar>(jacobian, closest);
  for (int i = 0; i < 3; ++i)
    for (int k = 0; k < 3; ++k) out[i][k] = closest.rotation[i][k];
}

/// The orthogonal axes σ_i u_i with Σ σ_i² u_i u_iᵀ = A Aᵀ, by Hestenes' one-sided Jacobi rotations. Columns
/// that are orthogonal stay as they are; others keep their order.
template <class Scalar>
inline void orthogonalise(Pack33<Scalar>& a) {
  using P = Pack<Scalar>;
  constexpr int pairs[3][2] = {{0, 1}, {0, 2}, {1, 2}};
  const P zero = {}, one = broadcast(Scalar(1));
  for (int sweep = 0; sweep < sweeps; ++sweep) {
    Scalar turned = 0;
    for (const auto& pair : pairs) {
      const int p = pair[0], q = pair[1];
      const P alpha = product<Scalar>(a, p, p), beta = product<Scalar>(a, q, q),
              gamma = product<Scalar>(a, p, q);
      const auto turns = gamma * gamma > (orthogonal<Scalar> * orthogonal<Scalar>)*(alpha * beta);
      const P zeta = (beta - alpha) / (turns ? Scalar(2) * gamma : one);
      const P size = zeta < zero ? -zeta : zeta;
      P t = Scalar(1) / (size + square_root(Scalar(1) + zeta * zeta));
      t = turns ? (zeta < zero ? -t : t) : zero;
      const P c = Scalar(1) / square_root(Scalar(1) + t * t), s = c * t;
      turned += sum_of_lanes<Scalar>(turns ? one : zero);
      for (auto& row : a) {
        const P first = row[p], second = row[q];
        row[p] = c * first - s * second;
        row[q] = s * first + c * second;
      }
    }
    if (turned == 0) return;
  }
}

/// The unit quaternion of a rotation, by its largest component (Shepperd 1978), on the side of `beside`.
template <class Scalar>
inline void quaternion_of(const Pack33<Scalar>& r, const Pack<Scalar> (&beside)[4], Pack<Scalar> (&q)[4]) {
  using P = Pack<Scalar>;
  const P one = broadcast(Scalar(1)), zero = {};
  P best = one + r[0][0] + r[1][1] + r[2][2];
  q[0] = best, q[1] = r[2][1] - r[1][2], q[2] = r[0][2] - r[2][0], q[3] = r[1][0] - r[0][1];
  for (int i = 0; i < 3; ++i) {
    const int j = (i + 1) % 3, k = (i + 2) % 3;
    P other[4];
    const P size = one + r[i][i] - r[j][j] - r[k][k];
    other[0] = r[k][j] - r[j][k];
    other[1 + i] = size;
    other[1 + j] = r[j][i] + r[i][j];
    other[1 + k] = r[k][i] + r[i][k];
    const auto larger = size > best;
    for (int c = 0; c < 4; ++c) q[c] = larger ? other[c] : q[c];
    best = larger ? size : best;
  }
  P side = zero, square = zero;
  for (int c = 0; c < 4; ++c) side += q[c] * beside[c], square += q[c] * q[c];
  P factor = Scalar(1) / square_root(square);
  factor = side < zero ? -factor : factor;
  for (P& x : q) x *= factor;
}

/// Colours (band_size(band), 3) become P (Y(RᵀD) colours).
template <int band, class Scalar>
inline void turn_band(const Pack<Scalar> (&turned)[harmonic_directions][3],
                      const Scalar (&inverse)[band_size(band)][harmonic_directions], Pack<Scalar>* colours) {
  using P = Pack<Scalar>;
  P values[harmonic_directions][3] = {};
  for (int d = 0; d < harmonic_directions; ++d) {
    P functions[band_size(band)];
    harmonics_in<band, Scalar>(turned[d], functions);
    for (int f = 0; f < band_size(band); ++f)
      for (int c = 0; c < 3; ++c) values[d][c] += functions[f] * colours[3 * f + c];
  }
  for (int f = 0; f < band_size(band); ++f)
    for (int c = 0; c < 3; ++c) {
      P sum = {};
      for (int d = 0; d < harmonic_directions; ++d) sum += inverse[f][d] * values[d][c];
      colours[3 * f + c] = sum;
    }
}

/// Band 1 is −y, z, −x but for a factor: it turns as a vector.
template <class Scalar>
inline void turn_first_band(const Pack33<Scalar>& rotation, Pack<Scalar>* colours) {
  constexpr int axis[3] = {1, 2, 0};
  constexpr Scalar sign[3] = {-1, 1, -1};
  for (int c = 0; c < 3; ++c) {
    Pack<Scalar> before[3];
    for (int f = 0; f < 3; ++f) before[axis[f]] = sign[f] * colours[3 * f + c];
    for (int f = 0; f < 3; ++f) {
      const auto& row = rotation[axis[f]];
      colours[3 * f + c] = sign[f] * (row[0] * before[0] + row[1] * before[1] + row[2] * before[2]);
    }
  }
}

template <int functions, class Scalar, class Access>
inline void turn_colours(const Access& access, const HarmonicTables<Scalar>& tables,
                         const Pack33<Scalar>& rotation) {
  using P = Pack<Scalar>;
  P colours[3 * functions];
  access.template load_colours<functions>(colours);
  if constexpr (functions > 1) turn_first_band<Scalar>(rotation, colours + 3);
  if constexpr (functions > 4) {
    P turned[harmonic_directions][3];
    for (int d = 0; d < harmonic_directions; ++d)
      for (int k = 0; k < 3; ++k) {
        const Scalar* direction = tables.directions[d];
        turned[d][k] =
            rotation[0][k] * direction[0] + rotation[1][k] * direction[1] + rotation[2][k] * direction[2];
      }
    turn_band<2, Scalar>(turned, tables.second, colours + 12);
    if constexpr (functions > 9) turn_band<3, Scalar>(turned, tables.third, colours + 27);
  }
  access.template store_colours<functions>(colours);
}

/// Asks for the memory of splats that come next: neighbours in space are far apart in a file.
inline void prefetch(const std::int64_t* rows, std::int64_t first, std::int64_t end, int functions,
                     const float* rotations, const float* log_scales, const float* harmonics) {
  constexpr int line = 16;  // floats
  for (std::int64_t i = first; i < end; ++i) {
    __builtin_prefetch(rotations + 4 * rows[i]);
    __builtin_prefetch(log_scales + 3 * rows[i]);
    for (int k = 0; k < 3 * functions; k += line) __builtin_prefetch(harmonics + 3 * functions * rows[i] + k);
  }
}

/// Turns a pack of splats; `stretches`: |J u| for the axes u at rest.
template <class Scalar, class Access>
inline void turn_lanes(const Access& access, const Pack33<Scalar>& jacobian, int functions,
                       const HarmonicTables<Scalar>& tables, Pack<Scalar> (&stretches)[3]) {
  using P = Pack<Scalar>;
  const P zero = {};
  Pack33<Scalar> rest, columns;
  P quaternion[4], log_scales[3];
  access.load_shape(quaternion, log_scales);
  axes_of<Scalar>(quaternion, rest);
  P widest = log_scales[0] > log_scales[1] ? log_scales[0] : log_scales[1];
  widest = log_scales[2] > widest ? log_scales[2] : widest;
  P apart[3];  // what is added to a width's logarithm at the end
  for (int a = 0; a < 3; ++a) {
    for (int i = 0; i < 3; ++i)
      columns[i][a] = jacobian[i][0] * rest[0][a] + jacobian[i][1] * rest[1][a] + jacobian[i][2] * rest[2][a];
    stretches[a] = square_root(product<Scalar>(columns, a, a));
    const P below = log_scales[a] - widest, used = below < Scalar(finest) ? zero + Scalar(finest) : below;
    apart[a] = log_scales[a] - used;
    const P width = exponential<Scalar>(used);
    for (auto& row : columns) row[a] *= width;
  }
  orthogonalise<Scalar>(columns);
  Pack33<Scalar> turn, axes;
  rotation_of<Scalar>(jacobian, turn);
  for (int a = 0; a < 3; ++a) {
    constexpr Scalar least = sizeof(Scalar) == 4 ? Scalar(1e-15) : Scalar(1e-30);
    const P length = square_root(product<Scalar>(columns, a, a));
    const auto there = length > least;
    const P inverse = Scalar(1) / (there ? length : zero + Scalar(1));
    for (int i = 0; i < 3; ++i) {
      const P turned = turn[i][0] * rest[0][a] + turn[i][1] * rest[1][a] + turn[i][2] * rest[2][a];
      axes[i][a] = there ? columns[i][a] * inverse : turned;
    }
    for (int i = 0; i < lanes<Scalar>; ++i)
      log_scales[a][i] = std::log(there[i] ? length[i] : least) + apart[a][i];
  }
  const P determinant = axes[0][0] * (axes[1][1] * axes[2][2] - axes[1][2] * axes[2][1]) -
                        axes[0][1] * (axes[1][0] * axes[2][2] - axes[1][2] * axes[2][0]) +
                        axes[0][2] * (axes[1][0] * axes[2][1] - axes[1][1] * axes[2][0]);
  for (auto& row : axes) row[2] = determinant < zero ? -row[2] : row[2];
  P moved[4];
  quaternion_of<Scalar>(axes, quaternion, moved);
  access.store_shape(moved, log_scales);
  switch (functions) {
    case 1:
      return turn_colours<1>(access, tables, turn);
    case 4:
      return turn_colours<4>(access, tables, turn);
    case 9:
      return turn_colours<9>(access, tables, turn);
    default:
      return turn_colours<16>(access, tables, turn);
  }
}

}  // namespace

template <class Scalar>
void turn_splats(const SplatBatch<Scalar>& batch, std::int64_t begin, std::int64_t end) {
  for (std::int64_t first = begin; first < end; first += lanes<Scalar>) {
    const std::int64_t next = first + lanes<Scalar>,
                       last = next + lanes<Scalar> < end ? next + lanes<Scalar> : end;
    prefetch(batch.from, next, last, batch.functions, batch.rotations, batch.log_scales, batch.harmonics);
    prefetch(batch.to, next, last, batch.functions, batch.moved_rotations, batch.moved_log_scales,
             batch.moved_harmonics);
    const RowAccess<Scalar> access(batch, first, end);
    Pack33<Scalar> jacobian;
    load_jacobians(batch.jacobians, batch.count, first, access.from.valid, jacobian);
    Pack<Scalar> stretches[3];
    turn_lanes(access, jacobian, batch.functions, *batch.tables, stretches);
    for (int i = 0; i < access.from.valid; ++i)
      for (int a = 0; a < 3; ++a) batch.stretches[3 * (first + i) + a] = stretches[a][i];
  }
}
template void turn_splats(const SplatBatch<float>&, std::int64_t, std::int64_t);
template void turn_splats(const SplatBatch<double>&, std::int64_t, std::int64_t);

void turn_columns(const SplatColumnBatch& batch, std::int64_t begin, std::int64_t end) {
  for (std::int64_t first = begin; first < end; first += lanes<float>) {
    const std::int64_t left = end - first;
    const ColumnAccess access{batch, first, static_cast<int>(left < lanes<float> ? left : lanes<float>)};
    if (first + 4 * lanes<float> < end) access.prefetch_ahead();
    Pack33<float> jacobian;
    access.load_jacobian(jacobian);
    Pack<float> stretches[3];
    turn_lanes(access, jacobian, batch.functions, *batch.tables, stretches);
  }
}

}  // namespace arapfields::SIMD_LEVEL
