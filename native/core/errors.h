// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <stdexcept>
#include <string>
#include <string_view>
#include <system_error>

#include "core/export.h"

namespace arapfields {

/// An argument that cannot be used. The text names the argument, what was found and what is allowed.
/// Python sees arapfields.InvalidInput, a ValueError.
class ARAPFIELDS_EXPORT InvalidInput : public std::invalid_argument {
 public:
  explicit InvalidInput(const std::string& what) : std::invalid_argument(what) {}
  InvalidInput(std::string_view argument, std::string_view found, std::string_view allowed);
};

/// The caller's Task was cancelled. Python sees arapfields.Cancelled.
class ARAPFIELDS_EXPORT Cancelled : public std::runtime_error {
 public:
  Cancelled() : std::runtime_error("cancelled") {}
};

/// An optimization met NaN or infinity and could not go on. Python sees arapfields.Diverged.
class ARAPFIELDS_EXPORT Diverged : public std::runtime_error {
 public:
  using std::runtime_error::runtime_error;
};

/// Throws InvalidInput(argument, found, allowed) unless `holds`.
inline void require(bool holds, std::string_view argument, std::string_view found, std::string_view allowed) {
  if (!holds) throw InvalidInput(argument, found, allowed);
}

/// A number as these texts show it: six digits.
ARAPFIELDS_EXPORT std::string number_text(double value);
/// Throws InvalidInput unless the value is finite and within [low, high].
ARAPFIELDS_EXPORT void require_range(std::string_view argument, double value, double low, double high);
/// Throws InvalidInput unless the value is finite and above 0.
ARAPFIELDS_EXPORT void require_positive(std::string_view argument, double value);
/// Throws InvalidInput unless the value is finite and 0 or more.
ARAPFIELDS_EXPORT void require_not_negative(std::string_view argument, double value);

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
