// SPDX-License-Identifier: GPL-3.0-or-later
#include <boost/test/unit_test.hpp>
#include <fstream>

#include "core/errors.h"
#include "core/file_error.h"
#include "fields/neural_field.h"
#include "fields/radial_field.h"
#include "io/files.h"
#include "temporary_folder.h"

using namespace arapfields;

namespace {

RadialField radial_field() {
  RadialBasis basis;
  basis.centers = Points::Random(5, 3);
  basis.radii = Vector::Constant(5, 2.0);
  InteriorEmbedding embedding;
  embedding.nodes = Points::Random(4, 3);
  embedding.values = Points::Random(4, 3);
  embedding.slopes = RowMatrix<double>::Random(4, 9);
  embedding.width = 0.5;
  basis.set_embedding(std::make_shared<const InteriorEmbedding>(embedding));
  RadialField field(basis, RowMatrix<double>::Random(9, 3));
  field.set_frame({Vec3(1.0, 2.0, 0.1), 1.0 / 3.0});
  field.set_rest_points(Points::Random(3, 3));
  return field;
}

MlpShape tiny(int outputs) {
  MlpShape shape;
  shape.outputs = outputs, shape.width = 8, shape.layers = 2, shape.octaves = 2;
  return shape;
}

std::shared_ptr<NeuralField> neural_field() {
  auto field = std::make_shared<NeuralField>(tiny(3), 0);
  RigidRegion region;
  region.placement.topRightCorner<3, 1>() = Vec3(3.0, 0.0, 0.0);
  field->set_handles(std::make_shared<HandleBlend>(std::vector<RigidRegion>{region}));
  field->set_base(std::make_shared<RadialField>(radial_field()));
  return field;
}

}  // namespace

BOOST_AUTO_TEST_SUITE(io)

BOOST_AUTO_TEST_CASE(fields_come_back_bit_for_bit) {
  const Folder folder;
  const Points points = Points::Random(7, 3);
  const auto neural = neural_field();
  const RadialField radial = radial_field();
  for (const DeformationField* field :
       {static_cast<const DeformationField*>(neural.get()), static_cast<const DeformationField*>(&radial)}) {
    std::string report;
    save_field(folder / "field", *field, R"({"stretch": 0.25})");
    const auto again = load_field(folder / "field", &report);
    BOOST_TEST((again->at(points) == field->at(points)));
    BOOST_TEST((again->frame() == field->frame()));
    BOOST_TEST((again->rest_points() == field->rest_points()));
    BOOST_TEST(report == R"({"stretch": 0.25})");
  }
  BOOST_TEST(folder.size() == 1u);
}

BOOST_AUTO_TEST_CASE(signed_distances_come_back_bit_for_bit) {
  const Folder folder;
  const PointsF points = PointsF::Random(7, 3);
  NeuralSdf sdf(Mlp(tiny(1), 3, false), Frame{Vec3(0.1, 0.2, 0.3), 0.7});
  save_sdf(folder / "sdf", sdf);
  const auto again = load_sdf(folder / "sdf");
  VectorF before(7), after(7);
  sdf.evaluate(points, before);
  again->evaluate(points, after);
  BOOST_TEST((before == after));
  BOOST_TEST((again->frame() == sdf.frame()));
  BOOST_TEST(
      refusal([&] { load_field(folder / "sdf"); }).starts_with((folder / "sdf") + ": cannot be loaded"));
}

BOOST_AUTO_TEST_CASE(what_cannot_be_read_or_written_is_named) {
  const Folder folder;
  BOOST_CHECK_THROW(load_field(folder / "absent"), FileError);
  BOOST_CHECK_THROW(save_field(folder / "absent/field", radial_field()), FileError);
  BOOST_TEST(refusal([&] { save_field(folder / "field", radial_field(), "[]"); }).starts_with("report"));
  BOOST_TEST(refusal([&] { save_field(folder / "field", HandleBlend({})); }).starts_with("field"));
  std::ofstream(folder / "short") << "{}";
  BOOST_TEST(refusal([&] { load_sdf(folder / "short"); }).starts_with((folder / "short") + ": "));
  BOOST_TEST(folder.size() == 1u);
}

BOOST_AUTO_TEST_CASE(embeddings_that_do_not_fit_together_are_refused) {
  RadialBasis basis;
  basis.centers = Points::Random(5, 3);
  const InteriorEmbedding good = *radial_field().basis().embedding;
  const auto refused = [&](auto&& change) {
    InteriorEmbedding bad = good;
    change(bad);
    BOOST_CHECK_THROW(basis.set_embedding(std::make_shared<const InteriorEmbedding>(bad)), InvalidInput);
  };
  refused([](InteriorEmbedding& e) { e.values.conservativeResize(3, 3); });
  refused([](InteriorEmbedding& e) { e.nodes.conservativeResize(3, 3); });
  refused([](InteriorEmbedding& e) { e.slopes.conservativeResize(4, 8); });
  refused([](InteriorEmbedding& e) { e.slopes(0, 0) = std::nan(""); });
  refused([](InteriorEmbedding& e) { e.width = 0.0; });
  refused([](InteriorEmbedding& e) { e = InteriorEmbedding(); });
}

BOOST_AUTO_TEST_SUITE_END()
