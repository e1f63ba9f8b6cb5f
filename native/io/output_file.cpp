// SPDX-License-Identifier: GPL-3.0-or-later
#include "io/output_file.h"

#include <fcntl.h>
#include <sys/file.h>
#include <sys/stat.h>
#include <unistd.h>

#include <cerrno>
#include <filesystem>
#include <random>

#include "core/errors.h"
#include "core/file_error.h"

namespace arapfields {
namespace {

namespace fs = std::filesystem;

constexpr const char* ending = ".tmp";
constexpr std::size_t token_length = 8;
constexpr std::size_t kept_name = 200;  ///< of a name's bytes; a file system allows 255 with what is added
constexpr int most_links = 40;          ///< as Linux follows
constexpr int most_tries = 100;

std::string random_token() {
  static constexpr char letters[] = "abcdefghijklmnopqrstuvwxyz0123456789";
  std::random_device device;
  std::string token(token_length, ' ');
  for (char& c : token) c = letters[device() % (sizeof letters - 1)];
  return token;
}

/// What temporary names of this file begin with, up to the token.
std::string temporary_prefix(const fs::path& target) {
  std::string prefix(1, '.');
  return prefix.append(target.filename().string(), 0, kept_name).append(1, '.');
}

/// Opens and locks a temporary folder; −1 where that fails: EWOULDBLOCK where another holds it or it is gone.
int lock_folder(const fs::path& folder) {
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

/// Removes a temporary folder and what lies beside it under a name that continues the folder's.
void remove_temporary(const fs::path& folder) noexcept {
  std::error_code ignored;
  const std::string name = folder.filename().string();
  for (fs::directory_iterator entry(folder.parent_path(), ignored), end; !ignored && entry != end;
       entry.increment(ignored)) {
    const std::string other = entry->path().filename().string();
    std::error_code kept;
    if (other.size() > name.size() && other.starts_with(name)) fs::remove(entry->path(), kept);
  }
  fs::remove_all(folder, ignored);
}

/// Removes what processes that live no more have left of this output.
void remove_stale(const fs::path& target) noexcept {
  std::error_code ignored;
  const std::string prefix = temporary_prefix(target);
  const std::size_t length = prefix.size() + token_length + std::string(ending).size();
  for (fs::directory_iterator entry(target.parent_path(), ignored), end; !ignored && entry != end;
       entry.increment(ignored)) {
    const std::string name = entry->path().filename().string();
    if (name.size() != length || !name.starts_with(prefix) || !name.ends_with(ending)) continue;
    const int lock = lock_folder(entry->path());
    if (lock < 0) continue;
    remove_temporary(entry->path());
    close(lock);
  }
}

/// The file behind the links, which need not exist.
fs::path followed(const std::string& given) {
  fs::path path = given;
  for (int link = 0; link < most_links; ++link) {
    std::error_code none;
    const fs::path next = fs::read_symlink(path, none);
    if (none) return path.has_parent_path() ? path : fs::path(".") / path;
    path = next.is_absolute() ? next : path.parent_path() / next;
  }
  throw FileError(given, ELOOP);
}

void sync_folder(const fs::path& folder) {
  const int descriptor = open(folder.c_str(), O_RDONLY | O_DIRECTORY | O_CLOEXEC);
  if (descriptor < 0) return;
  fsync(descriptor);  // not all file systems can; the file itself is on the disk
  close(descriptor);
}

}  // namespace

OutputFile::OutputFile(const std::string& path) : path_(path) {
  require(!path.empty() && path.find('\0') == std::string::npos, "path",
          std::string("'").append(path.c_str()).append("'"), "the name of a file is needed");
  const fs::path target = followed(path);
  target_ = target.string();
  const std::string name = target.filename().string();
  struct stat there{};
  const bool exists = stat(target_.c_str(), &there) == 0;
  if (name.empty() || name == "." || name == ".." || (exists && S_ISDIR(there.st_mode)))
    throw FileError(path, EISDIR);
  require(!exists || S_ISREG(there.st_mode), path, "is not a regular file",
          "pipes, devices and sockets cannot be written to");
  if (exists && access(target_.c_str(), W_OK) != 0) throw FileError(path, errno);
  remove_stale(target);
  for (int tries = 0; lock_ < 0; ++tries) {
    folder_ =
        (target.parent_path() / temporary_prefix(target).append(random_token()).append(ending)).string();
    if (mkdir(folder_.c_str(), 0700) != 0) {
      if (errno == EEXIST && tries < most_tries) continue;
      throw FileError(path, errno);
    }
    lock_ = lock_folder(folder_);
    // Either who sweeps has taken it at once, or the file system has no locks, and then nobody sweeps.
    if (lock_ < 0 && errno != EWOULDBLOCK && errno != ENOENT)
      lock_ = open(folder_.c_str(), O_RDONLY | O_DIRECTORY | O_CLOEXEC);
    if (lock_ < 0 && tries >= most_tries) throw FileError(path, EBUSY);
  }
  partial_ = (fs::path(folder_) / name).string();
}

OutputFile::~OutputFile() { discard(); }

std::string OutputFile::beside() const { return folder_ + ".new" + fs::path(target_).extension().string(); }

void OutputFile::write(const void* data, std::size_t bytes) {
  if (file_ < 0) file_ = open(partial_.c_str(), O_WRONLY | O_CREAT | O_EXCL | O_CLOEXEC, 0666);
  if (file_ < 0) throw FileError(path_, errno);
  for (const char *next = static_cast<const char*>(data), *end = next + bytes; next < end;) {
    const ssize_t done = ::write(file_, next, static_cast<std::size_t>(end - next));
    if (done < 0 && errno == EINTR) continue;
    if (done < 0) throw FileError(path_, errno);
    next += done;
    written_ += static_cast<std::size_t>(done);
  }
}

void OutputFile::finish() {
  struct stat other{};
  if (stat(beside().c_str(), &other) == 0) partial_ = beside();
  const int arrived = open(partial_.c_str(), O_RDONLY | O_NOFOLLOW | O_CLOEXEC);
  std::error_code ignored;
  if (arrived < 0)
    require(fs::exists(fs::path(target_).parent_path(), ignored), path_, "its folder is gone",
            "bring it back, or choose another");
  require(arrived >= 0, path_, "nothing was written", "the disk may be full");
  struct stat found{}, there{};
  int problem = fstat(arrived, &found) != 0 ? errno : 0;
  if (problem == 0 && stat(target_.c_str(), &there) == 0) {
    if (fchmod(arrived, there.st_mode & 07777) != 0) problem = errno;
    if (there.st_uid != found.st_uid || there.st_gid != found.st_gid)
      if (fchown(arrived, there.st_uid, there.st_gid) != 0) errno = 0;  // another's file becomes ours
  }
  if (problem == 0 && fsync(arrived) != 0) problem = errno;
  close(arrived);
  if (problem != 0) throw FileError(path_, problem);
  const bool whole = S_ISREG(found.st_mode) && found.st_size > 0 &&
                     (file_ < 0 || static_cast<std::size_t>(found.st_size) == written_);
  require(whole, path_, std::to_string(found.st_size) + " bytes arrived", "the disk may be full");
  finished_ = true;
}

void OutputFile::commit() {
  if (!finished_) finish();
  if (rename(partial_.c_str(), target_.c_str()) != 0) throw FileError(path_, errno);
  sync_folder(fs::path(target_).parent_path());
  discard();
}

void OutputFile::discard() noexcept {
  if (file_ >= 0) close(file_);
  file_ = -1;
  if (lock_ < 0) return;
  remove_temporary(folder_);
  close(lock_);
  lock_ = -1;
}

}  // namespace arapfields
