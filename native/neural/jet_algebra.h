// SPDX-License-Identifier: GPL-3.0-or-later
// Jets of one number, columns as in core/jets.h: what functions and products make of them, and the way back.
#pragma once

#include "core/jets.h"

namespace arapfields {

/// The jet of one number with up to ten columns, or the cotangents of one.
template <class Scalar>
struct NumberJet {
  Scalar c[10] = {};

  Scalar& operator[](int i) { return c[i]; }
  Scalar operator[](int i) const { return c[i]; }
};

/// A function's value and derivatives at one place.
template <class Scalar>
struct Derivatives {
  Scalar value, first, second, third;
};

/// φ(u).
template <class Scalar>
NumberJet<Scalar> chain(const Derivatives<Scalar>& phi, const NumberJet<Scalar>& u, int columns) {
  NumberJet<Scalar> h;
  h[0] = phi.value;
  for (int i = 1; i < columns; ++i) h[i] = phi.first * u[i];
  if (columns < 10) return h;
  for (int j = 0; j < 3; ++j)
    for (int k = j; k < 3; ++k)
      h[second_column(j, k)] += phi.second * u[first_column(j)] * u[first_column(k)];
  return h;
}

/// Adds to the cotangents of u what those of φ(u) ask of it.
template <class Scalar>
void chain_back(const Derivatives<Scalar>& phi, const NumberJet<Scalar>& u, const NumberJet<Scalar>& given,
                NumberJet<Scalar>& back, int columns) {
  Scalar curved = 0;
  for (int i = 0; i < columns; ++i) back[i] += phi.first * given[i];
  for (int i = 1; i < columns; ++i) curved += u[i] * given[i];
  back[0] += phi.second * curved;
  if (columns < 10) return;
  for (int j = 0; j < 3; ++j)
    for (int k = j; k < 3; ++k) {
      const Scalar a = u[first_column(j)], b = u[first_column(k)], g = given[second_column(j, k)];
      back[0] += phi.third * a * b * g;
      back[first_column(j)] += phi.second * b * g;
      back[first_column(k)] += phi.second * a * g;
    }
}

/// a·b.
template <class Scalar>
NumberJet<Scalar> product(const NumberJet<Scalar>& a, const NumberJet<Scalar>& b, int columns) {
  NumberJet<Scalar> h;
  h[0] = a[0] * b[0];
  for (int i = 1; i < columns; ++i) h[i] = a[i] * b[0] + a[0] * b[i];
  if (columns < 10) return h;
  for (int j = 0; j < 3; ++j)
    for (int k = j; k < 3; ++k)
      h[second_column(j, k)] +=
          a[first_column(j)] * b[first_column(k)] + a[first_column(k)] * b[first_column(j)];
  return h;
}

/// Adds to the cotangents of b what those of a·b ask of it.
template <class Scalar>
void product_back(const NumberJet<Scalar>& a, const NumberJet<Scalar>& given, NumberJet<Scalar>& back,
                  int columns) {
  for (int i = 0; i < columns; ++i) {
    back[i] += a[0] * given[i];
    if (i > 0) back[0] += a[i] * given[i];
  }
  if (columns < 10) return;
  for (int j = 0; j < 3; ++j)
    for (int k = j; k < 3; ++k) {
      const Scalar g = given[second_column(j, k)];
      back[first_column(k)] += a[first_column(j)] * g;
      back[first_column(j)] += a[first_column(k)] * g;
    }
}

}  // namespace arapfields
