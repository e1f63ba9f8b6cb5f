// SPDX-License-Identifier: GPL-3.0-or-later
// Packs of splats from memory and back, for SIMD sources.
#pragma once

#include "core/pack.h"
#include "splats/turn_kernel.h"

namespace arapfields::SIMD_LEVEL {

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

}  // namespace arapfields::SIMD_LEVEL
