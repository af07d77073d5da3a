// EXR by TinyEXR: single-part scan-line files with half or float channels R, G, B and A, or Y.
//
// TinyEXR trusts sizes and offsets that a file states. So every attribute and every chunk is checked here
// before TinyEXR sees the file, and what these checks do not cover is refused: tiles, several parts, deep
// pixels, PIZ, B44 and DWA.
#include <tinyexr.h>

#include <algorithm>
#include <array>
#include <cstdlib>
#include <cstring>
#include <map>
#include <memory>
#include <string_view>

#include "render/image/image_file.h"
#include "stream/base/error.h"

namespace curvisplat {
namespace {

// The attributes that every file must have, and their minimum sizes in bytes.
struct RequiredAttribute {
  std::string_view name;
  uint32_t bytes;
};
constexpr std::array<RequiredAttribute, 8> kRequired{{{"channels", 1},
                                                      {"compression", 1},
                                                      {"dataWindow", 16},
                                                      {"displayWindow", 16},
                                                      {"lineOrder", 1},
                                                      {"pixelAspectRatio", 4},
                                                      {"screenWindowCenter", 8},
                                                      {"screenWindowWidth", 4}}};
constexpr size_t kMaxAttributes = 128;

constexpr uint32_t kLongNames = 0x400;       // the only flag that is accepted beside version 2
constexpr uint64_t kLargestExrRatio = 1032;  // of zlib; run-length encoding reaches 64

struct ExrChannel {
  std::string name;
  uint32_t bytes = 0;  // 2 or 4
};

struct ExrLayout {
  std::vector<ExrChannel> channels;
  int compression = -1;
  int32_t min_x = 0, min_y = 0, max_x = -1, max_y = -1;
  int64_t width() const { return int64_t{max_x} - min_x + 1; }
  int64_t height() const { return int64_t{max_y} - min_y + 1; }
  int64_t linesPerChunk() const { return compression == TINYEXR_COMPRESSIONTYPE_ZIP ? 16 : 1; }
  uint64_t bytesPerPixel() const {
    uint64_t bytes = 0;
    for (const ExrChannel& channel : channels) bytes += channel.bytes;
    return bytes;
  }
};

// Reads a range of bytes from its front, and throws Error at its end.
class Cursor {
 public:
  Cursor(std::span<const std::byte> bytes, const std::string& name) : bytes_(bytes), name_(name) {}

  template <typename T>
  T read() {
    T value;
    std::memcpy(&value, takeBytes(sizeof value).data(), sizeof value);
    return value;
  }
  std::span<const std::byte> takeBytes(size_t count) {
    if (count > bytes_.size() - at_)
      throw Error("{}: the EXR file is truncated{}", name_, limitOfHeader(bytes_));
    at_ += count;
    return bytes_.subspan(at_ - count, count);
  }
  std::string takeString() {
    const auto left = bytes_.subspan(at_);
    const auto end = std::find(left.begin(), left.end(), std::byte{0});
    const auto length = static_cast<size_t>(end - left.begin());
    if (length > 255) throw Error("{}: the EXR header has a name of more than 255 letters", name_);
    const auto letters = takeBytes(length + 1);
    return {reinterpret_cast<const char*>(letters.data()), length};
  }
  size_t at() const { return at_; }

 private:
  std::span<const std::byte> bytes_;
  const std::string& name_;
  size_t at_ = 0;
};

std::vector<ExrChannel> takeChannels(Cursor list, const std::string& name) {
  std::vector<ExrChannel> channels;
  for (std::string channel = list.takeString(); !channel.empty(); channel = list.takeString()) {
    const auto type = list.read<int32_t>();
    list.takeBytes(4);  // pLinear and reserved
    const auto x_sampling = list.read<int32_t>(), y_sampling = list.read<int32_t>();
    if (type != TINYEXR_PIXELTYPE_HALF && type != TINYEXR_PIXELTYPE_FLOAT)
      throw Error("{}: EXR channel {} has pixel type {}, expected half or float", name, channel, type);
    if (x_sampling != 1 || y_sampling != 1)
      throw Error("{}: EXR channel {} is subsampled, which is not supported", name, channel);
    channels.push_back({channel, type == TINYEXR_PIXELTYPE_HALF ? 2u : 4u});
    if (channels.size() > 64) throw Error("{}: the EXR file has more than 64 channels", name);
  }
  if (channels.empty()) throw Error("{}: the EXR file has no channels", name);
  return channels;
}

void takeAttribute(const std::string& attribute, std::span<const std::byte> data, ExrLayout& layout,
                   const std::string& name) {
  Cursor value(data, name);
  if (attribute == "channels") {
    layout.channels = takeChannels(value, name);
  } else if (attribute == "compression") {
    layout.compression = value.read<uint8_t>();
    if (layout.compression > TINYEXR_COMPRESSIONTYPE_ZIP)
      throw Error("{}: EXR compression {} is not supported; expected none, RLE, ZIPS or ZIP (0 to 3)", name,
                  layout.compression);
  } else if (attribute == "dataWindow") {
    for (int32_t* side : {&layout.min_x, &layout.min_y, &layout.max_x, &layout.max_y})
      *side = value.read<int32_t>();
  } else if (attribute == "lineOrder") {
    if (value.read<uint8_t>() != 0)
      throw Error("{}: EXR lines must be stored from the top down; other orders are not supported", name);
  } else if (attribute == "tiles" || attribute == "chunkCount") {
    throw Error("{}: has the attribute {}; only single-part scan-line EXR files are supported", name,
                attribute);
  }
}

ExrLayout takeLayout(Cursor& file, const std::string& name) {
  file.read<uint32_t>();  // the magic number, which selected this decoder
  const auto version = file.read<uint32_t>();
  if ((version & ~kLongNames) != 2)
    throw Error(
        "{}: has EXR version and flags {:#x}; only version 2, single-part, in scan lines, is supported", name,
        version);
  ExrLayout layout;
  std::map<std::string, uint32_t> found;
  for (std::string attribute = file.takeString(); !attribute.empty(); attribute = file.takeString()) {
    const std::string type = file.takeString();
    const auto size = file.read<uint32_t>();
    if ((size == 0 && type != "string") || !found.emplace(attribute, size).second ||
        found.size() > kMaxAttributes)
      throw Error("{}: the EXR attribute {} is empty or repeated, or there are too many attributes", name,
                  attribute);
    takeAttribute(attribute, file.takeBytes(size), layout, name);
  }
  for (const RequiredAttribute& required : kRequired)
    if (const auto at = found.find(std::string(required.name));
        at == found.end() || at->second < required.bytes)
      throw Error("{}: the EXR header lacks the attribute {} ({} bytes or more)", name, required.name,
                  required.bytes);
  return layout;
}

// Checks that every chunk lies in the file, begins with the line that its place in the table implies, and has
// a plausible length.
void requireChunks(Cursor& file, const ExrLayout& layout, std::span<const std::byte> bytes,
                   const std::string& name) {
  requirePlausibleSize(layout.width(), layout.height(), layout.bytesPerPixel(), bytes.size(),
                       kLargestExrRatio, name);
  const int64_t chunks = (layout.height() + layout.linesPerChunk() - 1) / layout.linesPerChunk();
  Cursor table(file.takeBytes(8 * static_cast<size_t>(chunks)), name);
  for (int64_t c = 0; c < chunks; ++c) {
    const auto offset = table.read<uint64_t>();
    if (offset < file.at() || offset > bytes.size())
      throw Error("{}: EXR chunk {} has offset {}, outside of the file's pixel data", name, c, offset);
    Cursor chunk(bytes.subspan(offset), name);
    const auto line = chunk.read<int32_t>();
    const auto size = chunk.read<uint32_t>();
    chunk.takeBytes(size);
    const int64_t first = c * layout.linesPerChunk();
    const auto lines = static_cast<uint64_t>(std::min(layout.linesPerChunk(), layout.height() - first));
    const uint64_t unpacked = lines * static_cast<uint64_t>(layout.width()) * layout.bytesPerPixel();
    const bool plausible = layout.compression == TINYEXR_COMPRESSIONTYPE_NONE
                               ? size == unpacked
                               : size <= unpacked && unpacked / kLargestExrRatio <= size;
    if (line != layout.min_y + first || size == 0 || !plausible)
      throw Error("{}: EXR chunk {} at byte {} claims {} bytes from line {} on; the file is corrupt", name, c,
                  offset, size, line);
  }
}

// Owns what TinyEXR allocates, also where it fails half way.
struct TinyExrFile {
  EXRHeader header;
  EXRImage image;

  TinyExrFile() {
    InitEXRHeader(&header);
    InitEXRImage(&image);
  }
  ~TinyExrFile() {
    FreeEXRImage(&image);
    FreeEXRHeader(&header);
    if (message_ != nullptr) FreeEXRErrorMessage(message_);
  }
  TinyExrFile(const TinyExrFile&) = delete;
  TinyExrFile& operator=(const TinyExrFile&) = delete;

  void parseHeader(std::span<const unsigned char> bytes, const std::string& name) {
    EXRVersion version;
    require(ParseEXRVersionFromMemory(&version, bytes.data(), bytes.size()), name);
    require(ParseEXRHeaderFromMemory(&header, &version, bytes.data(), bytes.size(), &message_), name);
  }
  void loadPixels(std::span<const unsigned char> bytes, const std::string& name) {
    std::fill_n(header.requested_pixel_types, header.num_channels, TINYEXR_PIXELTYPE_FLOAT);
    image.num_channels =
        header.num_channels;  // a failed load frees that many channels but keeps the pointers
    const int result = LoadEXRImageFromMemory(&image, &header, bytes.data(), bytes.size(), &message_);
    if (result != TINYEXR_SUCCESS) InitEXRImage(&image);
    require(result, name);
  }
  /// Index of the channel, or -1.
  int channelNamed(std::string_view name) const {
    for (int n = 0; n < header.num_channels; ++n)
      if (header.channels[n].name == name) return n;
    return -1;
  }
  const float* plane(int channel) const { return reinterpret_cast<const float*>(image.images[channel]); }

 private:
  const char* message_ = nullptr;

  void require(int result, const std::string& name) const {
    if (result == TINYEXR_SUCCESS) return;
    std::string reason = message_ != nullptr ? message_ : "no reason given";
    std::replace(reason.begin(), reason.end(), '\n', ' ');
    throw Error("{}: the EXR file cannot be read ({}): {}", name, result, reason);
  }
};

/// Throws Error unless TinyEXR can be given the file.
ExrLayout checkFile(std::span<const std::byte> bytes, const std::string& name) {
  Cursor cursor(bytes, name);
  const ExrLayout layout = takeLayout(cursor, name);
  requireChunks(cursor, layout, bytes, name);
  return layout;
}

std::span<const unsigned char> memoryOf(std::span<const std::byte> bytes) {
  return {reinterpret_cast<const unsigned char*>(bytes.data()), bytes.size()};
}

}  // namespace

Bytes encodeExr(const Image& image) {
  return encodeExr(image, {});
}

Bytes encodeExr(const Image& image, std::span<const ImageChannel> more) {
  constexpr std::string_view kNames = "ABGR";
  constexpr std::array<size_t, 4> kFrom{3, 2, 1, 0};
  const size_t first = isOpaque(image) ? 1 : 0, pixels = image.rgba.size() / 4;
  // In alphabetical order, as the format requires.
  std::map<std::string, std::vector<float>> planes;
  for (size_t c = first; c < 4; ++c) {
    std::vector<float>& plane = planes[std::string(1, kNames[c])];
    plane.resize(pixels);
    for (size_t n = 0; n < pixels; ++n) plane[n] = image.rgba[4 * n + kFrom[c]];
  }
  for (const ImageChannel& channel : more) {
    CURVISPLAT_CHECK_OP(channel.values.size(), ==, pixels);
    planes[channel.name] = channel.values;
  }
  const size_t channels = planes.size();
  std::vector<unsigned char*> plane_pointers;
  std::vector<EXRChannelInfo> infos(channels);
  std::vector<int> types(channels, TINYEXR_PIXELTYPE_FLOAT);
  for (auto& [name, plane] : planes) {
    EXRChannelInfo& info = infos[plane_pointers.size()];
    std::copy_n(name.data(), std::min(name.size(), sizeof info.name - 1), info.name);
    plane_pointers.push_back(reinterpret_cast<unsigned char*>(plane.data()));
  }

  // Borrows its arrays to TinyEXR, which must not free them.
  EXRHeader header;
  InitEXRHeader(&header);
  header.num_channels = static_cast<int>(channels);
  header.channels = infos.data();
  header.pixel_types = types.data();
  header.requested_pixel_types = types.data();
  header.compression_type = TINYEXR_COMPRESSIONTYPE_ZIP;
  EXRImage exr;
  InitEXRImage(&exr);
  exr.num_channels = header.num_channels;
  exr.images = plane_pointers.data();
  exr.width = image.size.width;
  exr.height = image.size.height;

  unsigned char* memory = nullptr;
  const char* message = nullptr;
  const size_t size = SaveEXRImageToMemory(&exr, &header, &memory, &message);
  if (size == 0) {
    const std::string reason = message != nullptr ? message : "no reason given";
    if (message != nullptr) FreeEXRErrorMessage(message);
    throw Error("an image of {} x {} pixels cannot be written as EXR: {}", image.size.width,
                image.size.height, reason);
  }
  const std::unique_ptr<unsigned char, decltype(&std::free)> owner(memory, &std::free);
  const auto* begin = reinterpret_cast<const std::byte*>(memory);
  return {begin, begin + size};
}

std::vector<ImageChannel> decodeExrChannels(std::span<const std::byte> bytes, const std::string& name) {
  checkFile(bytes, name);
  const std::span memory = memoryOf(bytes);
  TinyExrFile exr;
  exr.parseHeader(memory, name);
  exr.loadPixels(memory, name);
  const auto pixels = static_cast<size_t>(exr.image.width) * static_cast<size_t>(exr.image.height);
  std::vector<ImageChannel> channels;
  for (int n = 0; n < exr.header.num_channels; ++n) {
    const std::string_view channel = exr.header.channels[n].name;
    if (channel.size() == 1 && std::string_view("RGBAY").find(channel) != std::string_view::npos) continue;
    channels.push_back({std::string(channel), {exr.plane(n), exr.plane(n) + pixels}});
  }
  return channels;
}

ImageSize sizeOfExr(std::span<const std::byte> bytes, const std::string& name) {
  Cursor cursor(bytes, name);
  const ExrLayout layout = takeLayout(cursor, name);
  constexpr size_t kMaxOfMap = 4;
  if (layout.channels.size() > kMaxOfMap)
    throw Error("{}: has {} channels; a map has at most {} (R, G, B, A)", name, layout.channels.size(),
                kMaxOfMap);
  requirePossibleSize(layout.width(), layout.height(), name);
  return {static_cast<int>(layout.width()), static_cast<int>(layout.height())};
}

Image decodeExr(std::span<const std::byte> bytes, const std::string& name) {
  const ExrLayout layout = checkFile(bytes, name);
  const std::span memory = memoryOf(bytes);
  TinyExrFile exr;
  exr.parseHeader(memory, name);
  const bool grey = exr.channelNamed("Y") >= 0;
  const std::array<int, 3> colour{exr.channelNamed(grey ? "Y" : "R"), exr.channelNamed(grey ? "Y" : "G"),
                                  exr.channelNamed(grey ? "Y" : "B")};
  const int alpha = exr.channelNamed("A");
  if (*std::min_element(colour.begin(), colour.end()) < 0)
    throw Error("{}: the EXR file has neither the channels R, G and B nor Y", name);
  exr.loadPixels(memory, name);
  if (exr.image.width != layout.width() || exr.image.height != layout.height())
    throw Error("{}: the EXR file has {} x {} pixels; its header says {} x {}", name, exr.image.width,
                exr.image.height, layout.width(), layout.height());

  Image image({exr.image.width, exr.image.height});
  for (size_t n = 0; n < image.rgba.size() / 4; ++n) {
    for (size_t c = 0; c < 3; ++c) image.rgba[4 * n + c] = exr.plane(colour[c])[n];
    image.rgba[4 * n + 3] = alpha < 0 ? 1 : exr.plane(alpha)[n];
  }
  return image;
}

}  // namespace curvisplat
