#include "preprocess/formats/su2/su2_source.h"

#include <fmt/format.h>

#include <algorithm>
#include <charconv>
#include <optional>
#include <string_view>

#include "stream/base/count_text.h"
#include "stream/base/error.h"
#include "stream/base/words.h"

namespace curvisplat {
namespace {

constexpr uint64_t kLooked = 4096;

}  // namespace

namespace {

/// The first line that is neither empty nor a comment, without the white space around it; empty if the beginning has none.
std::string firstLineOf(const InputFile& file) {
  std::string begin(static_cast<size_t>(std::min<uint64_t>(file.size(), kLooked)), '\0');
  file.readAt(0, std::span(begin.data(), begin.size()));
  for (size_t at = 0; at < begin.size();) {
    const size_t end = std::min(begin.find('\n', at), begin.size());
    const std::string_view line = trimmed(std::string_view(begin).substr(at, end - at));
    at = end + 1;
    if (!line.empty() && line[0] != '%') return std::string(line);
  }
  return "";
}

/// What follows "KEY =" in the line; nullopt if it has another key.
std::optional<std::string_view> valueOf(std::string_view line, std::string_view key) {
  if (!line.starts_with(key)) return std::nullopt;
  line = trimmed(line.substr(key.size()));
  if (!line.starts_with('=')) return std::nullopt;
  return trimmed(line.substr(1));
}

}  // namespace

bool isSu2(const InputFile& file) {
  const std::string line = firstLineOf(file);
  return valueOf(line, "NDIME") || valueOf(line, "NZONE");
}

uint64_t su2Zones(const InputFile& file) {
  const std::string line = firstLineOf(file);
  const auto value = valueOf(line, "NZONE");
  uint64_t zones = 1;
  if (value) std::from_chars(value->data(), value->data() + value->size(), zones);
  return zones;
}

Su2Source::Su2Source(const OpenGridOptions& options) {
  const auto pool = std::make_shared<OpenFiles>();
  const auto file = std::make_shared<const PooledFile>(pool, options.grid);
  zones_ = readSu2Mesh(file, options.temporary_folder);
  description_.files.push_back(file->name());
  description_.coordinate_bytes = 8;
  description_.format = fmt::format("SU2 mesh, {}", countText(zones_.size(), "zone"));
  std::vector<std::string> markers;
  for (size_t n = 0; n < zones_.size(); ++n) {
    const SpooledMesh& mesh = zones_[n].mesh;
    description_.pieces.push_back({fmt::format("zone {}", n + 1), file->name(), mesh.points(), mesh.cells()});
    markers.insert(markers.end(), zones_[n].markers.begin(), zones_[n].markers.end());
  }
  if (!markers.empty()) description_.notes.push_back(fmt::format("boundaries: {}", fmt::join(markers, ", ")));
  openRestarts(options);
}

void Su2Source::openRestarts(const OpenGridOptions& options) {
  const std::vector<std::filesystem::path>& files = options.solutions;
  if (files.empty()) return;
  if (zones_.size() > 1 && files.size() != zones_.size())
    throw Error("{}: has {} zones, but {} restart files are given; give one for each, in their order",
                options.grid.string(), zones_.size(), files.size());
  const auto pool = std::make_shared<OpenFiles>();
  for (size_t n = 0; n < files.size(); ++n) {
    const size_t piece = zones_.size() > 1 ? n : 0;
    restarts_.emplace_back(std::make_shared<const PooledFile>(pool, files[n]), zones_[piece].mesh.points(),
                           options.temporary_folder);
    description_.files.push_back(files[n].string());
    if (zones_.size() > 1)
      description_.notes.push_back(fmt::format("zone {} has the values of {}", n + 1, files[n].string()));
    const std::vector<std::string>& names = restarts_.back().names();
    if (piece > 0 && names != restarts_.front().names())
      throw Error("{}: has other variables than {}; expected the same", files[n].string(), files[0].string());
    for (size_t v = 0; v < names.size(); ++v) {
      if (piece > 0) {
        variables_[v].of_piece.emplace_back(n, v);
        continue;
      }
      const auto taken = [&](const GridScalar& other) { return other.name == names[v]; };
      GridScalar scalar;
      scalar.name = names[v];
      if (std::any_of(description_.scalars.begin(), description_.scalars.end(), taken))
        scalar.name += fmt::format(":{}", n + 1);
      description_.scalars.push_back(std::move(scalar));
      variables_.push_back({{{n, v}}});
    }
  }
  description_.format += restarts_.front().binary() ? " + binary restart" : " + ASCII restart";
}

void Su2Source::readPoints(uint32_t piece, uint64_t first, uint64_t count, std::span<const uint32_t> scalars,
                           MeshPoints& out) const {
  zones_.at(piece).mesh.readPoints(first, count, out);
  out.scalars.resize(scalars.size());
  for (size_t n = 0; n < scalars.size(); ++n) {
    out.scalars[n].resize(count);
    const auto [file, variable] = variables_.at(scalars[n]).of_piece.at(piece);
    restarts_[file].read(variable, first, out.scalars[n]);
  }
}

void Su2Source::readCells(uint32_t piece, uint64_t first, uint64_t count, std::span<const uint32_t>,
                          MeshCells& out) const {
  zones_.at(piece).mesh.readCells(first, count, out);
  out.scalars.clear();
}

}  // namespace curvisplat
