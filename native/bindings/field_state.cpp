// SPDX-License-Identifier: GPL-3.0-or-later
#include "bindings/field_state.h"

#include "fields/neural_field.h"
#include "fields/radial_field.h"

namespace arapfields::python {
namespace {

bool has(const py::dict& state, const char* key) { return state.contains(key); }

py::object get(const py::dict& state, const char* key) {
  require(has(state, key), "file", std::string("'") + key + "' is missing",
          "a file written by save is needed");
  return state[key];
}

template <class Value>
Value get_as(const py::dict& state, const char* key) {
  try {
    return py::cast<Value>(get(state, key));
  } catch (const py::cast_error&) {
    throw InvalidInput("file", std::string("'") + key + "' has another type",
                       "a file written by save is needed");
  }
}

py::dict handles_state(const HandleBlend& blend) {
  const Index count = static_cast<Index>(blend.regions().size());
  Eigen::MatrixXd placements(count, 16), motions(count, 16);
  Vector margins(count);
  for (Index i = 0; i < count; ++i) {
    const RigidRegion& region = blend.regions()[static_cast<std::size_t>(i)];
    placements.row(i) = region.placement.reshaped<Eigen::RowMajor>().transpose();
    motions.row(i) = region.motion.reshaped<Eigen::RowMajor>().transpose();
    margins[i] = region.margin;
  }
  return py::dict("placements"_a = placements, "motions"_a = motions, "margins"_a = margins);
}

std::shared_ptr<const HandleBlend> handles_from(const py::dict& state) {
  const Eigen::MatrixXd placements = as_matrix(get(state, "placements"), "placements");
  const Eigen::MatrixXd motions = as_matrix(get(state, "motions"), "motions");
  const Vector margins = as_vector(get(state, "margins"), "margins");
  require(placements.cols() == 16 && motions.cols() == 16 && motions.rows() == placements.rows() &&
              margins.size() == placements.rows(),
          "file", "handle arrays of different lengths", "a file written by save is needed");
  std::vector<RigidRegion> regions;
  for (Index i = 0; i < margins.size(); ++i) {
    RigidRegion region;
    region.placement = placements.row(i).reshaped<Eigen::RowMajor>(4, 4);
    region.motion = motions.row(i).reshaped<Eigen::RowMajor>(4, 4);
    region.margin = margins[i];
    region.name = "handles[" + std::to_string(i) + "]";
    regions.push_back(region);
  }
  return std::make_shared<HandleBlend>(std::move(regions));
}

py::dict neural_state(const NeuralField& field) {
  const MlpShape& shape = field.shape();
  py::dict state("kind"_a = "neural", "width"_a = shape.width, "layers"_a = shape.layers,
                 "octaves"_a = shape.octaves, "frequency"_a = shape.frequency,
                 "sharpness"_a = shape.softplus_sharpness, "weights"_a = field.weights());
  if (field.handles()) state["handles"] = handles_state(*field.handles());
  if (field.base()) state["base"] = field_state(*field.base());
  return state;
}

std::shared_ptr<DeformationField> neural_from(const py::dict& state) {
  const NetworkOptions network{get_as<int>(state, "width"), get_as<int>(state, "layers"),
                               get_as<int>(state, "octaves"), get_as<double>(state, "frequency"),
                               get_as<double>(state, "sharpness")};
  const MlpShape shape{network, 3};
  auto field = std::make_shared<NeuralField>(shape, 0);
  field->set_weights(as_vector(get(state, "weights"), "weights").cast<float>());
  if (has(state, "handles")) field->set_handles(handles_from(get_as<py::dict>(state, "handles")));
  if (has(state, "base")) field->set_base(field_from_state(get_as<py::dict>(state, "base")));
  return field;
}

py::dict radial_state(const RadialField& field) {
  py::dict state("kind"_a = "radial", "centers"_a = field.basis().centers, "radii"_a = field.basis().radii,
                 "coefficients"_a = field.coefficients());
  if (const InteriorEmbedding* embedding = field.basis().embedding.get())
    state["embedding"] = py::dict("nodes"_a = embedding->nodes, "values"_a = embedding->values,
                                  "slopes"_a = embedding->slopes, "width"_a = embedding->width);
  return state;
}

std::shared_ptr<DeformationField> radial_from(const py::dict& state) {
  RadialBasis basis;
  basis.centers = as_points(get(state, "centers"), "centers");
  basis.radii = as_vector(get(state, "radii"), "radii");
  if (has(state, "embedding")) {
    const py::dict embedding = get_as<py::dict>(state, "embedding");
    basis.set_embedding(std::make_shared<const InteriorEmbedding>(InteriorEmbedding{
        as_points(get(embedding, "nodes"), "nodes"), as_points(get(embedding, "values"), "values"),
        as_matrix(get(embedding, "slopes"), "slopes"), get_as<double>(embedding, "width")}));
  }
  return std::make_shared<RadialField>(std::move(basis),
                                       as_points(get(state, "coefficients"), "coefficients"));
}

}  // namespace

py::dict field_state(const DeformationField& field) {
  const auto* neural = dynamic_cast<const NeuralField*>(&field);
  const auto* radial = dynamic_cast<const RadialField*>(&field);
  require(neural != nullptr || radial != nullptr, "field", "a kind without a file format",
          "neural and radial fields can be saved");
  py::dict state = neural != nullptr ? neural_state(*neural) : radial_state(*radial);
  state["center"] = field.frame().center;
  state["scale"] = field.frame().scale;
  state["rest_points"] = field.rest_points();
  return state;
}

std::shared_ptr<DeformationField> field_from_state(const py::dict& state) {
  const std::string kind = get_as<std::string>(state, "kind");
  require(kind == "neural" || kind == "radial", "file", "a field of kind '" + kind + "'",
          "this version reads 'neural' and 'radial'");
  const std::shared_ptr<DeformationField> field = kind == "neural" ? neural_from(state) : radial_from(state);
  field->set_frame({as_vec3(get(state, "center"), "center"), get_as<double>(state, "scale")});
  field->set_rest_points(as_points(get(state, "rest_points"), "rest_points"));
  return field;
}

}  // namespace arapfields::python
