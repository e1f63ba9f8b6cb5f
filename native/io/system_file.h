// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <string>
#include <vector>

namespace arapfields {

// Names of files are UTF-8 in all interfaces; on POSIX systems they are whatever bytes the system has.

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

// File operations that differ between POSIX systems and Windows. Descriptors are the C library's. Where the
// system refuses, they return −1 or false, and errno is set.

namespace arapfields::system_file {

enum class Kind { none, file, folder, other };
/// Of what is there, behind links.
Kind kind(const std::filesystem::path& path);
std::vector<std::filesystem::path> entries(const std::filesystem::path& folder);
/// Removes a file, or a folder with all in it, as far as the system lets it.
void remove_tree(const std::filesystem::path& path);
/// The path in the form that Windows takes beyond its 260 letters, where it, or one `longer` than it, has
/// them.
std::filesystem::path reachable(const std::filesystem::path& path, std::size_t longer = 0);

/// For reading; never waits for the other end of a pipe. A folder is refused by EISDIR.
int open_to_read(const std::filesystem::path& path);
/// A new file; fails where one exists.
int create(const std::filesystem::path& path);
/// A file just written, to verify and flush; follows no link.
int open_written(const std::filesystem::path& path);
void close_file(int file) noexcept;

bool is_regular(int file);
std::uint64_t size(int file);
/// Bytes that came; 0 at the end of the file.
std::ptrdiff_t read_at(int file, void* to, std::size_t bytes, std::uint64_t offset);
std::ptrdiff_t append(int file, const void* from, std::size_t bytes);
bool to_disk(int file);
/// Gives the file the permissions and, where we may, the owner of the one at `path`, if there is one.
bool take_permissions(int file, const std::filesystem::path& path);

bool may_write(const std::filesystem::path& path);
/// In one step, in place of what may be there.
bool replace(const std::filesystem::path& from, const std::filesystem::path& to);
/// Private to the user where the system supports it; EEXIST where the name is taken.
bool make_folder(const std::filesystem::path& folder);
/// A lock on a folder that ends with the process: to be closed. EWOULDBLOCK where another holds it, or the
/// folder is gone or someone else's.
int lock_folder(const std::filesystem::path& folder);
/// The same descriptor without the lock, where the file system has no locks.
int hold_folder(const std::filesystem::path& folder);
/// The folder's entries, as far as its file system can.
void folder_to_disk(const std::filesystem::path& folder);

}  // namespace arapfields::system_file
