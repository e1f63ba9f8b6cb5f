// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

namespace arapfields {

/// Lagrange weights of the nodes 0, 1, 2, 3 at u.
inline void cubic_weights(float u, float (&w)[4]) {
  const float a = u, b = u - 1.0f, c = u - 2.0f, d = u - 3.0f;
  w[0] = b * c * d * (-1.0f / 6.0f);
  w[1] = a * c * d * 0.5f;
  w[2] = a * b * d * -0.5f;
  w[3] = a * b * c * (1.0f / 6.0f);
}

/// The values of a 4×4×4 block of grid points, z fastest, and their cubic interpolation at (u, v, w) in
/// [0,3]³.
struct CubicBlock {
  float node[64];

  float operator()(float u, float v, float w) const {
    float wu[4], wv[4], ww[4], line[4] = {0.0f, 0.0f, 0.0f, 0.0f};
    cubic_weights(u, wu);
    cubic_weights(v, wv);
    cubic_weights(w, ww);
    for (int i = 0; i < 4; ++i)
      for (int j = 0; j < 4; ++j) {
        const float weight = wu[i] * wv[j];
        for (int k = 0; k < 4; ++k) line[k] += weight * node[16 * i + 4 * j + k];
      }
    return line[0] * ww[0] + line[1] * ww[1] + line[2] * ww[2] + line[3] * ww[3];
  }
};

}  // namespace arapfields
