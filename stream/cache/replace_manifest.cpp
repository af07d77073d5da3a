#include "stream/cache/replace_manifest.h"

#include <fcntl.h>
#include <sys/file.h>

#include <algorithm>
#include <span>

#include "stream/base/durable_file.h"
#include "stream/base/file.h"
#include "stream/base/open_retrying.h"

namespace curvisplat {
namespace {

/// Where the new manifest is written, and where the old one lies until the folder is synced.
std::filesystem::path partOf(const std::filesystem::path& manifest) {
  std::filesystem::path part = manifest;
  part += ".part";
  return part;
}

}  // namespace

void replaceManifest(const std::filesystem::path& cache, const Manifest& manifest) {
  const std::filesystem::path path = cache / "manifest.json";
  const std::filesystem::path part = partOf(path);
  SystemCalls::current().remove(part.c_str());  // which may be a link
  try {
    OutputFile file(part, Caching::kPages, OutputFile::Existing::kEmpty, path);
    const std::string text = manifest.toJson();
    file.append(std::as_bytes(std::span(text)));
    file.close();
    renameDurably(part, path);
  } catch (const NameNotSynced&) {
    throw;
  } catch (...) {
    removeAll(part);
    throw;
  }
}

void removeReplacedManifest(const std::filesystem::path& cache) {
  const std::filesystem::path part = partOf(cache / "manifest.json");
  // The program that replaces a manifest has locked the old one, which it may have to put back.
  const int fd = openRetrying(part, O_RDONLY | O_NOFOLLOW | O_NONBLOCK);
  if (fd < 0) return;
  if (::flock(fd, LOCK_EX | LOCK_NB) == 0) SystemCalls::current().remove(part.c_str());
  SystemCalls::current().close(fd);
}

void addSources(const std::vector<std::string>& sources, Manifest& manifest) {
  for (const std::string& source : sources)
    if (std::find(manifest.sources.begin(), manifest.sources.end(), source) == manifest.sources.end())
      manifest.sources.push_back(source);
}

}  // namespace curvisplat
