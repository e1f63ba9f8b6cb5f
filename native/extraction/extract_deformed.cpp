// SPDX-License-Identifier: GPL-3.0-or-later
#include "extraction/extract_deformed.h"

#include <algorithm>

#include "core/errors.h"
#include "extraction/deformed_function.h"

namespace arapfields {
namespace {

constexpr double half_extent = 0.9;     // of the deformed surface in the cube
constexpr double band_in_cells = 2.0;   // where Φ∘f⁻¹ is the function, and its steepest
constexpr double share_at_rest = 0.15;  // of the work

}  // namespace

TriangleMesh extract_deformed(const ImplicitFunction& rest, const DeformationField& field,
                              const DeformationField* inverse, const ExtractionOptions& options,
                              const Progress& progress, DeformedReport* report) {
  options.validate();
  const int resolution = options.resolution;
  const TriangleMesh mesh = extract_surface(rest, options, progress.part(0.0, share_at_rest));
  Points moved = values_at(field, field.frame().to_cube(mesh.vertices), progress);
  require(moved.allFinite(), "field", "its values are NaN or infinite on the surface",
          "a finite deformation is needed");
  moved = field.frame().to_mesh(moved);
  const Frame frame = Frame::around(moved, half_extent);
  const double spacing = 2.0 / (resolution - 1) * std::max(frame.scale, rest.frame().scale);
  const DeformedShape shape{.rest = rest,
                            .field = field,
                            .inverse = inverse,
                            .mesh = mesh,
                            .moved = moved,
                            .band = band_in_cells * spacing};
  progress.report(share_at_rest, "inverting the field");
  const DeformedFunction function(shape, frame, progress);
  ExtractionReport done;
  TriangleMesh result = extract_surface(function, options, progress.part(share_at_rest, 1.0), &done);
  if (report != nullptr) {
    static_cast<ExtractionReport&>(*report) = done;
    report->inverted = function.inverted();
    report->failures = function.failures();
    report->spacing = 2.0 / (resolution - 1) * frame.scale;
  }
  return result;
}

}  // namespace arapfields
