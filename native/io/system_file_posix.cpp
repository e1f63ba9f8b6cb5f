// SPDX-License-Identifier: GPL-3.0-or-later
#include <fcntl.h>
#include <sys/file.h>
#include <sys/stat.h>
#include <unistd.h>

#include <cerrno>
#include <cstdio>

#include "io/system_file.h"

namespace arapfields::system_file {

int open_to_read(const std::filesystem::path& path) {
  const int file = open(path.c_str(), O_RDONLY | O_CLOEXEC | O_NONBLOCK);
  struct stat found{};
  if (file < 0) return -1;
  const int problem = fstat(file, &found) != 0 ? errno : S_ISDIR(found.st_mode) ? EISDIR : 0;
  if (problem == 0) return file;
  close(file);
  errno = problem;
  return -1;
}

int create(const std::filesystem::path& path) {
  return open(path.c_str(), O_WRONLY | O_CREAT | O_EXCL | O_CLOEXEC, 0666);
}

int open_written(const std::filesystem::path& path) {
  return open(path.c_str(), O_RDONLY | O_NOFOLLOW | O_CLOEXEC);
}

void close_file(int file) noexcept { close(file); }

bool is_regular(int file) {
  struct stat found{};
  return fstat(file, &found) == 0 && S_ISREG(found.st_mode);
}

std::uint64_t size(int file) {
  struct stat found{};
  return fstat(file, &found) == 0 ? static_cast<std::uint64_t>(found.st_size) : 0;
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

bool take_permissions(int file, const std::filesystem::path& path) {
  struct stat ours{}, there{};
  if (fstat(file, &ours) != 0) return false;
  if (stat(path.c_str(), &there) != 0) return true;
  const bool done = fchmod(file, there.st_mode & 07777) == 0;
  const int problem = errno;
  if (there.st_uid != ours.st_uid || there.st_gid != ours.st_gid)
    if (fchown(file, there.st_uid, there.st_gid) != 0) errno = 0;  // another's file becomes ours
  if (!done) errno = problem;
  return done;
}

bool may_write(const std::filesystem::path& path) { return access(path.c_str(), W_OK) == 0; }

bool replace(const std::filesystem::path& from, const std::filesystem::path& to) {
  return rename(from.c_str(), to.c_str()) == 0;
}

bool make_folder(const std::filesystem::path& folder) { return mkdir(folder.c_str(), 0700) == 0; }

int lock_folder(const std::filesystem::path& folder) {
  const int descriptor = open(folder.c_str(), O_RDONLY | O_DIRECTORY | O_NOFOLLOW | O_CLOEXEC);
  if (descriptor < 0) return -1;
  struct stat found{};
  const bool locked = flock(descriptor, LOCK_EX | LOCK_NB) == 0;
  const int problem = locked ? EWOULDBLOCK : errno;
  if (locked && fstat(descriptor, &found) == 0 && found.st_nlink > 0 && found.st_uid == geteuid())
    return descriptor;
  close(descriptor);
  errno = problem;
  return -1;
}

int hold_folder(const std::filesystem::path& folder) {
  return open(folder.c_str(), O_RDONLY | O_DIRECTORY | O_CLOEXEC);
}

void folder_to_disk(const std::filesystem::path& folder) {
  const int descriptor = hold_folder(folder);
  if (descriptor < 0) return;
  fsync(descriptor);  // not all file systems can; the file itself is on the disk
  close(descriptor);
}

}  // namespace arapfields::system_file
