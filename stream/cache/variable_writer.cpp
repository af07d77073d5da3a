#include "stream/cache/variable_writer.h"

#include <algorithm>
#include <cerrno>
#include <system_error>
#include <utility>

#include "stream/base/check.h"
#include "stream/base/disk_full.h"
#include "stream/base/durable_file.h"
#include "stream/base/error.h"
#include "stream/cache/cache_index.h"
#include "stream/cache/faces_file.h"
#include "stream/cache/replace_manifest.h"
#include "stream/cache/stream_file.h"

namespace curvisplat {
namespace {

namespace fs = std::filesystem;

constexpr const char* kPartSuffix = ".part";

}  // namespace

VariableWriter::VariableWriter(const CacheLock& lock, Manifest manifest, std::vector<VariableInfo> variables)
    : ValuesWriter(manifest.root, variables), lock_(&lock), manifest_(std::move(manifest)) {
  removeLeftovers();
  uint32_t number = 0;
  for (const VariableInfo& variable : manifest_.variables) number = std::max(number, variable.number + 1);
  try {
    for (VariableInfo& variable : variables) {
      variable.number = number++;
      const fs::path path = lock.cache() / variableFileName(variable);
      fs::path part = path;
      part += kPartSuffix;
      OutputFile file(part, Caching::kPages, OutputFile::Existing::kEmpty, path);
      files_.push_back({std::move(variable), path, part, std::move(file), {}, false});
      beginVariableFile(files_.back().file);
      files_.back().table.resize(manifest_.bricks);
    }
  } catch (...) {
    removeLeftovers();
    throw;
  }
}

VariableWriter::~VariableWriter() {
  // If another cache has replaced this one, files of these names are that cache's.
  if (in_place_ || !lock_->isStillThere()) return;
  for (const NewFile& file : files_) removeAll(file.is_renamed ? file.path : file.part);
  for (const FileInfo& other : others_) removeAll(lock_->cache() / other.name);
}

/// Removes the files that a killed program left behind: those that the manifest does not list.
void VariableWriter::removeLeftovers() const {
  std::error_code ignored;
  for (const auto& entry : fs::directory_iterator(lock_->cache(), ignored)) {
    const std::string name = entry.path().filename().string();
    const bool is_known = std::any_of(manifest_.files.begin(), manifest_.files.end(),
                                      [&](const FileInfo& file) { return file.name == name; });
    if (!is_known && (name.starts_with("var.") || isFacesFile(name) || name.ends_with(kPartSuffix)))
      removeAll(entry.path());
  }
}

std::vector<uint32_t> VariableWriter::numbers() const {
  std::vector<uint32_t> numbers;
  for (const NewFile& file : files_) numbers.push_back(file.variable.number);
  return numbers;
}

void VariableWriter::append(uint32_t brick, std::span<const EncodedValues> values) {
  CURVISPLAT_CHECK_OP(values.size(), ==, files_.size());
  for (size_t n = 0; n < values.size(); ++n) appendValues(files_[n].file, values[n], files_[n].table[brick]);
}

std::vector<FileInfo> VariableWriter::finish(const std::vector<std::string>& sources) {
  std::vector<FileInfo> infos;
  for (size_t v = 0; v < files_.size(); ++v)
    infos.push_back(finishVariableFile(files_[v].file, variableFileName(files_[v].variable), files_[v].table,
                                       histograms().of(v)));
  infos.insert(infos.end(), others_.begin(), others_.end());
  if (!lock_->isStillThere())
    throw Error(
        "{}: another program has replaced the cache; the new cache was not changed: add the scalar to it "
        "again",
        lock_->cache().string());
  for (NewFile& file : files_) {
    if (SystemCalls::current().rename(file.part.c_str(), file.path.c_str()) < 0)
      failToRename(errno, file.part, file.path);
    file.is_renamed = true;
  }
  // The names of the payload files must be on the disk before a manifest that lists them.
  syncDirectory(lock_->cache());

  for (const NewFile& file : files_) {
    manifest_.variables.push_back(file.variable);
    manifest_.steps.front().variables.push_back(file.variable.number);
  }
  manifest_.files.insert(manifest_.files.end(), infos.begin(), infos.end());
  addSources(sources, manifest_);
  try {
    replaceManifest(lock_->cache(), manifest_);
  } catch (const NameNotSynced&) {
    in_place_ = true;
    throw;
  }
  in_place_ = true;
  return infos;
}

}  // namespace curvisplat
