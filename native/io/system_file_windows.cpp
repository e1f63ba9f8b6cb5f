// SPDX-License-Identifier: GPL-3.0-or-later
// clang-format off
#include <windows.h>
#include <fcntl.h>
#include <io.h>
#include <share.h>
#include <sys/stat.h>
#include <sys/types.h>
// clang-format on

#include <algorithm>
#include <cerrno>
#include <string>

#include "io/system_file.h"

namespace arapfields::system_file {
namespace {

namespace fs = std::filesystem;

constexpr int access_mode = _S_IREAD | _S_IWRITE;
constexpr std::size_t most_at_once = 1 << 30;  ///< one call takes an int
constexpr int patience = 20;                   ///< tries: a virus scanner holds new files for some moments
constexpr DWORD pause = 25;                    ///< milliseconds between them

int errno_of(DWORD code) {
  switch (code) {
    case ERROR_FILE_NOT_FOUND:
    case ERROR_PATH_NOT_FOUND:
    case ERROR_INVALID_NAME:
      return ENOENT;
    case ERROR_ACCESS_DENIED:
    case ERROR_SHARING_VIOLATION:
    case ERROR_LOCK_VIOLATION:
    case ERROR_WRITE_PROTECT:
      return EACCES;
    case ERROR_DISK_FULL:
    case ERROR_HANDLE_DISK_FULL:
      return ENOSPC;
    default:
      return EIO;
  }
}

int open_shared(const fs::path& path, int flags, int sharing) {
  int file = -1;
  const errno_t problem =
      _wsopen_s(&file, path.c_str(), flags | _O_BINARY | _O_NOINHERIT, sharing, access_mode);
  if (problem == 0) return file;
  errno = problem;
  return -1;
}

/// The name under which a folder is locked: of a file beside it that vanishes with the lock.
fs::path lock_name(const fs::path& folder) { return fs::path(folder).concat(L".lock"); }

}  // namespace

// Of the standard library's own, GCC's take no long paths, and its remove_all() never ends at what it cannot
// reach.
Kind kind(const fs::path& path) {
  const DWORD attributes = GetFileAttributesW(path.c_str());
  if (attributes == INVALID_FILE_ATTRIBUTES) return Kind::none;
  if ((attributes & FILE_ATTRIBUTE_DIRECTORY) != 0) return Kind::folder;
  constexpr DWORD shared = FILE_SHARE_READ | FILE_SHARE_WRITE | FILE_SHARE_DELETE;
  const HANDLE file = CreateFileW(path.c_str(), 0, shared, nullptr, OPEN_EXISTING, 0, nullptr);
  if (file == INVALID_HANDLE_VALUE) return Kind::file;
  const bool regular = GetFileType(file) == FILE_TYPE_DISK;
  CloseHandle(file);
  return regular ? Kind::file : Kind::other;
}

std::vector<fs::path> entries(const fs::path& folder) {
  std::vector<fs::path> found;
  WIN32_FIND_DATAW entry;
  const HANDLE search = FindFirstFileW((folder / L"*").c_str(), &entry);
  if (search == INVALID_HANDLE_VALUE) return found;
  do {
    const std::wstring name = entry.cFileName;
    if (name != L"." && name != L"..") found.push_back(folder / name);
  } while (FindNextFileW(search, &entry) != 0);
  FindClose(search);
  return found;
}

void remove_tree(const fs::path& path) {
  const DWORD attributes = GetFileAttributesW(path.c_str());
  if (attributes == INVALID_FILE_ATTRIBUTES) return;
  if ((attributes & FILE_ATTRIBUTE_DIRECTORY) == 0) {
    DeleteFileW(path.c_str());
    return;
  }
  if ((attributes & FILE_ATTRIBUTE_REPARSE_POINT) == 0)  // what a link leads to stays
    for (const fs::path& entry : entries(path)) remove_tree(entry);
  RemoveDirectoryW(path.c_str());
}

fs::path reachable(const fs::path& path, std::size_t longer) {
  const DWORD length = GetFullPathNameW(path.c_str(), 0, nullptr, nullptr);
  if (length == 0 || length + longer < MAX_PATH) return path;
  std::wstring whole(length, L'\0');
  whole.resize(GetFullPathNameW(path.c_str(), length, whole.data(), nullptr));
  if (whole.starts_with(LR"(\\?\)")) return whole;
  return whole.starts_with(LR"(\\)") ? LR"(\\?\UNC)" + whole.substr(1) : LR"(\\?\)" + whole;
}

int open_to_read(const fs::path& given) {
  const fs::path path = reachable(given);
  const int file = open_shared(path, _O_RDONLY, _SH_DENYNO);
  if (file < 0 && errno == EACCES && kind(path) == Kind::folder) errno = EISDIR;
  return file;
}

int create(const fs::path& path) { return open_shared(path, _O_WRONLY | _O_CREAT | _O_EXCL, _SH_DENYNO); }

int open_written(const fs::path& path) {
  if (kind(path) != Kind::file) {
    errno = ENOENT;
    return -1;
  }
  return open_shared(path, _O_RDWR, _SH_DENYNO);  // who may not write may not bring it to the disk either
}

void close_file(int file) noexcept { _close(file); }

bool is_regular(int file) {
  const auto handle = reinterpret_cast<HANDLE>(_get_osfhandle(file));
  return GetFileType(handle) == FILE_TYPE_DISK;
}

std::uint64_t size(int file) {
  const __int64 length = _filelengthi64(file);
  return length > 0 ? static_cast<std::uint64_t>(length) : 0;
}

std::ptrdiff_t read_at(int file, void* to, std::size_t bytes, std::uint64_t offset) {
  OVERLAPPED where{};
  where.Offset = static_cast<DWORD>(offset & 0xffffffffu);
  where.OffsetHigh = static_cast<DWORD>(offset >> 32);
  DWORD count = 0;
  const auto handle = reinterpret_cast<HANDLE>(_get_osfhandle(file));
  if (ReadFile(handle, to, static_cast<DWORD>(std::min(bytes, most_at_once)), &count, &where) != 0)
    return static_cast<std::ptrdiff_t>(count);
  if (GetLastError() == ERROR_HANDLE_EOF) return 0;
  errno = errno_of(GetLastError());
  return -1;
}

std::ptrdiff_t append(int file, const void* from, std::size_t bytes) {
  return _write(file, from, static_cast<unsigned>(std::min(bytes, most_at_once)));
}

bool to_disk(int file) { return _commit(file) == 0; }

bool take_permissions(int, const fs::path&) { return true; }  // they are the folder's

bool may_write(const fs::path& path) { return _waccess(path.c_str(), 2) == 0; }

bool replace(const fs::path& from, const fs::path& to) {
  for (int tries = 0;; ++tries) {
    if (MoveFileExW(from.c_str(), to.c_str(), MOVEFILE_REPLACE_EXISTING | MOVEFILE_WRITE_THROUGH) != 0)
      return true;
    errno = errno_of(GetLastError());
    if (errno != EACCES || tries == patience) return false;
    Sleep(pause);
  }
}

bool make_folder(const fs::path& folder) {
  if (CreateDirectoryW(folder.c_str(), nullptr) != 0) return true;
  errno = GetLastError() == ERROR_ALREADY_EXISTS ? EEXIST : errno_of(GetLastError());
  return false;
}

int lock_folder(const fs::path& folder) {
  const int lock = open_shared(lock_name(folder), _O_RDWR | _O_CREAT | _O_TEMPORARY, _SH_DENYRW);
  if (lock < 0) {
    if (errno == EACCES) errno = EWOULDBLOCK;
    return -1;
  }
  if (kind(folder) == Kind::folder) return lock;
  _close(lock);
  errno = EWOULDBLOCK;
  return -1;
}

int hold_folder(const fs::path&) {  // there is no Windows without locks
  errno = ENOTSUP;
  return -1;
}

void folder_to_disk(const fs::path&) {}  // replace() has waited for it

}  // namespace arapfields::system_file
