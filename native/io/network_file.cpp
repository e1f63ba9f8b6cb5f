// SPDX-License-Identifier: GPL-3.0-or-later
#include "io/network_file.h"

#include "core/errors.h"
#include "io/document.h"
#include "io/files.h"
#include "neural/parameters.h"

namespace arapfields {
namespace {

constexpr const char* sdf_kind = "sdf";

/// Calls use(name, shape, offset) for each array of a network, in the order of its parameters.
template <class Use>
void for_each_array(const std::string& prefix, const MlpShape& shape, Use&& use) {
  Index offset = 0;
  for (int l = 0; l <= shape.layers; ++l) {
    const std::string layer = prefix + "layers." + std::to_string(l);
    const Index out = shape.fan_out(l), in = shape.fan_in(l);
    use(layer + ".weight", std::vector<Index>{out, in}, offset);
    use(layer + ".bias", std::vector<Index>{out}, offset + out * in);
    offset += out * (in + 1);
  }
}

}  // namespace

Json network_structure(const MlpShape& shape) {
  return {{"outputs", shape.outputs},     {"width", shape.width},
          {"layers", shape.layers},       {"octaves", shape.octaves},
          {"frequency", shape.frequency}, {"sharpness", shape.softplus_sharpness}};
}

MlpShape read_shape(const Json& network, const std::string& name, int outputs) {
  const JsonObject object(network, name, {"outputs", "width", "layers", "octaves", "frequency", "sharpness"});
  const auto count = [&](const char* member) { return static_cast<int>(object.integer(member, 1, 1 << 20)); };
  MlpShape shape;
  shape.outputs = count("outputs");
  shape.width = count("width");
  shape.layers = count("layers");
  shape.octaves = count("octaves");
  shape.frequency = object.number("frequency");
  shape.softplus_sharpness = object.number("sharpness");
  validate(shape);
  require(shape.outputs == outputs, object.name("outputs"), std::to_string(shape.outputs),
          std::to_string(outputs) + " of a network's outputs are needed");
  return shape;
}

void add_network(ArchiveWriter& file, const std::string& prefix, const MlpShape& shape,
                 const VectorF& parameters) {
  for_each_array(prefix, shape, [&](const std::string& name, const std::vector<Index>& size, Index offset) {
    file.add(name, size, parameters.data() + offset);
  });
}

VectorF read_network(ArchiveReader& file, const std::string& prefix, const MlpShape& shape) {
  std::vector<VectorF> parts;  // each is seen to be there before all are put together
  for_each_array(prefix, shape, [&](const std::string& name, const std::vector<Index>& size, Index) {
    parts.push_back(file.floats(name, size));
  });
  VectorF parameters(parameter_count(shape));
  Index next = 0;
  for (const VectorF& part : parts) {
    parameters.segment(next, part.size()) = part;
    next += part.size();
  }
  return parameters;
}

void save_sdf(const std::string& path, const NeuralSdf& sdf, const std::string& report) {
  const MlpShape& shape = sdf.mlp().shape();
  const VectorF parameters = parameters_of(sdf.mlp());
  ArchiveWriter arrays;
  add_network(arrays, "", shape, parameters);
  save_document(path, sdf_kind,
                {{"network", network_structure(shape)}, {"frame", frame_structure(sdf.frame())}}, report,
                arrays);
}

std::shared_ptr<NeuralSdf> load_sdf(const std::string& path, std::string* report) {
  std::shared_ptr<NeuralSdf> sdf;
  load_document(path, sdf_kind, report, [&](ArchiveReader& file, int, const Json& structure) {
    const JsonObject object(structure, "structure", {"network", "frame"});
    const MlpShape shape = read_shape(object.at("network"), object.name("network"), 1);
    const Frame frame = read_frame(object.at("frame"), object.name("frame"));
    const VectorF parameters = read_network(file, "", shape);
    Mlp mlp(shape, 0, true);
    set_parameters(mlp, parameters);
    sdf = std::make_shared<NeuralSdf>(std::move(mlp), frame);
  });
  return sdf;
}

}  // namespace arapfields
