// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include "extraction/extract_surface.h"
#include "fields/field.h"

namespace arapfields {

/// Evaluations, inverses and topology of a call of extract_deformed.
struct DeformedReport : ExtractionReport {
  Index inverted = 0;    ///< points at which f⁻¹ was evaluated
  Index failures = 0;    ///< of these, points where none was found beside the surface
  double spacing = 0.0;  ///< of the grid, in mesh coordinates
};

/// {Φ∘f⁻¹ = 0} in mesh coordinates: marching cubes as in extract_surface, on a cube around the deformed
/// surface. f⁻¹ is Newton's method, or `inverse` where it is not null (a trained one). It is evaluated near
/// the deformed surface alone, known from a mesh that is extracted at rest and moved (see DeformedFunction).
/// Throws InvalidInput as extract_surface does, and where the field is not finite.
ARAPFIELDS_EXPORT TriangleMesh extract_deformed(const ImplicitFunction& rest, const DeformationField& field,
                                                const DeformationField* inverse,
                                                const ExtractionOptions& options,
                                                const Progress& progress = {},
                                                DeformedReport* report = nullptr);
inline TriangleMesh extract_deformed(const ImplicitFunction& rest, const DeformationField& field,
                                     const DeformationField* inverse = nullptr,
                                     int resolution = ExtractionOptions().resolution,
                                     const Progress& progress = {}, DeformedReport* report = nullptr) {
  return extract_deformed(rest, field, inverse, ExtractionOptions{.resolution = resolution}, progress,
                          report);
}

}  // namespace arapfields
