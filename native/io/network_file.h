// SPDX-License-Identifier: GPL-3.0-or-later
// A network's part of a file: its shape in the structure, layers.l.weight (out, in) and layers.l.bias (out)
// as single precision arrays.
#pragma once

#include "io/archive.h"
#include "io/document.h"
#include "neural/mlp.h"

namespace arapfields {

Json network_structure(const MlpShape& shape);
/// The shape, with `outputs` outputs and all its numbers within their ranges.
MlpShape read_shape(const Json& network, const std::string& name, int outputs);

/// `parameters` (in the order of Mlp::parameters()) must outlive the writer's save().
void add_network(ArchiveWriter& file, const std::string& prefix, const MlpShape& shape,
                 const VectorF& parameters);
VectorF read_network(ArchiveReader& file, const std::string& prefix, const MlpShape& shape);

}  // namespace arapfields
