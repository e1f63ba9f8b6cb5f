// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

namespace arapfields {

/// Directions that tell the functions of one band apart: as many as the third band has functions.
constexpr int harmonic_directions = 7;
constexpr int band_size(int band) { return 2 * band + 1; }

/// The real spherical harmonics of band 2 or 3 in a unit direction, with the signs and the order of Gaussian
/// splats' files. T: numbers or packs of them. Static: SIMD sources compile their own.
template <int band, class Scalar, class T>
static inline void harmonics_in(const T (&d)[3], T* out) {
  const T &x = d[0], &y = d[1], &z = d[2];
  const T xx = x * x, yy = y * y, zz = z * z;
  if constexpr (band == 2) {
    constexpr Scalar a = Scalar(1.0925484305920792), b = Scalar(0.31539156525252005);
    out[0] = a * (x * y);
    out[1] = -a * (y * z);
    out[2] = b * (Scalar(2) * zz - xx - yy);
    out[3] = -a * (x * z);
    out[4] = Scalar(0.5) * a * (xx - yy);
  } else {
    constexpr Scalar a = Scalar(0.5900435899266435), b = Scalar(2.890611442640554),
                     c = Scalar(0.4570457994644658), e = Scalar(0.3731763325901154);
    out[0] = -a * y * (Scalar(3) * xx - yy);
    out[1] = b * (x * y * z);
    out[2] = -c * y * (Scalar(4) * zz - xx - yy);
    out[3] = e * z * (Scalar(2) * zz - Scalar(3) * (xx + yy));
    out[4] = -c * x * (Scalar(4) * zz - xx - yy);
    out[5] = Scalar(0.5) * b * z * (xx - yy);
    out[6] = -a * x * (xx - Scalar(3) * yy);
  }
}

/// What turns colours with their object. A band's real Wigner matrix for a rotation R is P Y(RᵀD): D the
/// directions, Y the band's functions there, and P the left inverse of Y(D).
template <class Scalar>
struct HarmonicTables {
  Scalar directions[harmonic_directions][3];
  Scalar second[band_size(2)][harmonic_directions];  ///< P of band 2
  Scalar third[band_size(3)][harmonic_directions];   ///< P of band 3
};

template <class Scalar>
const HarmonicTables<Scalar>& harmonic_tables();

}  // namespace arapfields
