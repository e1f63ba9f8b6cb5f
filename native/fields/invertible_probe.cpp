// SPDX-License-Identifier: GPL-3.0-or-later
#include "fields/invertible_probe.h"

#include "core/errors.h"
#include "core/parallel.h"
#include "fields/invertible_field.h"
#include "tensors/views.h"

namespace arapfields {

InvertibleProbe probe_invertible(const CouplingShape& shape, const Vector& parameters, PointsIn points,
                                 JetOrder order, const Vector& cotangents) {
  const ThreadScope scope;
  InvertibleField field(shape, 0, true);
  require(parameters.size() == field.parameters().count(), "parameters",
          std::to_string(parameters.size()) + " numbers",
          std::to_string(field.parameters().count()) + " are needed");
  field.parameters().assign(tensor_view(parameters));
  const Tensor jets = field.forward_at(points, order);
  InvertibleProbe result;
  result.jets = vector_of(jets);
  result.preimages = field.preimages(points_of(jets[0]));
  if (cotangents.size() == 0) return result;
  require(cotangents.size() == result.jets.size(), "cotangents",
          std::to_string(cotangents.size()) + " numbers", "as many as the jets' are needed");
  field.pull_back(tensor_view(cotangents).view_like(jets).clone());
  result.gradient = vector_of(field.gradient());
  return result;
}

}  // namespace arapfields
