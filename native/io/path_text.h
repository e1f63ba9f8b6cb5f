// SPDX-License-Identifier: GPL-3.0-or-later
// Names of files are UTF-8 in all interfaces; on POSIX systems they are whatever bytes the system has.
#pragma once

#include <filesystem>
#include <string>

namespace arapfields {

/// Throws std::system_error on Windows for what is no UTF-8.
inline std::filesystem::path path_of(const std::string& text) {
#ifdef _WIN32
  return std::u8string(text.begin(), text.end());
#else
  return text;
#endif
}

inline std::string text_of(const std::filesystem::path& path) {
#ifdef _WIN32
  const std::u8string text = path.u8string();
  return {text.begin(), text.end()};
#else
  return path.string();
#endif
}

}  // namespace arapfields
