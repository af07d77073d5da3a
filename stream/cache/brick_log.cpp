#include "stream/cache/brick_log.h"

#include <algorithm>
#include <cstring>
#include <span>

#include "stream/base/checksum.h"
#include "stream/cache/cache_format.h"

namespace curvisplat {
namespace {

constexpr uint64_t kReadBytes = uint64_t{1} << 20;

size_t entryBytes(size_t variables) {
  return sizeof(BrickRecord) + sizeof(double) + variables * sizeof(VariableRecord) + sizeof(uint64_t);
}

template <typename T>
void put(const T& value, std::vector<std::byte>& out) {
  const size_t begin = out.size();
  out.resize(begin + sizeof value);
  std::memcpy(&out[begin], &value, sizeof value);
}

template <typename T>
T take(const std::byte*& at) {
  T value;
  std::memcpy(&value, at, sizeof value);
  at += sizeof value;
  return value;
}

}  // namespace

void forEachLogged(const std::filesystem::path& folder, size_t variables,
                   const std::function<bool(AppendedBrick&&)>& use) {
  if (!std::filesystem::exists(folder / kBrickLogName)) return;
  const InputFile file(folder / kBrickLogName);
  const size_t entry_bytes = entryBytes(variables);
  const uint64_t entries = file.size() / entry_bytes, at_once = kReadBytes / entry_bytes + 1;
  std::vector<std::byte> buffer;
  for (uint64_t first = 0; first < entries; first += at_once) {
    buffer.resize(std::min(at_once, entries - first) * entry_bytes);
    file.readAt(first * entry_bytes, std::span(buffer));
    for (size_t begin = 0; begin < buffer.size(); begin += entry_bytes) {
      const auto entry = std::span<const std::byte>(buffer).subspan(begin, entry_bytes);
      const std::byte* at = entry.data();
      AppendedBrick brick;
      brick.brick = brickOf(take<BrickRecord>(at));
      brick.weight = take<double>(at);
      for (size_t v = 0; v < variables; ++v)
        brick.variables.push_back(brickVariableOf(take<VariableRecord>(at)));
      if (take<uint64_t>(at) != checksumOf(entry.first(entry_bytes - sizeof(uint64_t)))) return;
      if (!use(std::move(brick))) return;
    }
  }
}

std::vector<AppendedBrick> readBrickLog(const std::filesystem::path& folder, size_t variables) {
  std::vector<AppendedBrick> bricks;
  forEachLogged(folder, variables, [&](AppendedBrick&& brick) {
    bricks.push_back(std::move(brick));
    return true;
  });
  return bricks;
}

BrickLog::BrickLog(const std::filesystem::path& folder, size_t variables)
    : variables_(variables), file_(folder / kBrickLogName, Caching::kPages, OutputFile::Existing::kKeep) {}

void BrickLog::append(const AppendedBrick& brick) {
  entry_.clear();
  put(recordOf(brick.brick), entry_);
  put(brick.weight, entry_);
  for (const BrickVariable& variable : brick.variables) put(recordOf(variable), entry_);
  put(checksumOf(entry_), entry_);
  file_.append(std::span<const std::byte>(entry_));
}

void BrickLog::keep(uint64_t count) {
  file_.truncate(count * entryBytes(variables_));
}

}  // namespace curvisplat
