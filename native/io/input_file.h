// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <cstddef>
#include <string>

#include "core/export.h"

namespace arapfields {

/// A regular file opened for reading; its size is known before anything is allocated for its content.
class ARAPFIELDS_EXPORT_TO_TESTS InputFile {
 public:
  /// Throws FileError where the system refuses, InvalidInput for what is not a regular file.
  explicit InputFile(const std::string& path);
  ~InputFile();
  InputFile(const InputFile&) = delete;
  InputFile& operator=(const InputFile&) = delete;

  std::size_t size() const { return size_; }
  /// Copies `bytes` from `offset` on. Throws InvalidInput where the file has become shorter.
  void read(std::size_t offset, void* to, std::size_t bytes) const;

 private:
  std::string path_;
  int file_;
  std::size_t size_ = 0;
};

}  // namespace arapfields
