// SPDX-License-Identifier: GPL-3.0-or-later
#ifndef _WIN32
#include <sys/stat.h>
#endif

#include <array>
#include <boost/test/unit_test.hpp>
#include <cerrno>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <random>
#include <string>

#include "core/errors.h"
#include "fields/neural_field.h"
#include "fields/radial_field.h"
#include "io/files.h"
#include "io/input_file.h"
#include "io/output_file.h"
#include "io/system_file.h"

using namespace arapfields;

namespace {

/// A folder of its own for each test; names are UTF-8.
struct Folder {
  Folder() : path(std::filesystem::temp_directory_path()) {
    std::random_device device;
    path /= "arapfields-" + std::to_string(device()) + "-" + std::to_string(device());
    std::filesystem::create_directory(path);
  }
  ~Folder() { std::filesystem::remove_all(path); }
  Folder(const Folder&) = delete;
  Folder& operator=(const Folder&) = delete;
  std::string operator/(const char* name) const {
    return arapfields::text_of(path / arapfields::path_of(name));
  }
  std::size_t size() const {
    return static_cast<std::size_t>(
        std::distance(std::filesystem::directory_iterator(path), std::filesystem::directory_iterator()));
  }
  std::filesystem::path path;
};

/// What a call is refused with.
template <class Call>
std::string refusal(Call&& call) {
  try {
    call();
  } catch (const arapfields::InvalidInput& error) {
    return error.what();
  }
  return "nothing was thrown";
}

namespace fs = std::filesystem;

constexpr const char* strange = "K\xc3\xa4se \xe2\x82\xac \xf0\x9f\xa7\x80";  // Käse € 🧀, in UTF-8

void put(const std::string& path, const std::string& text) { std::ofstream(path_of(path)) << text; }

std::string content(const std::string& path) {
  const InputFile file(path);
  std::string text(file.size(), ' ');
  file.read(0, text.data(), text.size());
  return text;
}

int error_number(const auto& call) {
  try {
    call();
  } catch (const FileError& error) {
    return error.number();
  }
  return 0;
}

void save(const std::string& path, const std::string& text) {
  OutputFile file(path);
  file.write(text.data(), text.size());
  file.commit();
}

}  // namespace

BOOST_AUTO_TEST_SUITE(files)

BOOST_AUTO_TEST_CASE(a_file_cut_while_it_is_read_is_refused) {
  const Folder folder;
  put(folder / "growing", "four");
  const InputFile file(folder / "growing");
  fs::resize_file(folder.path / "growing", 2);
  std::array<char, 4> content{};
  file.read(0, content.data(), 2);
  BOOST_TEST(refusal([&] { file.read(0, content.data(), file.size()); }).find("shorter") !=
             std::string::npos);
}

BOOST_AUTO_TEST_CASE(an_output_that_is_given_up_changes_nothing) {
  const Folder folder;
  put(folder / "x", "old");
  {
    OutputFile file(folder / "x");
    file.write("new", 3);
  }
  BOOST_TEST(content(folder / "x") == "old");
  save(folder / "x", "new");
  BOOST_TEST(content(folder / "x") == "new");
  BOOST_TEST(folder.size() == 1u);
}

BOOST_AUTO_TEST_CASE(names_are_utf8) {
  const Folder folder;
  fs::create_directory(folder.path / path_of(strange));
  const std::string path = folder / strange + "/" + strange + ".npz";
  save(path, "text");
  BOOST_TEST(content(path) == "text");
  BOOST_TEST(fs::exists(folder.path / path_of(strange) / path_of(strange).concat(".npz")));
  std::string longest;  // its temporary folder's name is cut between two letters
  while (longest.size() < 210) longest += "\xe2\x82\xac";
  save(folder / longest.c_str(), "long");
  BOOST_TEST(content(folder / longest.c_str()) == "long");
}

// Longer paths than Windows takes as they are: of a file, of its temporary folder, of its own folder.
BOOST_AUTO_TEST_CASE(paths_are_of_any_length) {
  const Folder folder;
  const std::string part(100, 'y');
  std::string path = text_of(folder.path);
  for (int depth = 0; depth < 4; ++depth) {
    for (const std::size_t length : {1, 60, 200}) {
      const std::string name = path + "/" + std::string(length, 'x');
      save(name, "old");
      save(name, "new");
      BOOST_TEST(content(name) == "new");
      {
        const OutputFile given_up(name);
      }
    }
    BOOST_TEST(system_file::entries(system_file::reachable(path_of(path))).size() == 3u);
    path += "/" + part;
    BOOST_TEST(system_file::make_folder(system_file::reachable(path_of(path), part.size())));
  }
  system_file::remove_tree(system_file::reachable(folder.path / part));
}

BOOST_AUTO_TEST_CASE(what_a_killed_process_left_is_swept_and_what_a_live_one_uses_is_not) {
  const Folder folder;
  fs::create_directory(folder.path / ".x.abcdefgh.tmp");
  put(folder / ".x.abcdefgh.tmp/x", "left");
  OutputFile first(folder / "x");
  BOOST_TEST(!fs::exists(folder.path / ".x.abcdefgh.tmp"));
  first.write("first", 5);
  save(folder / "x", "second");
  first.commit();
  BOOST_TEST(content(folder / "x") == "first");
  BOOST_TEST(folder.size() == 1u);
}

BOOST_AUTO_TEST_CASE(what_is_no_file_is_refused) {
  const Folder folder;
  BOOST_TEST(error_number([&] { InputFile file(text_of(folder.path)); }) == EISDIR);
  BOOST_TEST(error_number([&] { OutputFile file(text_of(folder.path)); }) == EISDIR);
  BOOST_TEST(error_number([&] { InputFile file(folder / "absent"); }) == ENOENT);
  BOOST_TEST(error_number([&] { OutputFile file(folder / "absent/x"); }) == ENOENT);
#ifdef _WIN32
  const std::string no_text = text_of(folder.path) + "/no-\xff-utf8";
  BOOST_TEST(error_number([&] { InputFile file(no_text); }) == EILSEQ);
  BOOST_TEST(error_number([&] { OutputFile file(no_text); }) == EILSEQ);
#else
  mkfifo((folder / "pipe").c_str(), 0600);
  BOOST_TEST(refusal([&] { InputFile file(folder / "pipe"); }).find("regular") != std::string::npos);
  BOOST_TEST(refusal([&] { OutputFile file(folder / "pipe"); }).find("regular") != std::string::npos);
#endif
}

BOOST_AUTO_TEST_SUITE(saved_fields)

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

BOOST_AUTO_TEST_SUITE_END()
