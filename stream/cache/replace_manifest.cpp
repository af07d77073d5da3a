#include "stream/cache/replace_manifest.h"

#include <algorithm>
#include <span>

#include "stream/base/durable_file.h"
#include "stream/base/file.h"

namespace curvisplat {

void replaceManifest(const std::filesystem::path& cache, const Manifest& manifest) {
  const std::filesystem::path path = cache / "manifest.json";
  std::filesystem::path part = path;
  part += ".part";
  SystemCalls::current().remove(part.c_str());  // which may be a link
  try {
    OutputFile file(part);
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

void addSources(const std::vector<std::string>& sources, Manifest& manifest) {
  for (const std::string& source : sources)
    if (std::find(manifest.sources.begin(), manifest.sources.end(), source) == manifest.sources.end())
      manifest.sources.push_back(source);
}

}  // namespace curvisplat
