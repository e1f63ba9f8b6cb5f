// SPDX-License-Identifier: GPL-3.0-or-later
// Jets of scalars, columns as in core/jets.h: chain rule and product rule, and their pull-backs.
#pragma once

#include "core/jets.h"

namespace arapfields {

/// The jet of a scalar with up to ten columns, or the cotangents of one.
template <class Scalar>
struct NumberJet {
  Scalar c[10] = {};

  Scalar& operator[](int i) { return c[i]; }
  Scalar operator[](int i) const { return c[i]; }
};

/// A function's value and derivatives at one point.
template <class Scalar>
struct Derivatives {
  Scalar value, first, second, third;
};

/// The jet of φ(u), by the chain rule.
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

/// The pull-back of chain(): adds to the cotangents of u.
template <class Scalar>
void chain_back(const Derivatives<Scalar>& phi, const NumberJet<Scalar>& u,
                const NumberJet<Scalar>& cotangents, NumberJet<Scalar>& back, int columns) {
  Scalar curved = 0;
  for (int i = 0; i < columns; ++i) back[i] += phi.first * cotangents[i];
  for (int i = 1; i < columns; ++i) curved += u[i] * cotangents[i];
  back[0] += phi.second * curved;
  if (columns < 10) return;
  for (int j = 0; j < 3; ++j)
    for (int k = j; k < 3; ++k) {
      const Scalar a = u[first_column(j)], b = u[first_column(k)], g = cotangents[second_column(j, k)];
      back[0] += phi.third * a * b * g;
      back[first_column(j)] += phi.second * b * g;
      back[first_column(k)] += phi.second * a * g;
    }
}

/// The jet of a·b, by the product rule.
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

/// The pull-back of product() by b: adds to the cotangents of b.
template <class Scalar>
void product_back(const NumberJet<Scalar>& a, const NumberJet<Scalar>& cotangents, NumberJet<Scalar>& back,
                  int columns) {
  for (int i = 0; i < columns; ++i) {
    back[i] += a[0] * cotangents[i];
    if (i > 0) back[0] += a[i] * cotangents[i];
  }
  if (columns < 10) return;
  for (int j = 0; j < 3; ++j)
    for (int k = j; k < 3; ++k) {
      const Scalar g = cotangents[second_column(j, k)];
      back[first_column(k)] += a[first_column(j)] * g;
      back[first_column(j)] += a[first_column(k)] * g;
    }
}

}  // namespace arapfields
