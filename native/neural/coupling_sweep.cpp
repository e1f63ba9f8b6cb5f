// SPDX-License-Identifier: GPL-3.0-or-later
#include "neural/coupling_sweep.h"

#include <algorithm>
#include <cmath>

#include "core/jets.h"
#include "core/jets2d.h"
#include "neural/kernels.h"
#include "tensors/operations.h"

namespace arapfields {

// Jets of scalars, columns as in core/jets.h: chain rule and product rule, and their pull-backs.

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

// Jets of one number by two others, columns as in core/jets2d.h: how they are lifted to jets of space, and
// the way back.

/// The jet of a function of the plane, or the cotangents of one.
template <class Scalar>
struct PlaneJet {
  Scalar c[columns2] = {};

  Scalar& operator[](int i) { return c[i]; }
  Scalar operator[](int i) const { return c[i]; }
};

/// g(u, v), of g's jet there.
template <class Scalar>
NumberJet<Scalar> chain(const PlaneJet<Scalar>& g, const NumberJet<Scalar>& u, const NumberJet<Scalar>& v,
                        int columns) {
  NumberJet<Scalar> h;
  h[0] = g[0];
  for (int i = 1; i < columns; ++i) h[i] = g[1] * u[i] + g[2] * v[i];
  if (columns < 10) return h;
  for (int j = 1; j < 4; ++j)
    for (int k = j; k < 4; ++k)
      h[second_column(j - 1, k - 1)] +=
          g[3] * u[j] * u[k] + g[4] * v[j] * v[k] + g[5] * (u[j] * v[k] + u[k] * v[j]);
  return h;
}

/// Adds what the cotangents of g(u, v) ask to those of the derivatives of u and v, and returns what they ask
/// of g's jet. The derivatives of g's jet at the values of u and v are the caller's.
template <class Scalar>
PlaneJet<Scalar> chain_back(const PlaneJet<Scalar>& g, const NumberJet<Scalar>& u, const NumberJet<Scalar>& v,
                            const NumberJet<Scalar>& given, NumberJet<Scalar>& back_u,
                            NumberJet<Scalar>& back_v, int columns) {
  PlaneJet<Scalar> of_g;
  of_g[0] = given[0];
  for (int i = 1; i < columns; ++i) {
    of_g[1] += u[i] * given[i];
    of_g[2] += v[i] * given[i];
    back_u[i] += g[1] * given[i];
    back_v[i] += g[2] * given[i];
  }
  if (columns < 10) return of_g;
  for (int j = 1; j < 4; ++j)
    for (int k = j; k < 4; ++k) {
      const Scalar w = given[second_column(j - 1, k - 1)];
      of_g[3] += w * u[j] * u[k];
      of_g[4] += w * v[j] * v[k];
      of_g[5] += w * (u[j] * v[k] + u[k] * v[j]);
      back_u[j] += w * (g[3] * u[k] + g[5] * v[k]);
      back_u[k] += w * (g[3] * u[j] + g[5] * v[j]);
      back_v[j] += w * (g[4] * v[k] + g[5] * u[k]);
      back_v[k] += w * (g[4] * v[j] + g[5] * u[j]);
    }
  return of_g;
}

namespace {

/// Columns of a plane jet that carry a jet of `columns` columns.
int plane_columns(int columns) { return columns == 10 ? columns2 : columns == 4 ? 3 : 1; }
/// Rows of an encoding that are not zero: each entry knows one coordinate, so no mixed derivatives.
Index encoded_rows(int plane, Index count) { return std::min(plane, columns2 - 1) * count; }

/// Columns of a plane-by-plane block as jets of single numbers: entry i of row p, of `stride` entries a row.
template <class Jet, class Scalar>
Jet gather(const Scalar* data, Index count, Index stride, Index p, Index i, int columns) {
  Jet jet;
  for (int c = 0; c < columns; ++c) jet[c] = data[(c * count + p) * stride + i];
  return jet;
}

template <class Jet, class Scalar>
void scatter(const Jet& jet, Scalar* data, Index count, Index stride, Index p, Index i, int columns) {
  for (int c = 0; c < columns; ++c) data[(c * count + p) * stride + i] = jet[c];
}

/// exp(bound·tanh(s / bound)).
template <class Scalar>
Derivatives<Scalar> bounded_exp(Scalar s) {
  constexpr Scalar bound = Scalar(CouplingShape::bound);
  const Scalar t = std::tanh(s / bound), value = std::exp(bound * t);
  const Scalar g1 = 1 - t * t, g2 = -2 * t * g1 / bound, g3 = -2 * g1 * (1 - 3 * t * t) / (bound * bound);
  return {value, value * g1, value * (g1 * g1 + g2), value * (g1 * g1 * g1 + 3 * g1 * g2 + g3)};
}

/// Calls use(index of the encoding's entry, derivatives of that entry) for one coordinate.
template <class Scalar, class Use>
void each_entry(const CouplingShape& shape, Scalar x, int which, Use&& use) {
  double f = shape.frequency, c = std::cos(f * static_cast<double>(x)),
         s = std::sin(f * static_cast<double>(x));
  for (int k = 0; k < shape.octaves; ++k, f *= 2) {
    const Index entry = 2 * (which * shape.octaves + k);
    const auto at = [](double a) { return static_cast<Scalar>(a); };
    use(entry, Derivatives<Scalar>{at(c), at(-f * s), at(-f * f * c), at(f * f * f * s)});
    use(entry + 1, Derivatives<Scalar>{at(s), at(f * c), at(-f * f * s), at(-f * f * f * c)});
    const double twice = 2 * s * c;
    c = (c - s) * (c + s);
    s = twice;
  }
}

template <class Scalar>
ColumnBlock<Scalar> block_of(const CouplingShape& shape, const CouplingMemory& memory, int l,
                             const Tensor& bias) {
  const Tensor& slope = memory.slope[l];
  ColumnBlock<Scalar> block;
  block.z = memory.pre[l].data<Scalar>();
  block.h = memory.activations[l].data<Scalar>();
  block.slope = slope.data<Scalar>();
  block.bias = bias.data<Scalar>();
  block.sharpness = static_cast<Scalar>(shape.softplus_sharpness);
  block.points = slope.size(0);
  block.width = slope.size(1);
  block.columns = static_cast<int>(memory.pre[l].size(0) / slope.size(0));
  return block;
}

/// The plane jets of (s, t) of coupling layer i, by the two coordinates that memory.jets has for it.
template <class Scalar>
void condition(const CouplingShape& shape, const CouplingViews& views, int i, CouplingMemory& memory) {
  const CouplingViews::Network& network = views.networks[i];
  const Index count = memory.jets.size(1), entries = shape.fan_in(0);
  const int plane = plane_columns(static_cast<int>(memory.jets.size(0)));
  const auto* points = memory.jets.data<Scalar>();
  auto* encoding = memory.encoding.data<Scalar>();
  for (Index p = 0; p < count; ++p)
    for (int which = 0; which < 2; ++which)
      each_entry(shape, points[3 * p + (i + 1 + which) % 3], which,
                 [&](Index entry, const Derivatives<Scalar>& phi) {
                   const auto at = [&](int c) -> Scalar& {
                     return encoding[(c * count + p) * entries + entry];
                   };
                   at(0) = phi.value;
                   if (plane > 1) at(1 + which) = phi.first;
                   if (plane > 3) at(3 + which) = phi.second;
                 });
  for (int l = 0; l < shape.layers; ++l) {
    const Tensor& below = l == 0 ? memory.encoding : memory.activations[l - 1];
    const Index rows = l == 0 ? encoded_rows(plane, count) : below.size(0);
    Tensor pre = memory.pre[l].narrow(0, 0, rows);
    multiply(pre, below.narrow(0, 0, rows), network.weights[l].t());
    ARAPFIELDS_DISPATCH(activate_columns(block_of<Scalar>(shape, memory, l, network.biases[l])));
  }
  multiply(memory.output, memory.activations.back(), network.weights.back().t());
  memory.output.narrow(0, 0, count).add(network.biases.back());
}

/// What coupling layer i meets at point p: the coordinate x that it moves, the other two, and the plane jets
/// of (s, t) by these.
template <class Scalar>
struct Place {
  Place(const Scalar* jets, const Scalar* output, Index count, Index p, int i, int columns)
      : x(gather<NumberJet<Scalar>>(jets, count, 3, p, i % 3, columns)),
        u(gather<NumberJet<Scalar>>(jets, count, 3, p, (i + 1) % 3, columns)),
        v(gather<NumberJet<Scalar>>(jets, count, 3, p, (i + 2) % 3, columns)),
        s(gather<PlaneJet<Scalar>>(output, count, 2, p, 0, plane_columns(columns))),
        t(gather<PlaneJet<Scalar>>(output, count, 2, p, 1, plane_columns(columns))) {}
  NumberJet<Scalar> x, u, v;
  PlaneJet<Scalar> s, t;
};

template <class Scalar>
Tensor couple_as(const CouplingShape& shape, const CouplingViews& views, const Tensor& points, JetOrder order,
                 std::vector<CouplingMemory>& memory) {
  const Index count = points.size(0);
  const int columns_here = columns(order);
  Tensor jets = memory.front().jets;
  jets.set_zero();
  jets[0].assign(points);
  for (int k = 0; k < 3 && columns_here > 1; ++k) jets[first_column(k)].select(1, k).fill(1.0);
  for (int i = 0; i < shape.couplings; ++i) {
    CouplingMemory& here = memory[i % memory.size()];
    condition<Scalar>(shape, views, i, here);
    Tensor next = i + 1 < shape.couplings && memory.size() > 1 ? memory[i + 1].jets : jets;
    if (i + 1 == shape.couplings && memory.size() > 1) next = empty_like(jets);
    if (!is_same(next, here.jets)) next.assign(here.jets);
    auto* moved = next.data<Scalar>();
    const auto* output = here.output.data<Scalar>();
    for (Index p = 0; p < count; ++p) {
      const Place<Scalar> here_at(moved, output, count, p, i, columns_here);
      const NumberJet<Scalar> s = chain(here_at.s, here_at.u, here_at.v, columns_here);
      NumberJet<Scalar> y = product(chain(bounded_exp(s[0]), s, columns_here), here_at.x, columns_here);
      const NumberJet<Scalar> t = chain(here_at.t, here_at.u, here_at.v, columns_here);
      for (int c = 0; c < columns_here; ++c) y[c] += t[c];
      scatter(y, moved, count, 3, p, i % 3, columns_here);
    }
    jets = next;
  }
  Tensor result = memory.size() > 1 && shape.couplings > 0 ? jets : jets.clone();
  result[0].add(views.offset);
  return result;
}

template <class Scalar>
void couple_back_as(const CouplingShape& shape, const CouplingViews& views, const Tensor& cotangents,
                    std::vector<CouplingMemory>& memory, CouplingViews& gradient) {
  Tensor given = cotangents.clone();
  const Index count = given.size(1), entries = shape.fan_in(0);
  const int columns_here = static_cast<int>(given.size(0));
  gradient.offset += sum(given[0], {0});
  auto* pull = given.data<Scalar>();
  const int plane = plane_columns(columns_here);
  const Tensor upper = empty({plane * count, 2}, given);
  Tensor wide = empty({plane * count, shape.width}, given);
  Tensor spare = empty_like(wide);
  Tensor encoded = empty({encoded_rows(plane, count), entries}, given);
  for (int i = shape.couplings - 1; i >= 0; --i) {
    CouplingMemory& here = memory[i];
    const CouplingViews::Network& network = views.networks[i];
    CouplingViews::Network& into = gradient.networks[i];
    const auto* jets = here.jets.data<Scalar>();
    const auto* output = here.output.data<Scalar>();
    auto* of_output = upper.data<Scalar>();
    for (Index p = 0; p < count; ++p) {
      const Place<Scalar> at(jets, output, count, p, i, columns_here);
      const auto given_to = [&](int axis) {
        return gather<NumberJet<Scalar>>(pull, count, 3, p, axis % 3, columns_here);
      };
      const NumberJet<Scalar> g = given_to(i), s = chain(at.s, at.u, at.v, columns_here);
      const Derivatives<Scalar> phi = bounded_exp(s[0]);
      NumberJet<Scalar> of_x, of_e, of_s, of_u = given_to(i + 1), of_v = given_to(i + 2);
      product_back(chain(phi, s, columns_here), g, of_x, columns_here);
      product_back(at.x, g, of_e, columns_here);
      chain_back(phi, s, of_e, of_s, columns_here);
      scatter(chain_back(at.s, at.u, at.v, of_s, of_u, of_v, columns_here), of_output, count, 2, p, 0, plane);
      scatter(chain_back(at.t, at.u, at.v, g, of_u, of_v, columns_here), of_output, count, 2, p, 1, plane);
      scatter(of_x, pull, count, 3, p, i % 3, columns_here);
      scatter(of_u, pull, count, 3, p, (i + 1) % 3, columns_here);
      scatter(of_v, pull, count, 3, p, (i + 2) % 3, columns_here);
    }
    into.biases.back() += sum(upper.narrow(0, 0, count), {0});
    add_multiplied(into.weights.back(), upper.t(), here.activations.back());
    multiply(wide, upper, network.weights.back());
    for (int l = shape.layers - 1; l >= 0; --l) {
      ARAPFIELDS_DISPATCH(activate_columns_back(block_of<Scalar>(shape, here, l, network.biases[l]),
                                                wide.data<Scalar>(), into.biases[l].data<Scalar>()));
      const Tensor& below = l == 0 ? here.encoding : here.activations[l - 1];
      const Index rows = l == 0 ? encoded.size(0) : below.size(0);
      const Tensor used = wide.narrow(0, 0, rows);
      add_multiplied(into.weights[l], used.t(), below.narrow(0, 0, rows));
      multiply(l == 0 ? encoded : spare, used, network.weights[l]);
      if (l > 0) std::swap(wide, spare);
    }
    const auto* of_entries = encoded.data<Scalar>();
    for (Index p = 0; p < count; ++p)
      for (int which = 0; which < 2; ++which) {
        const Index coordinate = 3 * p + (i + 1 + which) % 3;
        Scalar back = 0;
        each_entry(shape, jets[coordinate], which, [&](Index entry, const Derivatives<Scalar>& phi) {
          const auto of = [&](int c) { return of_entries[(c * count + p) * entries + entry]; };
          back += phi.first * of(0);
          if (plane > 1) back += phi.second * of(1 + which);
          if (plane > 3) back += phi.third * of(3 + which);
        });
        pull[coordinate] += back;
      }
  }
}

/// Coordinates stay in double precision whatever the networks have: the way back meets the same u to
/// rounding, and so nearly the same numbers.
template <class Scalar>
void move_as(const CouplingShape& shape, const CouplingViews& views, Tensor points, bool back) {
  CouplingMemory here = coupling_memory(shape, views.offset, points.size(0), 1, false).front();
  auto* moved = points.data<double>();
  const Tensor offset = views.offset.to(NumberType::float64);
  if (back) points -= offset;
  for (int step = 0; step < shape.couplings; ++step) {
    const int i = back ? shape.couplings - 1 - step : step;
    here.jets[0].assign(points);
    condition<Scalar>(shape, views, i, here);
    const auto* output = here.output.data<Scalar>();
    for (Index p = 0; p < points.size(0); ++p) {
      double& x = moved[3 * p + i % 3];
      const double e = bounded_exp(static_cast<double>(output[2 * p])).value, t = output[2 * p + 1];
      x = back ? (x - t) / e : x * e + t;
    }
  }
  if (!back) points.add(offset);
}

}  // namespace

CouplingViews::CouplingViews(const CouplingShape& shape, const Tensor& flat) {
  Index begin = 0;
  for (int i = 0; i < shape.couplings; ++i) {
    Network& network = networks.emplace_back();
    for (int l = 0; l <= shape.layers; ++l) {
      const Index out = shape.fan_out(l), in = shape.fan_in(l);
      network.weights.push_back(flat.narrow(0, begin, out * in).view({out, in}));
      network.biases.push_back(flat.narrow(0, begin + out * in, out));
      begin += out * (in + 1);
    }
  }
  offset = flat.narrow(0, begin, 3);
}

std::vector<CouplingMemory> coupling_memory(const CouplingShape& shape, const Tensor& like, Index count,
                                            int columns, bool keep) {
  std::vector<CouplingMemory> memory(keep ? static_cast<std::size_t>(shape.couplings) : 1);
  const Index rows = plane_columns(columns) * count;
  const auto make = [&](Index height, Index width) { return zeros({height, width}, like); };
  for (CouplingMemory& layer : memory) {
    layer.jets = empty({columns, count, 3}, like);
    layer.encoding = make(rows, shape.fan_in(0));
    layer.output = make(rows, 2);
    for (int l = 0; l < shape.layers; ++l) {
      layer.pre.push_back(make(rows, shape.width));
      layer.activations.push_back(make(rows, shape.width));
      layer.slope.push_back(make(count, shape.width));
    }
  }
  return memory;
}

Tensor couple(const CouplingShape& shape, const CouplingViews& views, const Tensor& points, JetOrder order,
              std::vector<CouplingMemory>& memory) {
  return points.is_double() ? couple_as<double>(shape, views, points, order, memory)
                            : couple_as<float>(shape, views, points, order, memory);
}

void couple_back(const CouplingShape& shape, const CouplingViews& views, const Tensor& cotangents,
                 std::vector<CouplingMemory>& memory, CouplingViews& gradient) {
  if (cotangents.is_double())
    couple_back_as<double>(shape, views, cotangents, memory, gradient);
  else
    couple_back_as<float>(shape, views, cotangents, memory, gradient);
}

void move_points(const CouplingShape& shape, const CouplingViews& views, Tensor points, bool back) {
  if (views.offset.is_double())
    move_as<double>(shape, views, points, back);
  else
    move_as<float>(shape, views, points, back);
}

}  // namespace arapfields
