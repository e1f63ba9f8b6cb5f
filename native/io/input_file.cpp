// SPDX-License-Identifier: GPL-3.0-or-later
#include "io/input_file.h"

#include <cerrno>
#include <system_error>

#include "core/errors.h"
#include "io/system_file.h"

namespace arapfields {
namespace {

int opened(const std::string& path) {
  try {
    const int file = system_file::open_to_read(path_of(path));
    if (file < 0) throw FileError(path, errno);
    return file;
  } catch (const std::system_error&) {  // the name is no text of the system's
    throw FileError(path, EILSEQ);
  }
}

}  // namespace

InputFile::InputFile(const std::string& path) : path_(path), file_(opened(path)) {
  const bool regular = system_file::is_regular(file_);
  if (!regular) system_file::close_file(file_);
  require(regular, "file", "is not a regular file", "pipes, devices and sockets cannot be read");
  size_ = static_cast<std::size_t>(system_file::size(file_));
}

InputFile::~InputFile() { system_file::close_file(file_); }

void InputFile::read(std::size_t offset, void* to, std::size_t bytes) const {
  for (std::size_t done = 0; done < bytes;) {
    const std::ptrdiff_t count =
        system_file::read_at(file_, static_cast<char*>(to) + done, bytes - done, offset + done);
    if (count < 0) throw FileError(path_, errno);
    require(count > 0, "file", "it has become shorter while it was read", "it is being written to");
    done += static_cast<std::size_t>(count);
  }
}

}  // namespace arapfields
