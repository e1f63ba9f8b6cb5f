// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <cstddef>
#include <filesystem>
#include <string>

#include "core/export.h"

namespace arapfields {

/// A regular file that replaces its target in whole or not at all. It is written under its own name in a
/// temporary folder ".NAME.xxxxxxxx.tmp" beside the target (by write(), or by another library's exporter at
/// partial()), then flushed to the disk, verified and renamed. Symbolic links are followed. An existing
/// file's permissions are kept (on Windows they are the folder's). Names are UTF-8 on Windows, elsewhere
/// bytes. The next output of the same name removes what a killed process left; a lock on the folder shows
/// that its process runs.
class ARAPFIELDS_EXPORT OutputFile {
 public:
  /// Throws InvalidInput for an invalid name and for a path that is not a regular file (a pipe, a device),
  /// FileError where the system refuses.
  explicit OutputFile(const std::string& path);
  /// Removes what has not been committed.
  ~OutputFile();
  OutputFile(const OutputFile&) = delete;
  OutputFile& operator=(const OutputFile&) = delete;

  const std::string& path() const { return path_; }
  /// The path to write to: a file of the same name in the temporary folder.
  const std::string& partial() const { return partial_; }
  /// The same beside the temporary folder, for content that holds paths relative to its own folder. Where
  /// this file exists, it is the one that is committed.
  std::string beside() const;

  /// Appends to partial(). Throws FileError that names path().
  void write(const void* data, std::size_t bytes);
  /// Flushes the content to the disk and verifies it. Throws FileError, and InvalidInput where the file is
  /// missing, shorter than what was written, or not regular.
  void finish();
  /// finish(), if that has not been done, and renames.
  void commit();
  /// Removes the temporary folder; without a commit() before, nothing has changed.
  void discard() noexcept;

 private:
  void open_folder(const std::filesystem::path& target);
  void close_written() noexcept;

  std::string path_;     ///< as it was given
  std::string target_;   ///< behind all symbolic links
  std::string folder_;   ///< temporary
  std::string partial_;  ///< in it
  int lock_ = -1, file_ = -1;
  std::size_t written_ = 0;
  bool finished_ = false;
};

}  // namespace arapfields
