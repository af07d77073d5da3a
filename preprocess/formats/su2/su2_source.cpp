#include "preprocess/formats/su2/su2_source.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <charconv>
#include <filesystem>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "preprocess/formats/common/byte_source.h"
#include "preprocess/formats/common/element_source.h"
#include "preprocess/formats/common/scalar_list.h"
#include "preprocess/formats/common/spool_file.h"
#include "preprocess/formats/common/text_reader.h"
#include "preprocess/formats/su2/su2_mesh.h"
#include "stream/base/error.h"
#include "stream/base/name_list.h"
#include "stream/base/text.h"

namespace curvisplat {
namespace {

constexpr int32_t kMagic = 535532;
constexpr size_t kNameBytes = 33, kHeadBytes = 5 * sizeof(int32_t);
constexpr int32_t kMaxVariables = 10'000;

/// The fields of a line: separated by commas, or by tabs and spaces; quotes are left out.
std::vector<std::string_view> fieldsOf(std::string_view line) {
  const bool commas = line.find(',') != std::string_view::npos;
  const std::string_view separators = commas ? "," : " \t";
  std::vector<std::string_view> fields;
  for (size_t at = 0; at < line.size();) {
    const size_t quote = line.find_first_not_of(kWhiteSpace, at);
    const bool quoted = quote != std::string_view::npos && line[quote] == '"';
    const size_t closing = quoted ? std::min(line.find('"', quote + 1), line.size()) : at;
    const size_t end = std::min(line.find_first_of(separators, closing), line.size());
    const std::string_view field =
        trimmed(quoted ? line.substr(quote + 1, closing - quote - 1) : line.substr(at, end - at));
    if (!field.empty()) fields.push_back(field);
    at = end + 1;
  }
  return fields;
}

/// A restart or solution file: values at the points of a mesh, in their order. Any number of threads may
/// read.
///
///    ASCII     "PointID","x","y","z","Density",...       one line a point; commas (.csv) or tabs (.dat)
///    binary    int32: 535532, variables, points, ., .    names of 33 bytes; doubles, point by point
class Su2Restart {
 public:
  /// An ASCII file goes to a spool file. Throws Error if it is damaged, or does not have `points` points.
  Su2Restart(std::shared_ptr<const PooledFile> file, uint64_t points,
             const std::shared_ptr<SpoolFile>& spool);

  /// The names of the file's variables, without the point's number and position.
  const std::vector<std::string>& names() const { return names_; }
  bool binary() const { return binary_; }
  /// Values of points [first, first + to.size()).
  void read(size_t variable, uint64_t first, std::span<float> to) const;

 private:
  void openBinary(uint64_t points);
  void readText(uint64_t points, const std::shared_ptr<SpoolFile>& spool);
  void keepNames(const std::vector<std::string>& all);

  std::shared_ptr<const PooledFile> file_;
  bool binary_ = false, swap_ = false;
  uint64_t data_ = 0;  // offset of the doubles of a binary file
  size_t stride_ = 0;  // doubles a point
  std::vector<std::string> names_;
  std::vector<size_t> columns_;  // [names_]
  SpooledNumbers text_;
};

Su2Restart::Su2Restart(std::shared_ptr<const PooledFile> file, uint64_t points,
                       const std::shared_ptr<SpoolFile>& spool)
    : file_(std::move(file)) {
  std::array<std::byte, sizeof(int32_t)> begin{};
  if (file_->size() >= begin.size()) file_->readAt(0, begin);
  swap_ = loadStored<int32_t>(begin.data(), true) == kMagic;
  binary_ = swap_ || loadStored<int32_t>(begin.data(), false) == kMagic;
  binary_ ? openBinary(points) : readText(points, spool);
  if (names_.empty()) throw Error("{}: has no variables besides positions", file_->name());
}

void Su2Restart::keepNames(const std::vector<std::string>& all) {
  stride_ = all.size();
  for (size_t n = 0; n < all.size(); ++n) {
    const std::string& name = all[n];
    if (name.empty() || name == "PointID" || name == "x" || name == "y" || name == "z") continue;
    names_.push_back(printable(name));
    columns_.push_back(n);
  }
}

void Su2Restart::openBinary(uint64_t points) {
  if (file_->size() < kHeadBytes)
    throw Error("{}: is truncated (found {} bytes)", file_->name(), file_->size());
  std::array<std::byte, kHeadBytes> head{};
  file_->readAt(0, head);
  const auto variables = loadStored<int32_t>(head.data() + 4, swap_);
  const auto stored = loadStored<int32_t>(head.data() + 8, swap_);
  if (variables < 1 || variables > kMaxVariables || stored < 0 || static_cast<uint64_t>(stored) != points)
    throw Error("{}: has {} variables at {} points; expected some at {}, the mesh's", file_->name(),
                variables, stored, points);
  const auto count = static_cast<size_t>(variables);
  data_ = kHeadBytes + count * kNameBytes;
  if (file_->size() < data_ || (file_->size() - data_) / sizeof(double) / count < points)
    throw Error("{}: is truncated (found {} bytes, expected {} variables at {} points)", file_->name(),
                file_->size(), variables, points);
  std::vector<char> text(count * kNameBytes);
  file_->readAt(kHeadBytes, std::as_writable_bytes(std::span(text)));
  std::vector<std::string> names;
  for (size_t n = 0; n < count; ++n) {
    const std::string name(text.data() + n * kNameBytes, kNameBytes);
    names.push_back(name.substr(0, name.find('\0')));
  }
  keepNames(names);
}

void Su2Restart::readText(uint64_t points, const std::shared_ptr<SpoolFile>& spool) {
  TextReader text(file_, 0, file_->size());
  const auto header = text.line();
  std::vector<std::string> names;
  if (header)
    for (const std::string_view field : fieldsOf(*header)) names.emplace_back(field);
  if (names.size() < 2 || std::any_of(names.begin(), names.end(), [](const std::string& name) {
        double number = 0;
        return parseNumber(name, number);
      }))
    throw Error("{}: is not a restart file of SU2; expected the variables' names, or the number 535532",
                file_->name());
  keepNames(names);
  NumberSpool<double> values(spool);
  for (uint64_t point = 0; point < points; ++point) {
    const auto line = text.line();
    if (!line) throw Error("{}: has {} points; expected {}, the mesh's", file_->name(), point, points);
    const std::vector<std::string_view> fields = fieldsOf(*line);
    double value = 0;
    for (size_t n = 0; n < stride_; ++n) {
      if (n >= fields.size() || !parseNumber(fields[n], value))
        throw Error("{}: line {} has {} fields, or one that is not a number; expected {} numbers",
                    file_->name(), point + 2, fields.size(), stride_);
      if (names[n] == "PointID" && value != static_cast<double>(point))
        throw Error("{}: line {} is of point {}; expected {}: points in the mesh's order", file_->name(),
                    point + 2, value, point);
      values.add(value);
    }
  }
  const auto behind = text.line();
  if (behind && fieldsOf(*behind).size() == stride_)
    throw Error("{}: has more than {} points, the mesh's", file_->name(), points);
  text_ = values.finish();
}

void Su2Restart::read(size_t variable, uint64_t first, std::span<float> to) const {
  constexpr uint64_t kPointsAtOnce = 4096;
  std::vector<double> values;
  for (uint64_t done = 0; done < to.size(); done += kPointsAtOnce) {
    const uint64_t count = std::min(kPointsAtOnce, to.size() - done);
    values.resize(count * stride_);
    if (binary_) {
      file_->readAt(data_ + (first + done) * stride_ * sizeof(double),
                    std::as_writable_bytes(std::span(values)));
      if (swap_)
        for (double& value : values) value = loadStored<double>(reinterpret_cast<std::byte*>(&value), true);
    } else {
      text_.read((first + done) * stride_, std::span(values));
    }
    for (uint64_t n = 0; n < count; ++n)
      to[done + n] = convertedTo<float>(values[n * stride_ + columns_[variable]]);
  }
}

constexpr uint64_t kLooked = 4096;

/// The first two lines that are neither empty nor comments, without the white space around them; empty
/// where the beginning has none.
std::array<std::string, 2> firstLinesOf(const InputFile& file) {
  const std::string begin = beginningOf(file, kLooked);
  std::array<std::string, 2> lines;
  size_t found = 0;
  for (size_t at = 0; at < begin.size() && found < lines.size();) {
    const size_t end = std::min(begin.find('\n', at), begin.size());
    const std::string_view line = trimmed(std::string_view(begin).substr(at, end - at));
    at = end + 1;
    if (!line.empty() && line[0] != '%') lines[found++] = line;
  }
  return lines;
}

/// The text after "KEY =" in the line; nullopt if it has another key.
std::optional<std::string_view> valueOf(std::string_view line, std::string_view key) {
  if (!line.starts_with(key)) return std::nullopt;
  line = trimmed(line.substr(key.size()));
  if (!line.starts_with('=')) return std::nullopt;
  return trimmed(line.substr(1));
}

/// How many points a restart file has: as its head says, or as many lines as have as many fields as the first.
uint64_t pointsOf(const std::shared_ptr<const PooledFile>& file) {
  std::array<std::byte, kHeadBytes> head{};
  if (file->size() >= head.size()) file->readAt(0, head);
  for (const bool swap : {false, true})
    if (loadStored<int32_t>(head.data(), swap) == kMagic)
      return static_cast<uint64_t>(std::max(loadStored<int32_t>(head.data() + 8, swap), 0));
  TextReader text(file, 0, file->size());
  const auto header = text.line();
  const size_t fields = header ? fieldsOf(*header).size() : 0;
  uint64_t points = 0;
  for (auto line = text.line(); line && fieldsOf(*line).size() == fields; line = text.line()) ++points;
  return points;
}

class Su2Source final : public ElementSource {
 public:
  explicit Su2Source(const OpenGridOptions& options);

 private:
  /// Names the place of a piece's values.
  struct Place {
    size_t file = 0, variable = 0;
    uint64_t first = 0;  // the number of the piece's first point in the file
  };

  void chooseZones(const OpenGridOptions& options, const std::shared_ptr<OpenFiles>& pool);
  void openRestarts(const OpenGridOptions& options, const std::shared_ptr<OpenFiles>& pool);
  void addVariables(size_t file, ScalarList& list);
  void addSharedVariables(ScalarList& list);
  void readPlaces(uint32_t piece, uint64_t first, uint64_t count, const Places& to) const override {
    zones_.at(piece).mesh.readPoints(first, count, to);
  }
  void appendCells(uint32_t piece, uint64_t first, uint64_t count, MeshCells& out) const override {
    zones_.at(piece).mesh.appendCells(first, count, out);
  }
  void readValues(uint32_t piece, uint32_t scalar, uint64_t first, std::span<float> to) const override {
    const Place& place = variables_.at(scalar).at(piece);
    restarts_[place.file].read(place.variable, place.first + first, to);
  }

  std::vector<Su2Zone> zones_;
  std::vector<size_t> numbers_;  // of zones_ in the file, from 1
  std::vector<Su2Restart> restarts_;
  std::vector<std::vector<Place>> variables_;  // [description_.scalars][zones_]
};

Su2Source::Su2Source(const OpenGridOptions& options) {
  const auto pool = std::make_shared<OpenFiles>();
  const auto file = std::make_shared<const PooledFile>(pool, options.grid);
  zones_ = readSu2Mesh(file, options.temporary_folder);
  description_.files.push_back(file->name());
  description_.coordinate_bytes = 8;
  description_.format = fmt::format("SU2 mesh, {}", countText(zones_.size(), "zone"));
  for (size_t n = 1; n <= zones_.size(); ++n) numbers_.push_back(n);
  chooseZones(options, pool);
  std::vector<std::string> markers;
  for (size_t n = 0; n < zones_.size(); ++n) {
    const SpooledMesh& mesh = zones_[n].mesh;
    description_.pieces.push_back(
        {fmt::format("zone {}", numbers_[n]), file->name(), mesh.points(), mesh.cells()});
    markers.insert(markers.end(), zones_[n].markers.begin(), zones_[n].markers.end());
  }
  if (!markers.empty()) description_.notes.push_back("boundaries: " + listed(markers));
  openRestarts(options, pool);
}

/// Keeps the one zone whose points a single restart file has, unless it has those of all zones.
void Su2Source::chooseZones(const OpenGridOptions& options, const std::shared_ptr<OpenFiles>& pool) {
  if (zones_.size() == 1 || options.solutions.size() != 1) return;
  const uint64_t points = pointsOf(std::make_shared<const PooledFile>(pool, options.solutions.front()));
  uint64_t all = 0;
  std::vector<size_t> fitting;
  std::vector<std::string> others;
  for (size_t n = 0; n < zones_.size(); ++n) {
    const uint64_t of_zone = zones_[n].mesh.points();
    all += of_zone;
    if (of_zone == points)
      fitting.push_back(n);
    else
      others.push_back(fmt::format("zone {} ({})", n + 1, countText(of_zone, "point")));
  }
  if (points == all) return;
  if (fitting.size() != 1)
    throw Error(
        "{}: has {} zones, but 1 restart files are given, with {}, which is neither that of one zone alone "
        "nor "
        "of all ({}); give one for each zone, in their order",
        options.grid.string(), zones_.size(), countText(points, "point"), all);
  description_.warnings.push_back(fmt::format("left out: {}: {} has the points of zone {} alone",
                                              listed(others), options.solutions.front().string(),
                                              fitting[0] + 1));
  zones_ = {std::move(zones_[fitting[0]])};
  numbers_ = {fitting[0] + 1};
}

void Su2Source::openRestarts(const OpenGridOptions& options, const std::shared_ptr<OpenFiles>& pool) {
  const std::vector<std::filesystem::path>& files = options.solutions;
  if (files.empty()) return;
  const bool several = zones_.size() > 1 && files.size() > 1;
  if (several && files.size() != zones_.size())
    throw Error("{}: has {} zones, but {} restart files are given; give one for each, in their order",
                options.grid.string(), zones_.size(), files.size());
  uint64_t all = 0;
  for (const Su2Zone& zone : zones_) all += zone.mesh.points();
  const auto spool = std::make_shared<SpoolFile>(options.temporary_folder);
  ScalarList list(description_);
  for (size_t n = 0; n < files.size(); ++n) {
    restarts_.emplace_back(std::make_shared<const PooledFile>(pool, files[n]),
                           several ? zones_[n].mesh.points() : all, spool);
    description_.files.push_back(files[n].string());
    if (several)
      description_.notes.push_back(fmt::format("zone {} has the values of {}", n + 1, files[n].string()));
    else
      addVariables(n, list);
  }
  if (several) addSharedVariables(list);
  description_.format += restarts_.front().binary() ? " + binary restart" : " + ASCII restart";
}

/// Adds the variables of a file that has the points of all zones.
void Su2Source::addVariables(size_t file, ScalarList& list) {
  const std::vector<std::string>& names = restarts_[file].names();
  for (size_t v = 0; v < names.size(); ++v) {
    list.add({names[v], fmt::format("{}:{}", names[v], file + 1)}, Centring::kNode);
    std::vector<Place>& places = variables_.emplace_back();
    uint64_t first = 0;
    for (const Su2Zone& zone : zones_) {
      places.push_back({file, v, first});
      first += zone.mesh.points();
    }
  }
}

/// Adds the variables that the files of all zones have, and warns of the others.
void Su2Source::addSharedVariables(ScalarList& list) {
  std::vector<std::string> seen, partial;
  for (const Su2Restart& restart : restarts_)
    for (const std::string& name : restart.names()) {
      if (std::find(seen.begin(), seen.end(), name) != seen.end()) continue;
      seen.push_back(name);
      std::vector<Place> places;
      for (size_t n = 0; n < restarts_.size(); ++n) {
        const std::vector<std::string>& names = restarts_[n].names();
        const auto found = std::find(names.begin(), names.end(), name);
        if (found != names.end()) places.push_back({n, static_cast<size_t>(found - names.begin()), 0});
      }
      if (places.size() < restarts_.size()) {
        partial.push_back(name);
        continue;
      }
      list.add({name}, Centring::kNode);
      variables_.push_back(std::move(places));
    }
  if (variables_.empty())
    throw Error("{}: its zones share no variable (found {}); give the restart file of one zone alone",
                description_.files.front(), listed(partial));
  if (!partial.empty())
    description_.warnings.push_back(fmt::format(
        "left out: {}: not in all of the zones; give the restart file of one zone alone", listed(partial)));
}

}  // namespace

bool isSu2(const InputFile& file) {
  const std::string line = firstLinesOf(file)[0];
  return valueOf(line, "NDIME") || valueOf(line, "NZONE");
}

uint64_t su2Zones(const InputFile& file) {
  uint64_t zones = 1;
  for (const std::string& line : firstLinesOf(file))
    if (const auto value = valueOf(line, "NZONE"))
      std::from_chars(value->data(), value->data() + value->size(), zones);
  return zones;
}

std::unique_ptr<DataSource> openSu2(const OpenGridOptions& options) {
  return std::make_unique<Su2Source>(options);
}

}  // namespace curvisplat
