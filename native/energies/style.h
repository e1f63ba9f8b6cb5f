// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <memory>
#include <optional>

#include "energies/gauss.h"
#include "energies/object_style.h"

namespace arapfields {

class JetTerm;

/// A style: preferred normals (k,3), or the map of directions T of an object.
struct Style {
  Style(Points normals) : preferred(std::move(normals)) {}
  Style(ObjectStyle of) : object(std::move(of)) {}

  Points preferred;
  std::optional<ObjectStyle> object;
};

/// A style at n samples.
struct StyleAtSamples {
  std::optional<GaussPreference> preference;  ///< none: targets
  Points targets;                             ///< (n,3) unit normals T(n) of an ObjectStyle; or empty
  Vector weights;                             ///< (n) weight of the style at each sample
  double factor = 1.0;                        ///< of the style's weight

  /// The weight of the style at this strength, relative to its whole one: so that half of the strength moves
  /// a surface by about half of the way, where more than the style moves it. Above 1, the strength itself.
  double share(double strength) const;

  /// At samples with these rest normals (n,3). An object's map is smoothed less the larger the sharpness is;
  /// 0 stands for 5. Throws InvalidInput as gauss_preference() does.
  static StyleAtSamples of(const Style& style, PointsIn normals, double sharpness);
  bool any() const { return preference.has_value() || targets.rows() > 0; }
  /// Whether the rest normals are at their targets already, as with a sphere's style or none.
  bool idle(PointsIn normals) const;
};

/// gauss_energy of a preference, target_energy without one.
template <class Scalar>
double style_energy(JetView<const Scalar> jets, ConstPointsRef<Scalar> normals,
                    const std::optional<GaussPreference>& preference, ConstPointsRef<Scalar> targets,
                    const Eigen::Ref<const Eigen::VectorX<Scalar>>& sample_weights, double weight,
                    JetView<Scalar> cotangents) {
  if (preference) return gauss_energy<Scalar>(jets, normals, sample_weights, *preference, weight, cotangents);
  return target_energy<Scalar>(jets, normals, targets, sample_weights, weight, cotangents);
}

/// weight · style_energy() of a batch of the samples. Its own weights count, or 1 where there are none; fresh
/// samples have weight 1, or 0 for an object's style.
std::shared_ptr<JetTerm> style_term(StyleAtSamples style, double weight);

/// The preference in reports, mean g or mean ñ·t, from style_energy() with weights 1.
inline double preference_of(const std::optional<GaussPreference>& preference, double style_energy) {
  return 1.0 - (preference ? 1.0 : 0.5) * style_energy;
}

}  // namespace arapfields
