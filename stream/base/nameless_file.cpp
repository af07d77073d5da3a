#include "stream/base/nameless_file.h"

#include <fmt/format.h>

#include <cerrno>
#include <cstring>

#include "stream/base/new_file.h"

namespace curvisplat {
namespace {

/// A file of this process's own, which nobody else can read or, in a folder like /tmp, replace.
OutputFile create(const std::filesystem::path& folder) {
  const NewFile file = createNewFile(
      [&](uint32_t random) { return folder / fmt::format("curvisplat.{:08x}.tmp", random); }, 0600);
  if (file.fd < 0)
    throw Error("{}: no temporary file can be made there: {}", folder.string(), std::strerror(errno));
  try {
    OutputFile out(file.path, Caching::kPages, OutputFile::Existing::kKeep);
    SystemCalls::current().close(file.fd);
    return out;
  } catch (...) {
    SystemCalls::current().close(file.fd);
    removeAll(file.path);
    throw;
  }
}

InputFile openWithoutName(const std::filesystem::path& path) {
  try {
    InputFile in(path);
    removeFile(path);
    return in;
  } catch (...) {
    removeAll(path);
    throw;
  }
}

}  // namespace

NamelessFile::NamelessFile(const std::filesystem::path& folder)
    : out_(create(folder)), in_(openWithoutName(out_.path())) {}

}  // namespace curvisplat
