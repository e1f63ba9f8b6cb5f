// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <cstddef>
#include <filesystem>
#include <string>

#include "core/export.h"

namespace arapfields {

/// A regular file that takes its place whole or not at all. It is written under its own name in a temporary
/// folder ".NAME.xxxxxxxx.tmp" beside its place (by write(), or by another library's exporter at partial()),
/// then brought to the disk, looked at, and renamed. Symbolic links are followed: what they point to is
/// replaced. Permissions of a file that was there stay (on Windows they are the folder's). Names are UTF-8 on
/// Windows, elsewhere the system's bytes. What a killed process left is removed by the next
/// output of the same name: a lock on the folder tells whether its maker still lives.
class ARAPFIELDS_EXPORT OutputFile {
 public:
  /// Throws InvalidInput for a place that holds something else than a regular file (a folder, a pipe, a
  /// device) and for a name that is none, FileError where the system refuses.
  explicit OutputFile(const std::string& path);
  /// Removes what has not been committed.
  ~OutputFile();
  OutputFile(const OutputFile&) = delete;
  OutputFile& operator=(const OutputFile&) = delete;

  const std::string& path() const { return path_; }
  /// Where the content is to be written: a file of the same name in the temporary folder.
  const std::string& partial() const { return partial_; }
  /// The same beside the temporary folder, for content that holds paths relative to its own folder. Where
  /// this file exists, it is the one that is committed.
  std::string beside() const;

  /// Appends to partial(). Throws FileError that names path().
  void write(const void* data, std::size_t bytes);
  /// Brings the content to the disk and looks at it. Throws FileError, and InvalidInput where nothing, less
  /// than was written, or no regular file arrived.
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
