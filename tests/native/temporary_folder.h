// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <filesystem>
#include <iterator>
#include <random>
#include <string>

#include "core/errors.h"
#include "io/path_text.h"

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
