// SPDX-License-Identifier: GPL-3.0-or-later
#include <fcntl.h>
#include <sys/file.h>
#include <sys/stat.h>
#include <unistd.h>

#include <cerrno>
#include <cstdio>

#include "io/system_file.h"

namespace arapfields::system_file {

namespace fs = std::filesystem;

Kind kind(const fs::path& path) {
  std::error_code none;
  const fs::file_status there = fs::status(path, none);
  if (!fs::exists(there)) return Kind::none;
  if (fs::is_directory(there)) return Kind::folder;
  return fs::is_regular_file(there) ? Kind::file : Kind::other;
}

std::vector<fs::path> entries(const fs::path& folder) {
  std::vector<fs::path> found;
  std::error_code ignored;
  for (fs::directory_iterator entry(folder, ignored), end; !ignored && entry != end; entry.increment(ignored))
    found.push_back(entry->path());
  return found;
}

void remove_tree(const fs::path& path) {
  std::error_code ignored;
  fs::remove_all(path, ignored);
}

fs::path reachable(const fs::path& path, std::size_t) { return path; }

int open_to_read(const fs::path& path) {
  const int file = open(path.c_str(), O_RDONLY | O_CLOEXEC | O_NONBLOCK);
  struct stat status{};
  if (file < 0) return -1;
  const int problem = fstat(file, &status) != 0 ? errno : S_ISDIR(status.st_mode) ? EISDIR : 0;
  if (problem == 0) return file;
  close(file);
  errno = problem;
  return -1;
}

int create(const fs::path& path) { return open(path.c_str(), O_WRONLY | O_CREAT | O_EXCL | O_CLOEXEC, 0666); }

int open_written(const fs::path& path) { return open(path.c_str(), O_RDONLY | O_NOFOLLOW | O_CLOEXEC); }

void close_file(int file) noexcept { close(file); }

bool is_regular(int file) {
  struct stat status{};
  return fstat(file, &status) == 0 && S_ISREG(status.st_mode);
}

std::uint64_t size(int file) {
  struct stat status{};
  return fstat(file, &status) == 0 ? static_cast<std::uint64_t>(status.st_size) : 0;
}

std::ptrdiff_t read_at(int file, void* to, std::size_t bytes, std::uint64_t offset) {
  ssize_t count = -1;
  do count = pread(file, to, bytes, static_cast<off_t>(offset));
  while (count < 0 && errno == EINTR);
  return count;
}

std::ptrdiff_t append(int file, const void* from, std::size_t bytes) {
  ssize_t count = -1;
  do count = write(file, from, bytes);
  while (count < 0 && errno == EINTR);
  return count;
}

bool to_disk(int file) { return fsync(file) == 0; }

bool take_permissions(int file, const fs::path& path) {
  struct stat own{}, previous{};
  if (fstat(file, &own) != 0) return false;
  if (stat(path.c_str(), &previous) != 0) return true;
  const bool done = fchmod(file, previous.st_mode & 07777) == 0;
  const int problem = errno;
  if (previous.st_uid != own.st_uid || previous.st_gid != own.st_gid)
    if (fchown(file, previous.st_uid, previous.st_gid) != 0)
      errno = 0;  // a file of another user becomes our own
  if (!done) errno = problem;
  return done;
}

bool may_write(const fs::path& path) { return access(path.c_str(), W_OK) == 0; }

bool replace(const fs::path& from, const fs::path& to) { return rename(from.c_str(), to.c_str()) == 0; }

bool make_folder(const fs::path& folder) { return mkdir(folder.c_str(), 0700) == 0; }

int lock_folder(const fs::path& folder) {
  const int descriptor = open(folder.c_str(), O_RDONLY | O_DIRECTORY | O_NOFOLLOW | O_CLOEXEC);
  if (descriptor < 0) return -1;
  struct stat status{};
  const bool locked = flock(descriptor, LOCK_EX | LOCK_NB) == 0;
  const int problem = locked ? EWOULDBLOCK : errno;
  if (locked && fstat(descriptor, &status) == 0 && status.st_nlink > 0 && status.st_uid == geteuid())
    return descriptor;
  close(descriptor);
  errno = problem;
  return -1;
}

int hold_folder(const fs::path& folder) { return open(folder.c_str(), O_RDONLY | O_DIRECTORY | O_CLOEXEC); }

void folder_to_disk(const fs::path& folder) {
  const int descriptor = hold_folder(folder);
  if (descriptor < 0) return;
  fsync(descriptor);  // not all file systems can; the file itself is on the disk
  close(descriptor);
}

}  // namespace arapfields::system_file
