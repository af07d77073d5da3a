#include "preprocess/formats/netcdf/zarr_file.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <utility>

#include "preprocess/formats/common/byte_source.h"
#include "preprocess/formats/netcdf/netcdf_library.h"
#include "preprocess/formats/netcdf/zarr_codecs.h"
#include "stream/base/error.h"

namespace curvisplat {
namespace {

namespace fs = std::filesystem;

constexpr size_t kCacheBytes = size_t{2} << 20;
constexpr uint64_t kMaxTextBytes = 16 << 20, kMaxStrings = 1 << 16;

double numberOfHalf(uint16_t bits) {
  const int exponent = bits >> 10 & 0x1f;
  const double fraction = (bits & 0x3ff) / 1024.0;
  double value = exponent == 0 ? std::ldexp(fraction, -14) : std::ldexp(1 + fraction, exponent - 15);
  if (exponent == 0x1f)
    value =
        fraction == 0 ? std::numeric_limits<double>::infinity() : std::numeric_limits<double>::quiet_NaN();
  return bits & 0x8000 ? -value : value;
}

template <typename Stored, typename Value>
void convertRun(const std::byte* from, size_t stride, bool swap, std::span<Value> to) {
  if (stride == sizeof(Stored)) return convertStored<Stored>(from, to.size(), swap, to.data());
  for (size_t n = 0; n < to.size(); ++n)
    to[n] = convertedTo<Value>(loadStored<Stored>(from + n * stride, swap));
}

template <typename Value>
void convertNumbers(const ZarrArray& array, const std::byte* from, size_t stride, std::span<Value> to) {
  const bool swap = array.big_endian != (kMachineByteOrder == ByteOrder::kBig);
  switch (array.number) {
    case ZarrNumber::kInt8:
      return convertRun<int8_t>(from, stride, swap, to);
    case ZarrNumber::kUint8:
      return convertRun<uint8_t>(from, stride, swap, to);
    case ZarrNumber::kInt16:
      return convertRun<int16_t>(from, stride, swap, to);
    case ZarrNumber::kUint16:
      return convertRun<uint16_t>(from, stride, swap, to);
    case ZarrNumber::kInt32:
      return convertRun<int32_t>(from, stride, swap, to);
    case ZarrNumber::kUint32:
      return convertRun<uint32_t>(from, stride, swap, to);
    case ZarrNumber::kInt64:
      return convertRun<int64_t>(from, stride, swap, to);
    case ZarrNumber::kUint64:
      return convertRun<uint64_t>(from, stride, swap, to);
    case ZarrNumber::kFloat:
      return convertRun<float>(from, stride, swap, to);
    case ZarrNumber::kDouble:
      return convertRun<double>(from, stride, swap, to);
    case ZarrNumber::kHalf:
      for (size_t n = 0; n < to.size(); ++n)
        to[n] = static_cast<Value>(numberOfHalf(loadStored<uint16_t>(from + n * stride, swap)));
      return;
    case ZarrNumber::kNone:
      break;
  }
}

/// The name of a chunk's file: "NAME/0.1.2", "NAME/c/0/1/2". An array without axes has one chunk, "0" or "c".
std::string keyOf(const ZarrArray& array, const std::vector<uint64_t>& at) {
  std::string key = array.prefix;
  for (const uint64_t n : at) key += fmt::format("{}{}", key.empty() ? "" : array.separator, n);
  return array.name + '/' + (key.empty() ? "0" : key);
}

/// Steps an index within `count`, the last axis fastest; false after the last one.
bool stepped(std::vector<uint64_t>& at, const std::vector<uint64_t>& first, const std::vector<uint64_t>& end,
             size_t axes) {
  for (size_t axis = axes; axis-- > 0;) {
    if (++at[axis] < end[axis]) return true;
    at[axis] = first[axis];
  }
  return false;
}

std::string withoutZeros(std::string text) {
  text.resize(std::min(text.size(), text.find('\0')));
  return text;
}

std::string utf8Of(const std::byte* from, size_t characters, bool swap) {
  std::string text;
  for (size_t n = 0; n < characters; ++n) {
    const auto code = loadStored<uint32_t>(from + 4 * n, swap);
    const auto tail = [&](int shift) { text += static_cast<char>(0x80 | (code >> shift & 0x3f)); };
    if (code == 0) break;
    if (code < 0x80) {
      text += static_cast<char>(code);
    } else if (code < 0x800) {
      text += static_cast<char>(0xc0 | code >> 6);
      tail(0);
    } else {
      text += static_cast<char>(0xe0 | (code >> 12 & 0xf));
      tail(6);
      tail(0);
    }
  }
  return text;
}

/// Decodes strings of variable length: their number, then each string after its number of bytes.
std::vector<std::string> stringsIn(const std::vector<std::byte>& bytes, const std::string& place) {
  const auto countAt = [&](size_t at) -> size_t {
    if (at > bytes.size() || bytes.size() - at < 4)
      throw Error("{}: its strings end early; it is damaged: write it again", place);
    return loadStored<uint32_t>(&bytes[at], kMachineByteOrder == ByteOrder::kBig);
  };
  std::vector<std::string> strings;
  size_t at = 4;
  for (size_t count = countAt(0); strings.size() < std::min<size_t>(count, kMaxStrings);) {
    const size_t length = countAt(at);
    at += 4;
    if (length > bytes.size() - at)
      throw Error("{}: its strings end early; it is damaged: write it again", place);
    strings.emplace_back(reinterpret_cast<const char*>(bytes.data()) + at, length);
    at += length;
  }
  return strings;
}

}  // namespace

bool isZarrStore(const fs::path& path) {
  std::error_code error;
  for (const char* mark : {".zgroup", ".zmetadata", "zarr.json", ".zarray"})
    if (fs::is_regular_file(path / mark, error)) return true;
  const std::string ending = extensionOf(path);
  if ((ending != ".zip" && ending != ".zarr") || !isRegularFile(path)) return false;
  try {
    if (!isZip(InputFile(path))) return false;
    const ZarrStore store(path);
    return store.find("zarr.json") || store.find(".zgroup");
  } catch (const Error&) {
    return true;  // opening it tells why
  }
}

ZarrFile::ZarrFile(const fs::path& path) : NetcdfFile(path, NotOpened{}), store_(path) {
  const auto textOf = [&](const std::string& key) {
    const auto value = store_.find(key);
    return value ? value->text() : "";
  };
  const bool version3 = store_.find("zarr.json").has_value();
  kind_ = version3 ? "Zarr, version 3" : "Zarr, version 2";
  if (version3) {
    const ZarrNode root = zarrNode3("", textOf("zarr.json"), store_.nameOf("zarr.json"));
    of_file_.attributes = root.attributes;
    if (root.array)
      throw Error("{}: is an array of a Zarr store; give the store (the folder around it) instead",
                  path.string());
  } else {
    if (store_.find(".zarray"))
      throw Error("{}: is an array of a Zarr store; give the store (the folder around it) instead",
                  path.string());
    if (store_.find(".zattrs"))
      of_file_.attributes = zarrAttributes(textOf(".zattrs"), store_.nameOf(".zattrs"));
  }
  for (const std::string& name : store_.folders()) {
    if (version3) {
      const std::string file = name + "/zarr.json";
      const std::string text = textOf(file);
      if (text.empty()) continue;
      if (auto node = zarrNode3(name, text, store_.nameOf(file)); node.array)
        addArray(std::move(*node.array));
      else
        groups_.push_back(name);
    } else if (store_.find(name + "/.zgroup")) {
      groups_.push_back(name);
    } else if (store_.find(name + "/.zarray")) {
      addArray(zarrArray2(name, textOf(name + "/.zarray"), textOf(name + "/.zattrs"),
                          store_.nameOf(name + "/.zarray")));
    }
  }
  const MutexLock lock(mutex_);
  caches_.resize(arrays_.size());
}

/// The dimension of an axis by its name, which is added if it is new. Axes without one are told apart by their length.
size_t ZarrFile::dimensionOf(const ZarrArray& array, size_t axis) {
  std::string name = array.dimensions[axis];
  const uint64_t length = array.shape[axis];
  if (name.empty()) {
    const auto before =
        std::count(array.shape.begin(), array.shape.begin() + static_cast<ptrdiff_t>(axis), length);
    name = fmt::format("of {}{}", length, before > 0 ? fmt::format(", {}", before + 1) : "");
  }
  for (size_t n = 0; n < dimensions_.size(); ++n) {
    if (dimensions_[n].name != name) continue;
    if (dimensions_[n].length != length)
      throw Error(
          "{}: has {} values along {}; expected {}, as other arrays have; the store is damaged or still "
          "being written",
          store_.nameOf(array.name), length, name, dimensions_[n].length);
    return n;
  }
  dimensions_.push_back({name, length, false});
  return dimensions_.size() - 1;
}

/// Refuses an array that declares many more bytes than its chunks can hold: a few bytes of metadata may
/// declare any size.
void ZarrFile::requirePossible(const ZarrArray& array) const {
  constexpr double kMaxCompression = 40000, kSmall = 64 << 20;
  auto bytes = static_cast<double>(std::max<size_t>(1, array.value_bytes));
  for (const uint64_t length : array.shape) bytes *= static_cast<double>(length);
  if (bytes > kSmall && !store_.hasBytes(array.name, bytes / kMaxCompression))
    throw Error(
        "{}: declares {:.0f} bytes, but has next to no chunks; copy the store again, or remove the array if "
        "it is empty",
        store_.nameOf(array.name), bytes);
}

void ZarrFile::addArray(ZarrArray array) {
  requirePossible(array);
  NetcdfVariable variable;
  variable.name = array.name;
  variable.type = array.type();
  variable.value_bytes = netcdfBytes(variable.type);
  variable.numeric = variable.value_bytes > 0;
  for (size_t axis = 0; axis < array.shape.size(); ++axis) variable.dims.push_back(dimensionOf(array, axis));
  if (array.text == ZarrArray::Text::kBytes) {  // as NetCDF has strings: their characters are a dimension
    const std::string name = fmt::format("string{}", array.value_bytes);
    const auto same = std::find_if(dimensions_.begin(), dimensions_.end(),
                                   [&](const NetcdfDimension& one) { return one.name == name; });
    variable.dims.push_back(static_cast<size_t>(same - dimensions_.begin()));
    if (same == dimensions_.end()) dimensions_.push_back({name, array.value_bytes, false});
  }
  for (const auto& [name, attribute] : array.attributes) variable.add(name, attribute);
  addVariable(std::move(variable));
  arrays_.push_back(std::move(array));
}

void ZarrFile::release() const {
  const MutexLock lock(mutex_);
  for (Cache& cache : caches_) cache = {};
}

std::shared_ptr<const ZarrFile::Bytes> ZarrFile::loaded(const ZarrArray& array,
                                                        const std::vector<uint64_t>& at) const {
  std::vector<uint64_t> shard(at);
  uint64_t in_shard = 0;
  for (size_t axis = 0; axis < at.size(); ++axis) {
    shard[axis] = at[axis] / array.shards[axis];
    in_shard = in_shard * array.shards[axis] + at[axis] % array.shards[axis];
  }
  const std::string key = keyOf(array, shard);
  const auto value = store_.find(key);
  if (!value) return nullptr;
  std::string place = store_.nameOf(key);
  uint64_t first = 0, count = value->size;
  if (array.sharded) {
    // The index of a shard has the offset and the size of each chunk, all ones for a chunk that was not
    // written.
    constexpr uint64_t kEntry = 16, kNone = UINT64_MAX;
    const uint64_t index_bytes = kEntry * array.chunksInShard() + (array.index_checked ? 4 : 0);
    if (value->size < index_bytes)
      throw Error("{}: is truncated (found {} bytes, expected an index of {}); copy or write it again", place,
                  value->size, index_bytes);
    const Bytes entry =
        value->read((array.index_first ? 0 : value->size - index_bytes) + kEntry * in_shard, kEntry);
    constexpr bool kSwap = kMachineByteOrder == ByteOrder::kBig;
    first = loadStored<uint64_t>(entry.data(), kSwap);
    count = loadStored<uint64_t>(&entry[8], kSwap);
    if (first == kNone && count == kNone) return nullptr;
    if (first > value->size || count > value->size - first)
      throw Error("{}: has a chunk behind its end; it is truncated or damaged: copy or write it again",
                  place);
    place += fmt::format(", chunk {}", in_shard);
  }
  return std::make_shared<const Bytes>(decodedZarr(array, value->read(first, count), place));
}

std::shared_ptr<const ZarrFile::Bytes> ZarrFile::chunkAt(size_t number,
                                                         const std::vector<uint64_t>& at) const {
  Cache& cache = caches_.at(number);
  const auto found = std::find_if(cache.chunks.begin(), cache.chunks.end(),
                                  [&](const Chunk& chunk) { return chunk.at == at; });
  if (found != cache.chunks.end()) {
    cache.chunks.splice(cache.chunks.begin(), cache.chunks, found);
    return found->bytes;
  }
  // A chunk of values of variable length counts as the most that it may take, small ones as more than their values: the list is
  // searched from its beginning. What is missing is not listed, since a few bytes of metadata may declare any number of chunks.
  constexpr size_t kEntryBytes = 1024;
  const ZarrArray& array = arrays_[number];
  const size_t bytes = kEntryBytes + (array.value_bytes == 0 ? kMaxTextBytes : array.chunkBytes());
  while (!cache.chunks.empty() && cache.bytes + bytes > kCacheBytes) {
    cache.bytes -= bytes;
    cache.chunks.pop_back();
  }
  std::shared_ptr<const Bytes> chunk = loaded(array, at);
  if (!chunk) return nullptr;
  cache.bytes += bytes;
  cache.chunks.push_front({at, chunk});
  return chunk;
}

void ZarrFile::forEachRun(size_t number, const NetcdfBox& box, const UseRun& use) const {
  const ZarrArray& array = arrays_.at(number);
  if (!array.refused.empty()) throw Error("{}: {}", store_.nameOf(array.name), array.refused);
  const size_t rank = array.shape.size();
  if (box.values() == 0) return;
  std::vector<size_t> stride(rank);  // [axis]: in a chunk, in bytes
  size_t bytes = array.value_bytes;
  for (size_t n = rank; n-- > 0; bytes *= array.chunks[array.stored_axes[n]])
    stride[array.stored_axes[n]] = bytes;
  std::vector<uint64_t> first(rank), end(rank);  // in chunks
  for (size_t axis = 0; axis < rank; ++axis) {
    first[axis] = box.start[axis] / array.chunks[axis];
    end[axis] = (box.start[axis] + box.count[axis] - 1) / array.chunks[axis] + 1;
  }
  const MutexLock lock(mutex_);
  std::vector<uint64_t> at = first;
  do {
    const std::shared_ptr<const Bytes> chunk = chunkAt(number, at);
    std::vector<uint64_t> from(rank), to(rank);  // what the box has of the chunk
    for (size_t axis = 0; axis < rank; ++axis) {
      from[axis] = std::max<uint64_t>(box.start[axis], at[axis] * array.chunks[axis]);
      to[axis] = std::min<uint64_t>(box.start[axis] + box.count[axis], (at[axis] + 1) * array.chunks[axis]);
    }
    std::vector<uint64_t> row = from;
    do {
      size_t stored = 0, place = 0;
      for (size_t axis = 0; axis < rank; ++axis) {
        stored += (row[axis] - at[axis] * array.chunks[axis]) * stride[axis];
        place = place * box.count[axis] + (row[axis] - box.start[axis]);
      }
      use(chunk ? chunk->data() + stored : nullptr, rank > 0 ? stride[rank - 1] : array.value_bytes,
          rank > 0 ? to[rank - 1] - from[rank - 1] : 1, place);
    } while (rank > 0 && stepped(row, from, to, rank - 1));
  } while (stepped(at, first, end, rank));
}

template <typename Value>
void ZarrFile::readNumbers(const NetcdfVariable& variable, const NetcdfBox& box, std::span<Value> to) const {
  const ZarrArray& array = arrays_.at(variable.position);
  std::vector<double> scaled;
  forEachRun(variable.position, box, [&](const std::byte* from, size_t stride, size_t count, size_t place) {
    const std::span<Value> run = to.subspan(place, count);
    if (!from) return std::fill(run.begin(), run.end(), static_cast<Value>(array.fill));
    if (array.scale == 1 && array.offset == 0) return convertNumbers(array, from, stride, run);
    scaled.resize(count);
    convertNumbers(array, from, stride, std::span(scaled));
    std::transform(scaled.begin(), scaled.end(), run.begin(),
                   [&](double stored) { return convertedTo<Value>(stored / array.scale + array.offset); });
  });
}

void ZarrFile::readStored(const NetcdfVariable& variable, const NetcdfBox& box, std::span<double> to) const {
  readNumbers(variable, box, to);
}

void ZarrFile::readStored(const NetcdfVariable& variable, const NetcdfBox& box, std::span<float> to) const {
  readNumbers(variable, box, to);
}

NetcdfBox ZarrFile::allOf(const ZarrArray& array) const {
  return {std::vector<size_t>(array.shape.size(), 0), {array.shape.begin(), array.shape.end()}};
}

std::string ZarrFile::readText(const NetcdfVariable& variable) const {
  const ZarrArray& array = arrays_.at(variable.position);
  const NetcdfBox all = allOf(array);
  if (array.text != ZarrArray::Text::kBytes || all.values() > kMaxTextBytes / array.value_bytes) return "";
  const size_t bytes = array.value_bytes;
  std::string text(all.values() * bytes, '\0');
  forEachRun(variable.position, all, [&](const std::byte* from, size_t stride, size_t count, size_t place) {
    for (size_t n = 0; from && n < count; ++n)
      text.replace((place + n) * bytes, bytes, reinterpret_cast<const char*>(from) + n * stride, bytes);
  });
  return text;
}

std::vector<std::string> ZarrFile::readStrings(const NetcdfVariable& variable) const {
  const ZarrArray& array = arrays_.at(variable.position);
  const NetcdfBox all = allOf(array);
  std::vector<std::string> strings;
  if (array.text == ZarrArray::Text::kNone || all.values() > kMaxStrings) return strings;
  if (array.text == ZarrArray::Text::kBytes) {
    const std::string text = readText(variable);
    for (size_t at = 0; at + array.value_bytes <= text.size(); at += array.value_bytes) {
      std::string& string = strings.emplace_back(withoutZeros(text.substr(at, array.value_bytes)));
      string.erase(string.find_last_not_of(' ') + 1);
    }
    return strings;
  }
  strings.resize(all.values());
  if (array.text == ZarrArray::Text::kUtf32) {
    const bool swap = array.big_endian != (kMachineByteOrder == ByteOrder::kBig);
    forEachRun(variable.position, all, [&](const std::byte* from, size_t stride, size_t count, size_t place) {
      for (size_t n = 0; from && n < count; ++n)
        strings[place + n] = utf8Of(from + n * stride, array.value_bytes / 4, swap);
    });
  } else if (array.shape.size() == 1) {
    for (uint64_t first = 0; first < array.shape[0]; first += array.chunks[0]) {
      const std::vector<uint64_t> at{first / array.chunks[0]};
      const auto chunk = loaded(array, at);
      if (!chunk) continue;
      const std::vector<std::string> found = stringsIn(*chunk, store_.nameOf(keyOf(array, at)));
      for (size_t n = 0; n < found.size() && first + n < strings.size(); ++n) strings[first + n] = found[n];
    }
  }
  return strings;
}

bool isNetcdf(const std::filesystem::path& path) {
  return isZarrStore(path) || NetcdfFile::recognises(InputFile(path));
}

std::unique_ptr<NetcdfFile> openNetcdfFile(const std::filesystem::path& path) {
  if (isZarrStore(path)) return std::make_unique<ZarrFile>(path);
  return std::make_unique<NetcdfFile>(path);
}

}  // namespace curvisplat
