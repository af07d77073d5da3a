#include "stream/cache/cache_writer.h"

#include <algorithm>
#include <numeric>

#include "stream/base/checksum.h"
#include "stream/base/error.h"
#include "stream/base/file.h"
#include "stream/cache/cache_format.h"
#include "stream/cache/cache_index.h"
#include "stream/cache/partial_folder.h"
#include "stream/cache/stream_file.h"
#include "stream/vdb/brick_grids.h"

namespace curvisplat {
namespace {

/// The indices of `bricks`, by level and then in Morton order; bricks of one cell in the order of appending.
std::vector<uint32_t> indexOrder(const std::vector<Brick>& bricks) {
  std::vector<uint32_t> order(bricks.size());
  std::iota(order.begin(), order.end(), 0u);
  std::stable_sort(order.begin(), order.end(), [&](uint32_t a, uint32_t b) {
    const Cell &cell = bricks[a].cell, &other = bricks[b].cell;
    return cell.level != other.level ? cell.level < other.level : mortonLess(cell, other);
  });
  return order;
}

/// Puts values[order[n]] at n, without a second copy of all.
template <typename T>
void permute(std::vector<T>& values, const std::vector<uint32_t>& order) {
  std::vector<bool> done(values.size());
  for (uint32_t start = 0; start < values.size(); ++start) {
    if (done[start]) continue;
    const T first = values[start];
    uint32_t at = start;
    for (; order[at] != start; at = order[at]) {
      values[at] = values[order[at]];
      done[at] = true;
    }
    values[at] = first;
    done[at] = true;
  }
}

/// Links parents and children of `bricks`, which are in the order of the index. A brick without a parent, or
/// two bricks of one cell that are not leaves, are bugs of the caller of append().
void linkOctree(std::vector<Brick>& bricks) {
  CURVISPLAT_CHECK_OP(bricks.front().cell.level, ==, 0u);
  // The parents of a level's bricks, in order, are in order too: `parent` only ever moves forward.
  uint32_t parent = 0;
  for (uint32_t n = 0; n < bricks.size(); ++n) {
    const Cell& cell = bricks[n].cell;
    if (cell.level == 0) continue;
    while (parent < n && !(bricks[parent].cell == cell.parent())) ++parent;
    CURVISPLAT_CHECK(parent < n && "every brick's parent has been appended");
    Brick& above = bricks[parent];
    if (above.child_count == 0) above.first_child = n;
    ++above.child_count;
    bricks[n].parent = parent;
  }
  for (uint32_t n = 1; n < bricks.size(); ++n)
    if (bricks[n].cell == bricks[n - 1].cell)
      CURVISPLAT_CHECK(bricks[n].isLeaf() && bricks[n - 1].isLeaf() && "only leaves share a cell");
}

}  // namespace

struct CacheWriter::State {
  State(PartialFolder& partial, const RootCube& root_cube, std::vector<VariableInfo> variable_infos)
      : folder(partial),
        root(root_cube),
        variables(std::move(variable_infos)),
        geometry(folder.path() / "geometry.bin", Caching::kPages, OutputFile::Existing::kKeep),
        tables(variables.size()),
        geometry_input(geometry.path()),
        log(folder.path(), variables.size()),
        histograms(root, variables) {
    for (const VariableInfo& variable : variables) {
      values.emplace_back(folder.path() / variableFileName(variable), Caching::kPages,
                          OutputFile::Existing::kKeep);
      values_input.emplace_back(values.back().path());
    }
  }

  void add(AppendedBrick&& appended);
  void resume(Progress& progress);
  bool isWhole(const AppendedBrick& appended) const;
  void keep(uint64_t count);

  // Writes the index, for finish(), once the bricks are in its order.
  FileInfo writeIndex();
  FileInfo writeTable(size_t variable);
  FileInfo writeGrids();
  FileInfo closeGeometry();

  std::unique_ptr<PartialFolder> own_folder;  // null if the caller owns the folder
  PartialFolder& folder;
  RootCube root;
  std::vector<VariableInfo> variables;
  OutputFile geometry;
  std::vector<OutputFile> values;                  // [variable]
  std::vector<Brick> bricks;                       // as appended
  std::vector<double> weights;                     // [brick]
  std::vector<std::vector<BrickVariable>> tables;  // [variable][brick]
  // The geometry, as readBack() reads it. Opened by the constructor, because any number of threads may call
  // readBack().
  InputFile geometry_input;
  std::vector<InputFile> values_input;
  BrickLog log;
  HistogramSums histograms;
};

void CacheWriter::State::add(AppendedBrick&& appended) {
  bricks.push_back(appended.brick);
  weights.push_back(appended.weight);
  for (size_t v = 0; v < variables.size(); ++v) tables[v].push_back(appended.variables[v]);
}

/// Whether the files contain the brick's streams, undamaged.
bool CacheWriter::State::isWhole(const AppendedBrick& appended) const {
  std::vector<std::byte> bytes;
  const auto has = [&](const InputFile& file, const Extent& extent) {
    if (extent.offset > file.size() || extent.length > file.size() - extent.offset) return false;
    bytes.resize(extent.length);
    file.readAt(extent.offset, std::span(bytes));
    return checksumOf(bytes) == extent.checksum;
  };
  if (!has(geometry_input, appended.brick.geometry)) return false;
  for (size_t v = 0; v < variables.size(); ++v)
    if (!has(values_input[v], appended.variables[v].values)) return false;
  return true;
}

void CacheWriter::State::resume(Progress& progress) {
  forEachLogged(folder.path(), variables.size(), [&](AppendedBrick&& appended) {
    if (!isWhole(appended)) return false;
    add(std::move(appended));
    progress.advance(1);
    return true;
  });
  keep(bricks.size());
}

void CacheWriter::State::keep(uint64_t count) {
  CURVISPLAT_CHECK_OP(count, <=, bricks.size());
  const auto endOf = [](const Extent& last) { return last.offset + last.length; };
  bricks.resize(count);
  weights.resize(count);
  log.keep(count);
  geometry.truncate(count > 0 ? endOf(bricks.back().geometry) : 0);
  for (size_t v = 0; v < variables.size(); ++v) {
    tables[v].resize(count);
    values[v].truncate(count > 0 ? endOf(tables[v].back().values) : 0);
    if (count == 0) beginVariableFile(values[v]);
  }
}

CacheWriter::CacheWriter(std::filesystem::path cache, bool overwrite, RootCube root,
                         std::vector<VariableInfo> variables) {
  auto folder = std::make_unique<PartialFolder>(std::move(cache), overwrite);
  state_ = std::make_unique<State>(*folder, root, std::move(variables));
  state_->own_folder = std::move(folder);
  state_->keep(0);
}

CacheWriter::CacheWriter(PartialFolder& folder, RootCube root, std::vector<VariableInfo> variables,
                         Progress& progress)
    : state_(std::make_unique<State>(folder, root, std::move(variables))) {
  // Left behind by an interrupted finish(). Even a complete manifest describes an older state than the one to
  // come.
  for (const auto& entry : std::filesystem::directory_iterator(folder.path()))
    if (entry.path().filename() == "manifest.json" || entry.path().extension() == ".part")
      removeFile(entry.path());
  state_->resume(progress);
}

CacheWriter::~CacheWriter() = default;

std::span<const Brick> CacheWriter::bricks() const {
  return state_->bricks;
}

void CacheWriter::keep(uint64_t count) {
  state_->keep(count);
}

HistogramSums& CacheWriter::histograms() {
  return state_->histograms;
}

uint64_t CacheWriter::append(EncodedBrick&& encoded, float error) {
  State& s = *state_;
  CURVISPLAT_CHECK_OP(encoded.values.size(), ==, s.variables.size());
  AppendedBrick appended{encoded.brick, encoded.weight, std::move(encoded.variables)};
  appended.brick.error = error;
  appended.brick.geometry.offset = appendStream(s.geometry, encoded.geometry);
  for (size_t v = 0; v < encoded.values.size(); ++v)
    appended.variables[v].values.offset = appendStream(s.values[v], encoded.values[v]);
  s.log.append(appended);  // last: the streams that an entry describes are in the files
  s.add(std::move(appended));
  return s.bricks.size() - 1;
}

AppendedBrick CacheWriter::appended(uint64_t id) const {
  const State& s = *state_;
  AppendedBrick brick{s.bricks[id], s.weights[id], {}};
  for (const auto& table : s.tables) brick.variables.push_back(table[id]);
  return brick;
}

void CacheWriter::sync() {
  state_->geometry.sync();
  for (OutputFile& file : state_->values) file.sync();
  state_->log.sync();
}

void CacheWriter::closeStreams() {
  state_->geometry.close();
  for (OutputFile& file : state_->values) file.close();
  state_->log.close();
}

void CacheWriter::reserve(std::vector<AppendedBrick>& bricks) {
  State& s = *state_;
  CURVISPLAT_CHECK_OP(s.bricks.size(), ==, 0u);
  if (bricks.empty()) return;  // finish() reports it
  uint64_t geometry_end = s.geometry.size();
  std::vector<uint64_t> values_ends;
  for (const OutputFile& file : s.values) values_ends.push_back(file.size());
  const auto place = [](Extent& extent, uint64_t& end) {
    extent.offset = streamOffset(end, extent.length);
    end = extent.offset + extent.length;
  };
  for (AppendedBrick& brick : bricks) {
    place(brick.brick.geometry, geometry_end);
    for (size_t v = 0; v < s.variables.size(); ++v) place(brick.variables[v].values, values_ends[v]);
    s.add(AppendedBrick(brick));
  }
  // The last byte makes the file so long; the stream that it belongs to replaces it.
  const std::byte last{0};
  s.geometry.writeAt(geometry_end - 1, std::span(&last, 1));
  for (size_t v = 0; v < s.variables.size(); ++v)
    s.values[v].writeAt(values_ends[v] - 1, std::span(&last, 1));
}

BrickSplats CacheWriter::readBack(uint64_t id) const {
  const State& s = *state_;
  CURVISPLAT_CHECK_OP(id, <, s.bricks.size());
  const Brick& brick = s.bricks[id];
  const auto read = [](const InputFile& file, const Extent& extent) {
    std::vector<std::byte> bytes(extent.length);
    file.readAt(extent.offset, std::span(bytes));
    return bytes;
  };
  const std::vector<std::byte> geometry = read(s.geometry_input, brick.geometry);
  std::vector<BrickVariable> variables;
  std::vector<std::vector<std::byte>> values;
  for (size_t v = 0; v < s.variables.size(); ++v) {
    variables.push_back(s.tables[v][id]);
    values.push_back(read(s.values_input[v], variables.back().values));
  }
  return decodeForMerging(s.root, brick, geometry, variables, values);
}

Manifest CacheWriter::finish(Manifest manifest) {
  State& s = *state_;
  if (s.bricks.empty())
    throw Error("{}: the cache would be empty: no sample can be drawn", s.folder.path().string());
  {
    const std::vector<uint32_t> order = indexOrder(s.bricks);
    permute(s.bricks, order);
    permute(s.weights, order);
    for (std::vector<BrickVariable>& table : s.tables) permute(table, order);
  }
  linkOctree(s.bricks);

  manifest.root = s.root;
  manifest.bricks = s.bricks.size();
  manifest.levels = s.bricks.back().cell.level + 1;
  manifest.splats = 0;
  manifest.volume = 0;
  for (size_t n = 0; n < s.bricks.size(); ++n) {
    if (!s.bricks[n].isLeaf()) continue;
    manifest.splats += s.bricks[n].splats;
    manifest.volume += s.weights[n];
  }
  if (manifest.variables.empty()) manifest.variables = s.variables;
  CURVISPLAT_CHECK_OP(manifest.variables.size(), ==, s.variables.size());
  if (manifest.steps.empty()) manifest.steps.emplace_back();
  manifest.steps.front().variables.clear();
  for (size_t v = 0; v < s.variables.size(); ++v) {
    CURVISPLAT_CHECK_OP(manifest.variables[v].number, ==, s.variables[v].number);
    manifest.steps.front().variables.push_back(s.variables[v].number);
  }

  const std::vector<FileInfo> further = std::move(manifest.files);
  manifest.files = {s.writeIndex()};
  manifest.files.push_back(s.closeGeometry());
  for (size_t v = 0; v < s.variables.size(); ++v) manifest.files.push_back(s.writeTable(v));
  manifest.files.push_back(s.writeGrids());
  manifest.files.insert(manifest.files.end(), further.begin(), further.end());
  writeFileAtomically(s.folder.path() / "manifest.json", manifest.toJson());
  s.folder.putIntoPlace();
  removeFileIfThere(s.folder.target() / kBrickLogName);
  s.folder.removeReplaced();
  return manifest;
}

FileInfo CacheWriter::State::writeIndex() {
  constexpr size_t kAtOnce = (1 << 20) / sizeof(BrickRecord);
  BricksHeader header;
  header.record_bytes = sizeof(BrickRecord);
  header.bricks = bricks.size();
  OutputFile file(folder.path() / "bricks.bin");
  Checksum checksum;
  file.append(bytesOf(header));
  checksum.add(bytesOf(header));
  std::vector<BrickRecord> records;
  for (size_t first = 0; first < bricks.size(); first += records.size()) {
    records.clear();
    for (size_t n = first; n < std::min(first + kAtOnce, bricks.size()); ++n)
      records.push_back(recordOf(bricks[n]));
    file.append(bytesOf(records));
    checksum.add(bytesOf(records));
  }
  FileInfo info{"bricks.bin", file.size(), checksum.value()};
  file.close();
  return info;
}

FileInfo CacheWriter::State::closeGeometry() {
  padToPage(geometry);
  FileInfo info{"geometry.bin", geometry.size(), geometryChecksum(bricks)};
  geometry.close();
  return info;
}

FileInfo CacheWriter::State::writeTable(size_t variable) {
  return finishVariableFile(values[variable], variableFileName(variables[variable]), tables[variable],
                            histograms.of(variable));
}

FileInfo CacheWriter::State::writeGrids() {
  const std::vector<std::byte> bytes = brickGridsFile(root, bricks);
  OutputFile file(folder.path() / "bricks.vdb");
  file.append(std::span(bytes));
  file.close();
  return {"bricks.vdb", bytes.size(), checksumOf(bytes)};
}

}  // namespace curvisplat
