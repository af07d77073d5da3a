#include "preprocess/formats/open/file_series.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <string>
#include <utility>
#include <vector>

#include "preprocess/formats/common/described_source.h"
#include "preprocess/formats/common/named_file.h"
#include "preprocess/grid/time_steps.h"
#include "stream/base/error.h"
#include "stream/base/json_document.h"

namespace curvisplat {
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
  of_step.grid = options.namesFolder() / files[step].name;
  of_step.names_folder.reset();
  of_step.time_step.reset();
  if (of_step.grid.extension() == ".series")
    throw Error("{}: lists {}, a file series itself; expected grid files", options.grid.string(),
                files[step].name);
  existingFile(options.grid.string() + ':', of_step.grid);
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
