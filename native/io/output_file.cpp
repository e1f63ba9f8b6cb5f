// SPDX-License-Identifier: GPL-3.0-or-later
#include "io/output_file.h"

#include <cerrno>
#include <filesystem>
#include <random>
#include <system_error>

#include "core/errors.h"
#include "io/system_file.h"

namespace arapfields {
namespace {

namespace fs = std::filesystem;

constexpr const char* ending = ".tmp";
constexpr std::size_t token_length = 8;
constexpr std::size_t kept_name = 200;  ///< of a name's bytes; a file system allows 255 with what is added
constexpr std::size_t added_name = 64;  ///< more than what temporary names add to twice the file's own
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
fs::path temporary_prefix(const fs::path& target) {
  std::string name = text_of(target.filename());
  if (name.size() > kept_name) {
    std::size_t end = kept_name;  // between two letters of UTF-8
    while (end > 0 && (static_cast<unsigned char>(name[end]) & 0xc0) == 0x80) --end;
    name.resize(end);
  }
  return path_of("." + name + ".");
}

/// Removes a temporary folder and what lies beside it under a name that continues the folder's.
void remove_temporary(const fs::path& folder) noexcept {
  const fs::path::string_type name = folder.filename().native();
  for (const fs::path& entry : system_file::entries(folder.parent_path())) {
    const fs::path::string_type other = entry.filename().native();
    if (other.size() > name.size() && other.starts_with(name)) system_file::remove_tree(entry);
  }
  system_file::remove_tree(folder);
}

/// Removes what dead processes left of this output.
void remove_stale(const fs::path& target) {
  const fs::path prefix = temporary_prefix(target), last(ending);
  const std::size_t length = prefix.native().size() + token_length + last.native().size();
  for (const fs::path& entry : system_file::entries(target.parent_path())) {
    const fs::path::string_type name = entry.filename().native();
    if (name.size() != length || !name.starts_with(prefix.native()) || !name.ends_with(last.native()))
      continue;
    const int lock = system_file::lock_folder(entry);
    if (lock < 0) continue;
    remove_temporary(entry);
    system_file::close_file(lock);
  }
}

/// The file behind the links, which need not exist.
fs::path followed(const std::string& given) {
  fs::path path = path_of(given);
  for (int link = 0; link < most_links; ++link) {
    std::error_code none;
    const fs::path next = fs::read_symlink(path, none);
    if (none) return path.has_parent_path() ? path : fs::path(".") / path;
    path = next.is_absolute() ? next : path.parent_path() / next;
  }
  throw FileError(given, ELOOP);
}

}  // namespace

OutputFile::OutputFile(const std::string& path) : path_(path) {
  require(!path.empty() && path.find('\0') == std::string::npos, "path",
          std::string("'").append(path.c_str()).append("'"), "the name of a file is needed");
  try {
    const fs::path target = followed(path);
    open_folder(system_file::reachable(target, 2 * target.filename().native().size() + added_name));
  } catch (const std::system_error&) {  // a name that is no text of the system's
    throw FileError(path, EILSEQ);
  }
}

void OutputFile::open_folder(const fs::path& target) {
  target_ = text_of(target);
  const fs::path name = target.filename();
  const system_file::Kind there = system_file::kind(target);
  const auto& text = name.native();  // "", "." and ".." are folders
  const bool dots = text.size() <= 2 && text.find_first_not_of(fs::path::value_type('.')) == text.npos;
  if (dots || there == system_file::Kind::folder) throw FileError(path_, EISDIR);
  require(there != system_file::Kind::other, path_, "is not a regular file",
          "pipes, devices and sockets cannot be written to");
  if (there == system_file::Kind::file && !system_file::may_write(target)) throw FileError(path_, errno);
  remove_stale(target);
  const fs::path prefix = temporary_prefix(target);
  for (int tries = 0; lock_ < 0; ++tries) {
    fs::path folder = target.parent_path() / prefix;
    folder += random_token() + ending;
    if (!system_file::make_folder(folder)) {
      if (errno == EEXIST && tries < most_tries) continue;
      throw FileError(path_, errno);
    }
    folder_ = text_of(folder);
    lock_ = system_file::lock_folder(folder);
    // Either another process swept the folder at once, or the file system has no locks and nothing is swept.
    if (lock_ < 0 && errno != EWOULDBLOCK && errno != ENOENT) lock_ = system_file::hold_folder(folder);
    if (lock_ < 0 && tries >= most_tries) throw FileError(path_, EBUSY);
  }
  partial_ = text_of(path_of(folder_) / name);
}

OutputFile::~OutputFile() { discard(); }

std::string OutputFile::beside() const { return folder_ + ".new" + text_of(path_of(target_).extension()); }

void OutputFile::write(const void* data, std::size_t bytes) {
  if (file_ < 0) file_ = system_file::create(path_of(partial_));
  if (file_ < 0) throw FileError(path_, errno);
  for (const char *next = static_cast<const char*>(data), *end = next + bytes; next < end;) {
    const std::ptrdiff_t done = system_file::append(file_, next, static_cast<std::size_t>(end - next));
    if (done < 0) throw FileError(path_, errno);
    next += done;
    written_ += static_cast<std::size_t>(done);
  }
}

void OutputFile::finish() {
  const fs::path target = path_of(target_);
  const auto exists = [](const fs::path& path) { return system_file::kind(path) != system_file::Kind::none; };
  if (exists(path_of(beside()))) partial_ = beside();
  const int arrived = system_file::open_written(path_of(partial_));
  if (arrived < 0)
    require(exists(target.parent_path()), path_, "its folder is gone", "bring it back, or choose another");
  require(arrived >= 0, path_, "nothing was written", "the disk may be full");
  const bool done = system_file::take_permissions(arrived, target) && system_file::to_disk(arrived);
  const int problem = done ? 0 : errno;
  const bool regular = system_file::is_regular(arrived);
  const std::uint64_t size = system_file::size(arrived);
  system_file::close_file(arrived);
  if (problem != 0) throw FileError(path_, problem);
  require(regular && size > 0 && (file_ < 0 || size == written_), path_,
          std::to_string(size) + " bytes arrived", "the disk may be full");
  finished_ = true;
}

void OutputFile::commit() {
  if (!finished_) finish();
  close_written();  // Windows cannot rename an open file
  const fs::path target = path_of(target_);
  if (!system_file::replace(path_of(partial_), target)) throw FileError(path_, errno);
  system_file::folder_to_disk(target.parent_path());
  discard();
}

void OutputFile::close_written() noexcept {
  if (file_ >= 0) system_file::close_file(file_);
  file_ = -1;
}

void OutputFile::discard() noexcept {
  close_written();
  if (lock_ < 0) return;
  remove_temporary(path_of(folder_));
  system_file::close_file(lock_);
  lock_ = -1;
}

}  // namespace arapfields
