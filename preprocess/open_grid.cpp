#include "preprocess/open_grid.h"

#include <algorithm>
#include <array>
#include <charconv>

#include "preprocess/cgns_source.h"
#include "preprocess/foreign_formats.h"
#include "preprocess/netcdf_source.h"
#include "preprocess/plot3d_source.h"
#include "stream/error.h"

namespace curvisplat {
namespace {

/// A file format with a reader of its own. What none recognises is taken for PLOT3D, which has no mark.
struct GridFormat {
  bool (*recognises)(const InputFile& file);
  std::unique_ptr<GridSource> (*open)(const OpenGridOptions& options);
};

template <typename Source>
std::unique_ptr<GridSource> openAs(const OpenGridOptions& options) {
  return std::make_unique<Source>(options);
}

constexpr std::array kFormats{
    GridFormat{CgnsFile::recognises, openAs<CgnsSource>},  // before NetCDF, which takes all HDF5 files
    GridFormat{NetcdfFile::recognises, openAs<NetcdfSource>},
};

void refuseForeign(const std::filesystem::path& path, const char* expected) {
  if (std::filesystem::is_directory(path))
    throw Error("{}: is a folder where {} was expected", path.string(), expected);
  if (const auto format = foreignFormat(InputFile(path)))
    throw Error("{}: is {}; expected {}", path.string(), *format, expected);
}

/// Positions of the scalars that `matches` is true for.
template <typename Matches>
std::vector<uint32_t> positionsOf(const GridDescription& description, const Matches& matches) {
  std::vector<uint32_t> positions;
  for (uint32_t n = 0; n < description.scalars.size(); ++n)
    if (matches(description.scalars[n])) positions.push_back(n);
  return positions;
}

/// The first of: the exact name, a number, the simplified name or alias.
std::vector<uint32_t> candidatesFor(const GridDescription& description, const std::string& name) {
  const auto exact = positionsOf(description, [&](const GridScalar& scalar) { return scalar.name == name; });
  if (!exact.empty()) return exact;
  uint32_t number = 0;
  const auto [end, error] = std::from_chars(name.data(), name.data() + name.size(), number);
  if (error == std::errc{} && end == name.data() + name.size() && number > 0)
    return positionsOf(description, [&](const GridScalar& scalar) { return scalar.number == number; });
  const std::string simple = simplifiedName(name);
  return positionsOf(description, [&](const GridScalar& scalar) {
    return simplifiedName(scalar.name) == simple ||
           std::find(scalar.aliases.begin(), scalar.aliases.end(), simple) != scalar.aliases.end();
  });
}

std::string namesIn(const GridDescription& description) {
  if (description.scalars.empty()) return "there are none: give a Q or function file";
  std::string names = "there are ";
  for (size_t n = 0; n < description.scalars.size(); ++n) {
    const GridScalar& scalar = description.scalars[n];
    names += (n ? ", " : "") + scalar.name;
    if (scalar.number > 0 && scalar.name != std::to_string(scalar.number))
      names += " (" + std::to_string(scalar.number) + ")";
  }
  return names;
}

}  // namespace

std::unique_ptr<GridSource> openGrid(const OpenGridOptions& options) {
  OpenGridOptions complete = options;
  if (complete.temporary_folder.empty()) complete.temporary_folder = std::filesystem::temp_directory_path();
  if (std::filesystem::is_regular_file(options.grid)) {
    const InputFile file(options.grid);
    for (const GridFormat& format : kFormats)
      if (format.recognises(file)) return format.open(complete);
  }
  refuseForeign(options.grid, "a grid file");
  for (const std::filesystem::path& path : options.solutions)
    refuseForeign(path, "a PLOT3D Q or function file");
  return std::make_unique<Plot3dSource>(complete);
}

std::string simplifiedName(const std::string& name) {
  std::string simple;
  for (const char c : name) {
    if (c == ' ' || c == '_' || c == '-') continue;
    simple += c >= 'A' && c <= 'Z' ? static_cast<char>(c - 'A' + 'a') : c;
  }
  return simple;
}

std::vector<uint32_t> scalarsNamed(const GridDescription& description,
                                   const std::vector<std::string>& names) {
  if (names.empty()) {
    if (description.scalars.empty()) throw UsageError("no scalar to choose: {}", namesIn(description));
    return {0};
  }
  std::vector<uint32_t> positions;
  for (const std::string& name : names) {
    const std::vector<uint32_t> candidates = candidatesFor(description, name);
    if (candidates.size() > 1)
      throw UsageError("scalar {} is in several files: {}", name, namesIn(description));
    if (candidates.empty()) throw UsageError("no scalar is called {}: {}", name, namesIn(description));
    if (std::find(positions.begin(), positions.end(), candidates.front()) != positions.end())
      throw UsageError("scalar {} is asked for twice", name);
    positions.push_back(candidates.front());
  }
  return positions;
}

}  // namespace curvisplat
