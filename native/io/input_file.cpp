// SPDX-License-Identifier: GPL-3.0-or-later
#include "io/input_file.h"

#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>

#include <cerrno>

#include "core/errors.h"
#include "core/file_error.h"

namespace arapfields {

InputFile::InputFile(const std::string& path)
    : path_(path), file_(open(path.c_str(), O_RDONLY | O_CLOEXEC | O_NONBLOCK)) {
  if (file_ < 0) throw FileError(path, errno);
  struct stat found{};
  const int problem = fstat(file_, &found) != 0 ? errno : S_ISDIR(found.st_mode) ? EISDIR : 0;
  const bool regular = S_ISREG(found.st_mode);
  if (problem != 0 || !regular) close(file_);
  if (problem != 0) throw FileError(path, problem);
  require(regular, "file", "is not a regular file", "pipes, devices and sockets cannot be read");
  size_ = static_cast<std::size_t>(found.st_size);
}

InputFile::~InputFile() { close(file_); }

void InputFile::read(std::size_t offset, void* to, std::size_t bytes) const {
  for (std::size_t done = 0; done < bytes;) {
    const ssize_t count =
        pread(file_, static_cast<char*>(to) + done, bytes - done, static_cast<off_t>(offset + done));
    if (count < 0 && errno == EINTR) continue;
    if (count < 0) throw FileError(path_, errno);
    require(count > 0, "file", "it has become shorter while it was read", "it is being written to");
    done += static_cast<std::size_t>(count);
  }
}

}  // namespace arapfields
