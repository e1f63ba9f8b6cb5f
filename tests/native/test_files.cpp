// SPDX-License-Identifier: GPL-3.0-or-later
#ifndef _WIN32
#include <sys/stat.h>
#endif

#include <array>
#include <boost/test/unit_test.hpp>
#include <cerrno>
#include <filesystem>
#include <fstream>

#include "core/errors.h"
#include "core/file_error.h"
#include "io/input_file.h"
#include "io/output_file.h"
#include "io/system_file.h"
#include "temporary_folder.h"

using namespace arapfields;

namespace {

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

BOOST_AUTO_TEST_SUITE_END()
