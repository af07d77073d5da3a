#include "preprocess/formats/open/indirect_files.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <string>
#include <utility>
#include <vector>

#include "preprocess/formats/common/byte_source.h"
#include "preprocess/formats/common/described_source.h"
#include "preprocess/grid/grid_source.h"
#include "stream/base/error.h"
#include "stream/base/file.h"
#include "stream/base/json_document.h"

namespace curvisplat {
namespace {

using Unpacked = std::vector<std::unique_ptr<UnpackedFile>>;

void replaceAll(std::string& text, const std::string& from, const std::string& to) {
  for (size_t at = text.find(from); at != std::string::npos; at = text.find(from, at + to.size()))
    text.replace(at, from.size(), to);
}

/// Names of decompressed files become those of the compressed ones.
std::string withOriginals(std::string text, const Unpacked& files) {
  // Backwards: a later file's path may begin like an earlier one's.
  for (auto file = files.rbegin(); file != files.rend(); ++file)
    replaceAll(text, (*file)->path().string(), (*file)->original().string());
  return text;
}

/// The description of what was opened, with the names of the compressed files.
GridDescription describedByOriginals(GridDescription description, const Unpacked& files) {
  for (std::string& file : description.files) file = withOriginals(file, files);
  for (std::string& warning : description.warnings) warning = withOriginals(warning, files);
  for (FlowConditions& flow : description.flow) flow.file = withOriginals(flow.file, files);
  for (MeshPiece& piece : description.pieces) piece.file = withOriginals(piece.file, files);
  description.format += ", decompressed";
  return description;
}

}  // namespace

std::unique_ptr<DataSource> openUnpacked(
    OpenGridOptions options, const std::function<std::unique_ptr<DataSource>(const OpenGridOptions&)>& open) {
  Unpacked files;
  const auto unpack = [&](std::filesystem::path& path) {
    if (!isRegularFile(path) || !UnpackedFile::recognises(InputFile(path))) return;
    files.push_back(std::make_unique<UnpackedFile>(path, options.temporary_folder));
    path = files.back()->path();
  };
  // What a compressed file names lies beside it.
  const std::filesystem::path folder = options.grid.parent_path();
  unpack(options.grid);
  if (!files.empty()) options.names_folder = folder;
  for (std::filesystem::path& solution : options.solutions) unpack(solution);
  if (files.empty()) return open(options);
  std::unique_ptr<DataSource> source;
  try {
    source = open(options);
  } catch (const Error& error) {
    throw Error("{}", withOriginals(error.what(), files));
  }
  for (const auto& file : files) file->removeName();
  const auto held = std::make_shared<const Unpacked>(std::move(files));
  GridDescription description = describedByOriginals(source->description(), *held);
  return described(std::move(source), std::move(description),
                   [held](std::string text) { return withOriginals(std::move(text), *held); });
}

namespace {

struct ListedFile {
  double time = 0;
  std::string name;
};

std::vector<ListedFile> filesIn(const std::filesystem::path& path) {
  const JsonDocument document(readTextFile(path), path.string(),
                              "{\"files\": [{\"name\": ..., \"time\": ...}, ...]}");
  const JsonField list = document.root().at("files");
  std::vector<ListedFile> files;
  for (const JsonField& entry : list.elements()) {
    const auto time = entry.find("time");
    files.push_back({time ? time->number() : static_cast<double>(files.size()), entry.at("name").text()});
  }
  if (files.empty()) list.fail("one file or more");
  std::stable_sort(files.begin(), files.end(),
                   [](const ListedFile& a, const ListedFile& b) { return a.time < b.time; });
  return files;
}

}  // namespace

bool isFileSeries(const InputFile& file) {
  return file.path().extension() == ".series";
}

std::unique_ptr<DataSource> openFileSeries(
    const OpenGridOptions& options,
    const std::function<std::unique_ptr<DataSource>(const OpenGridOptions&)>& open) {
  const std::vector<ListedFile> files = filesIn(options.grid);
  std::vector<double> times;
  for (const ListedFile& file : files) times.push_back(file.time);
  const uint32_t step = chosenTimeStep(options.grid.string(), times, options.time_step);

  OpenGridOptions of_step = options;
  of_step.grid = existingFile(options.grid.string() + ':', options.namesFolder(), files[step].name);
  of_step.names_folder.reset();
  of_step.time_step.reset();
  if (of_step.grid.extension() == ".series")
    throw Error("{}: lists {}, a file series itself; expected grid files", options.grid.string(),
                files[step].name);
  std::unique_ptr<DataSource> source = open(of_step);
  GridDescription description = source->description();
  description.files.push_back(options.grid.string());
  description.times = std::move(times);
  description.time_step = step;
  description.time_unit.clear();  // that of the times in the listed files
  description.calendar.clear();
  return described(std::move(source), std::move(description));
}

}  // namespace curvisplat
