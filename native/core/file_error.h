// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <stdexcept>
#include <string>
#include <system_error>

#include "core/export.h"

namespace arapfields {

/// A file or folder that the system does not let us read or write. Python sees OSError, or the subclass that
/// belongs to the error number, with the name of the file.
class ARAPFIELDS_EXPORT FileError : public std::runtime_error {
 public:
  FileError(const std::string& path, int number)
      : std::runtime_error(path + ": " + std::generic_category().message(number)),
        path_(path),
        number_(number) {}
  const std::string& path() const { return path_; }
  int number() const { return number_; }  ///< errno's

 private:
  std::string path_;
  int number_;
};

}  // namespace arapfields
