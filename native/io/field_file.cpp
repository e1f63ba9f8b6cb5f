// SPDX-License-Identifier: GPL-3.0-or-later
#include <algorithm>
#include <cmath>
#include <deque>

#include "core/errors.h"
#include "fields/composed_field.h"
#include "fields/invertible_field.h"
#include "fields/neural_field.h"
#include "fields/radial_field.h"
#include "io/document.h"
#include "io/files.h"
#include "neural/layers.h"
#include "neural/mlp.h"

namespace arapfields {

// A network's part of a file: its shape in the structure, layers.l.weight (out, in) and layers.l.bias (out)
// as single precision arrays.

Json network_structure(const MlpShape& shape);
/// The shape, with `outputs` outputs and all its numbers within their ranges.
MlpShape read_shape(const Json& network, const std::string& name, int outputs);

/// `parameters` (in the order of Mlp::parameters()) must outlive the writer's save().
void add_network(ArchiveWriter& file, const std::string& prefix, const MlpShape& shape,
                 const VectorF& parameters);
VectorF read_network(ArchiveReader& file, const std::string& prefix, const MlpShape& shape);

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

namespace {

constexpr const char* field_kind = "field";
constexpr Index most_couplings = 256;
constexpr int most_repeats = 256;
constexpr std::size_t most_steps = 100000;
constexpr const char* field_types = "'neural', 'radial', 'invertible' or 'composed' is needed";
constexpr Index most_rows = Index{1} << 40;  ///< declared; what there is of them is the file's size

std::string step_prefix(const std::string& prefix, std::size_t step) {
  return prefix + "steps[" + std::to_string(step) + "].";
}

std::string part_prefix(const std::string& prefix, std::size_t part) {
  return prefix + "parts[" + std::to_string(part) + "].";
}

/// Adds a field's arrays to a file and owns those that are copies.
class FieldArrays {
 public:
  void add(const DeformationField& field, const std::string& prefix) {
    if (const auto* neural = dynamic_cast<const NeuralField*>(&field))
      add_neural(*neural, prefix);
    else if (const auto* radial = dynamic_cast<const RadialField*>(&field))
      add_radial(*radial, prefix);
    else if (const auto* invertible = dynamic_cast<const InvertibleField*>(&field))
      add_invertible(*invertible, prefix);
    else if (const auto* composed = dynamic_cast<const ComposedField*>(&field))
      add_composed(*composed, prefix);
    add_rows(prefix + "rest_points", field.rest_points());
  }
  ArchiveWriter file;

 private:
  template <class Rows>
  void add_rows(const std::string& name, const Rows& rows) {
    file.add(name, {rows.rows(), rows.cols()}, rows.data());
  }
  void add_neural(const NeuralField& field, const std::string& prefix) {
    add_network(file, prefix, field.shape(), kept_.emplace_back(field.weights()));
    if (field.handles()) add_handles(*field.handles(), prefix + "handles.");
    if (field.base()) add(*field.base(), prefix + "base.");
  }
  void add_invertible(const InvertibleField& field, const std::string& prefix) {
    const VectorF& numbers = kept_.emplace_back(field.weights());
    file.add(prefix + "parameters", {numbers.size()}, numbers.data());
  }
  void add_handles(const HandleBlend& blend, const std::string& prefix) {
    const Index count = static_cast<Index>(blend.regions().size());
    Vector &placements = doubles_.emplace_back(16 * count), &motions = doubles_.emplace_back(16 * count),
           &margins = doubles_.emplace_back(count);
    for (Index i = 0; i < count; ++i) {
      const RigidRegion& region = blend.regions()[i];
      placements.segment<16>(16 * i) = region.placement.reshaped<Eigen::RowMajor>();
      motions.segment<16>(16 * i) = region.motion.reshaped<Eigen::RowMajor>();
      margins[i] = region.margin;
    }
    file.add(prefix + "placements", {count, 4, 4}, placements.data());
    file.add(prefix + "motions", {count, 4, 4}, motions.data());
    file.add(prefix + "margins", {count}, margins.data());
  }
  void add_radial(const RadialField& field, const std::string& prefix) {
    const RadialBasis& basis = field.basis();
    add_rows(prefix + "centers", basis.centers);
    file.add(prefix + "radii", {basis.radii.size()}, basis.radii.data());
    add_rows(prefix + "coefficients", field.coefficients());
    if (const Influence* influence = field.influence().get()) {
      add_rows(prefix + "influence.places", influence->places());
      file.add(prefix + "influence.reaches", {influence->reaches().size()}, influence->reaches().data());
    }
    if (!basis.embedding) return;
    add_embedding(*basis.embedding, prefix + "embedding.");
  }
  void add_embedding(const InteriorEmbedding& embedding, const std::string& prefix) {
    add_rows(prefix + "nodes", embedding.nodes);
    add_rows(prefix + "values", embedding.values);
    add_rows(prefix + "slopes", embedding.slopes);
    if (embedding.sight) add_sight(*embedding.sight, prefix + "sight.");
    for (std::size_t k = 0; k < embedding.parts.size(); ++k) {
      const EmbeddingPart& part = embedding.parts[k];
      const std::string own = part_prefix(prefix, k);
      add_embedding(part.embedding, own);
      const Index n = part.embedding.nodes.rows();
      Vector& shares = doubles_.emplace_back(part.share.values.col(0));
      file.add(own + "shares", {n}, shares.data());
      Vector& slopes =
          doubles_.emplace_back(RowMatrix<double>(part.share.slopes.leftCols(3)).reshaped<Eigen::RowMajor>());
      file.add(own + "share_slopes", {n, 3}, slopes.data());
      Vector& ball = doubles_.emplace_back(4);
      ball << part.ball.center, part.ball.radius;
      file.add(own + "ball", {4}, ball.data());
      Vector& sides = doubles_.emplace_back(n);
      std::copy(part.sides.begin(), part.sides.end(), sides.begin());
      file.add(own + "sides", {n}, sides.data());
    }
  }
  void add_sight(const NodeSight& sight, const std::string& prefix) {
    const auto add_list = [&](const char* name, const auto& list) {
      Vector& kept = doubles_.emplace_back(std::ssize(list));
      std::copy(list.begin(), list.end(), kept.begin());
      file.add(prefix + name, {kept.size()}, kept.data());
    };
    add_rows(prefix + "normals", sight.normals);
    add_list("starts", sight.starts);
    add_list("others", sight.others);
    add_list("excess", sight.excess);
    add_rows(prefix + "places", sight.places());
    add_list("sides", sight.sides());
  }

  void add_composed(const ComposedField& field, const std::string& prefix) {
    for (std::size_t i = 0; i < field.steps().size(); ++i)
      add_radial(*field.steps()[i].map, step_prefix(prefix, i));
  }

  std::deque<VectorF> kept_;  // whose elements stay where they are
  std::deque<Vector> doubles_;
};

Json embedding_structure(const InteriorEmbedding& embedding) {
  Json structure{{"nodes", embedding.nodes.rows()}, {"width", embedding.width}};
  if (embedding.sight)
    structure["sight"] = {{"pairs", std::ssize(embedding.sight->others)},
                          {"places", embedding.sight->places().rows()},
                          {"reach", embedding.sight->reach}};
  for (const EmbeddingPart& part : embedding.parts)
    structure["parts"].push_back(embedding_structure(part.embedding));
  return structure;
}

void add_radial_structure(const RadialField& field, Json& structure) {
  structure["centers"] = field.basis().center_count();
  if (field.influence()) structure["influence"] = field.influence()->places().rows();
  if (const InteriorEmbedding* embedding = field.basis().embedding.get()) {
    structure["embedding"] = embedding_structure(*embedding);
  }
}

Json structure_of(const DeformationField& field) {
  Json structure{{"frame", frame_structure(field.frame())}, {"rest_points", field.rest_points().rows()}};
  if (const auto* neural = dynamic_cast<const NeuralField*>(&field)) {
    structure["type"] = "neural";
    structure["network"] = network_structure(neural->shape());
    if (neural->handles()) structure["handles"] = neural->handles()->regions().size();
    if (neural->base()) structure["base"] = structure_of(*neural->base());
  } else if (const auto* radial = dynamic_cast<const RadialField*>(&field)) {
    structure["type"] = "radial";
    add_radial_structure(*radial, structure);
  } else if (const auto* composed = dynamic_cast<const ComposedField*>(&field)) {
    structure["type"] = "composed";
    structure["steps"] = Json::array();
    for (const FieldStep& step : composed->steps()) {
      Json& one = structure["steps"].emplace_back(Json{{"repeats", step.repeats}});
      add_radial_structure(*step.map, one);
    }
  } else if (const auto* invertible = dynamic_cast<const InvertibleField*>(&field)) {
    structure["type"] = "invertible";
    structure["network"] = network_structure(MlpShape{invertible->shape(), 2});
    structure["couplings"] = invertible->shape().couplings;
  } else {
    throw InvalidInput("field", "a kind without a file format",
                       "neural, invertible, radial and composed fields can be saved");
  }
  return structure;
}

std::shared_ptr<const HandleBlend> read_handles(ArchiveReader& file, const std::string& prefix, Index count) {
  const Vector placements = file.doubles(prefix + "placements", {count, 4, 4});
  const Vector motions = file.doubles(prefix + "motions", {count, 4, 4});
  const Vector margins = file.doubles(prefix + "margins", {count});
  std::vector<RigidRegion> regions(count);
  for (Index i = 0; i < count; ++i) {
    RigidRegion& region = regions[i];
    region.placement = placements.segment<16>(16 * i).reshaped<Eigen::RowMajor>(4, 4);
    region.motion = motions.segment<16>(16 * i).reshaped<Eigen::RowMajor>(4, 4);
    region.margin = margins[i];
    region.name = "handles[" + std::to_string(i) + "]";
  }
  return std::make_shared<HandleBlend>(std::move(regions));
}

std::shared_ptr<DeformationField> read_field(ArchiveReader& file, const Json& structure,
                                             const std::string& name, const std::string& prefix);

std::shared_ptr<DeformationField> read_neural(ArchiveReader& file, const Json& structure,
                                              const std::string& name, const std::string& prefix) {
  const JsonObject object(structure, name, {"type", "frame", "rest_points", "network", "handles", "base"});
  const MlpShape shape = read_shape(object.at("network"), object.name("network"), 3);
  const VectorF weights = read_network(file, prefix, shape);
  const auto field = std::make_shared<NeuralField>(shape, 0);
  field->set_weights(weights);
  if (object.has("handles"))
    field->set_handles(read_handles(file, prefix + "handles.", object.integer("handles", 0, most_rows)));
  if (object.has("base"))
    field->set_base(read_field(file, object.at("base"), object.name("base"), prefix + "base."));
  return field;
}

std::shared_ptr<DeformationField> read_invertible(ArchiveReader& file, const Json& structure,
                                                  const std::string& name, const std::string& prefix) {
  const JsonObject object(structure, name, {"type", "frame", "rest_points", "network", "couplings"});
  CouplingShape shape{read_shape(object.at("network"), object.name("network"), 2)};
  shape.couplings = static_cast<int>(object.integer("couplings", 1, most_couplings));
  const VectorF numbers = file.floats(prefix + "parameters", {shape.size()});
  const auto field = std::make_shared<InvertibleField>(shape, 0);
  field->set_weights(numbers);
  return field;
}

/// Whole numbers from 0 on below `end`.
std::vector<std::int32_t> read_rows(ArchiveReader& file, const std::string& name, Index count, Index end) {
  std::vector<std::int32_t> result;
  for (const double value : file.doubles(name, {count})) {
    require(value >= 0.0 && value < static_cast<double>(end) && value == std::floor(value), name,
            number_text(value), "whole numbers from 0 to " + std::to_string(end - 1) + " are needed");
    result.push_back(static_cast<std::int32_t>(value));
  }
  return result;
}

std::shared_ptr<NodeSight> read_sight(ArchiveReader& file, const JsonObject& object,
                                      const std::string& prefix, Index nodes) {
  const Index pairs = object.integer("pairs", 0, INT32_MAX - 1),
              places = object.integer("places", 0, most_rows);
  auto sight = std::make_shared<NodeSight>();
  sight->reach = object.number("reach");
  require_positive(object.name("reach"), sight->reach);
  sight->normals = file.points(prefix + "normals", nodes);
  sight->starts = read_rows(file, prefix + "starts", nodes + 1, pairs + 1);
  require(std::is_sorted(sight->starts.begin(), sight->starts.end()) && sight->starts.front() == 0 &&
              sight->starts.back() == pairs,
          prefix + "starts", "not in order", "they rise from 0 to the number of pairs");
  sight->others = read_rows(file, prefix + "others", pairs, nodes);
  const Vector excess = file.doubles(prefix + "excess", {pairs});
  require(pairs == 0 || excess.minCoeff() >= 0.0, prefix + "excess", "negative numbers",
          "none may be negative");
  sight->excess.assign(excess.begin(), excess.end());
  const Points known = file.points(prefix + "places", places);
  sight->set_places(known, read_rows(file, prefix + "sides", places, nodes));
  return sight;
}

InteriorEmbedding read_embedding(ArchiveReader& file, const JsonObject& object, const std::string& prefix) {
  // What nodes see of each other is looked at pair by pair; the library makes at most 2,250.
  constexpr Index most_sighted = 20'000;
  const Index nodes = object.integer("nodes", 1, object.has("sight") ? most_sighted : most_rows);
  InteriorEmbedding restored;
  restored.nodes = file.points(prefix + "nodes", nodes);
  restored.values = file.points(prefix + "values", nodes);
  const Vector slopes = file.doubles(prefix + "slopes", {nodes, 9});
  restored.slopes = Eigen::Map<const RowMatrix<double>>(slopes.data(), nodes, 9);
  restored.width = object.number("width");
  if (object.has("sight")) {
    restored.sight =
        read_sight(file, JsonObject(object.at("sight"), object.name("sight"), {"pairs", "places", "reach"}),
                   prefix + "sight.", nodes);
    restored.sight->set_nodes(restored.nodes, restored.width);
  }
  if (!object.has("parts")) return restored;
  constexpr std::size_t most_parts = 10'000;
  const Json& parts = object.at("parts");
  const std::string name = object.name("parts");
  require(parts.is_array() && parts.size() <= most_parts, name, "no list, or a long one", "a list is needed");
  for (std::size_t k = 0; k < parts.size(); ++k) {
    const std::string own = part_prefix(prefix, k);
    EmbeddingPart part;
    part.embedding = read_embedding(
        file, JsonObject(parts[k], name + "[" + std::to_string(k) + "]", {"nodes", "width", "sight"}), own);
    const Index n = part.embedding.nodes.rows();
    part.share = part.embedding;
    part.share.values.setZero();
    part.share.values.col(0) = file.doubles(own + "shares", {n});
    const Vector slopes_of_share = file.doubles(own + "share_slopes", {n, 3});
    part.share.slopes.setZero();
    part.share.slopes.leftCols(3) = Eigen::Map<const RowMatrix<double>>(slopes_of_share.data(), n, 3);
    const Vector ball = file.doubles(own + "ball", {4});
    part.ball = {ball.head<3>(), ball[3]};
    for (const double side : file.doubles(own + "sides", {n})) {
      require(side >= -1.0 && side < static_cast<double>(nodes) && side == std::floor(side), own + "sides",
              number_text(side), "whole numbers from -1 to " + std::to_string(nodes - 1) + " are needed");
      part.sides.push_back(static_cast<SurfaceSide>(side));
    }
    restored.parts.push_back(std::move(part));
  }
  return restored;
}

std::shared_ptr<RadialField> read_radial(ArchiveReader& file, const JsonObject& object,
                                         const std::string& prefix) {
  const Index count = object.integer("centers", 0, most_rows);
  RadialBasis basis;
  basis.centers = file.points(prefix + "centers", count);
  basis.radii = file.doubles(prefix + "radii", {count});
  if (object.has("embedding")) {
    InteriorEmbedding restored = read_embedding(
        file,
        JsonObject(object.at("embedding"), object.name("embedding"), {"nodes", "width", "sight", "parts"}),
        prefix + "embedding.");
    basis.set_embedding(std::make_shared<const InteriorEmbedding>(std::move(restored)));
  }
  std::shared_ptr<const Influence> influence;
  if (object.has("influence")) {
    const Index places = object.integer("influence", 1, most_rows);
    influence = std::make_shared<const Influence>(file.points(prefix + "influence.places", places),
                                                  file.doubles(prefix + "influence.reaches", {places}),
                                                  basis.embedding);
  }
  return std::make_shared<RadialField>(std::move(basis), file.points(prefix + "coefficients", count + 4),
                                       std::move(influence));
}

std::shared_ptr<DeformationField> read_composed(ArchiveReader& file, const Json& structure,
                                                const std::string& name, const std::string& prefix) {
  const Json& given = JsonObject(structure, name, {"type", "frame", "rest_points", "steps"}).at("steps");
  require(given.is_array() && given.size() <= most_steps, name + ".steps", "no list, or too long a one",
          "at most " + std::to_string(most_steps) + " steps are needed");
  std::vector<FieldStep> steps;
  for (std::size_t i = 0; i < given.size(); ++i) {
    const JsonObject step(given[i], step_prefix(name + ".", i) + "map",
                          {"repeats", "centers", "embedding", "influence"});
    const auto repeats = static_cast<int>(step.integer("repeats", 1, most_repeats));
    steps.push_back({read_radial(file, step, step_prefix(prefix, i)), repeats});
  }
  return std::make_shared<ComposedField>(std::move(steps));
}

std::shared_ptr<DeformationField> read_field(ArchiveReader& file, const Json& structure,
                                             const std::string& name, const std::string& prefix) {
  require(structure.is_object() && structure.contains("type") && structure["type"].is_string(), name,
          "'type' is missing", field_types);
  const std::string type = structure["type"].get<std::string>();
  const JsonObject object(structure, name,
                          {"type", "frame", "rest_points", "network", "handles", "base", "centers",
                           "embedding", "influence", "couplings", "steps"});
  std::shared_ptr<DeformationField> field;
  if (type == "neural")
    field = read_neural(file, structure, name, prefix);
  else if (type == "invertible")
    field = read_invertible(file, structure, name, prefix);
  else if (type == "composed")
    field = read_composed(file, structure, name, prefix);
  else if (type == "radial")
    field = read_radial(
        file,
        JsonObject(structure, name, {"type", "frame", "rest_points", "centers", "embedding", "influence"}),
        prefix);
  else
    throw InvalidInput(name + ".type", "'" + type + "'", field_types);
  field->set_frame(read_frame(object.at("frame"), object.name("frame")));
  field->set_rest_points(file.points(prefix + "rest_points", object.integer("rest_points", 0, most_rows)));
  return field;
}

}  // namespace

void save_field(const std::string& path, const DeformationField& field, const std::string& report) {
  const Json structure = structure_of(field);
  FieldArrays arrays;
  arrays.add(field, "");
  save_document(path, field_kind, structure, report, arrays.file);
}

std::shared_ptr<DeformationField> load_field(const std::string& path, std::string* report) {
  std::shared_ptr<DeformationField> field;
  load_document(path, field_kind, report, [&](ArchiveReader& file, int, const Json& structure) {
    field = read_field(file, structure, "structure", "");
  });
  return field;
}

}  // namespace arapfields
