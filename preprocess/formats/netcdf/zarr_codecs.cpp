#include "preprocess/formats/netcdf/zarr_codecs.h"

#include <blosc.h>
#include <fmt/format.h>
#include <lz4.h>
#include <zlib.h>
#include <zstd.h>

#include <array>
#include <cstring>
#include <optional>
#include <string_view>

#include "preprocess/formats/common/byte_source.h"
#include "preprocess/formats/common/data_libraries.h"
#include "stream/base/error.h"

namespace curvisplat {

CURVISPLAT_LIBRARY_FUNCTION(blosc_cbuffer_validate)
CURVISPLAT_LIBRARY_FUNCTION(blosc_decompress_ctx)

namespace {

using Bytes = std::vector<std::byte>;

constexpr size_t kMaxVariableChunkBytes = 16 << 20;
constexpr size_t kChecksumBytes = 4;
constexpr bool kSwap = kMachineByteOrder == ByteOrder::kBig;

[[noreturn]] void damaged(const std::string& place, std::string_view what) {
  throw Error("{}: {}; it is truncated or damaged: copy or write it again", place, what);
}

/// A decoder writes at most `to.size()` bytes and returns how many; nullopt if the bytes are damaged.
using Decoder = std::optional<size_t> (*)(std::span<const std::byte> from, std::span<std::byte> to);

std::optional<size_t> decodeZlib(std::span<const std::byte> from, std::span<std::byte> to) {
  z_stream stream{};
  constexpr int kZlibOrGzip = 15 + 32;
  if (inflateInit2(&stream, kZlibOrGzip) != Z_OK) return std::nullopt;
  stream.next_in = reinterpret_cast<Bytef*>(const_cast<std::byte*>(from.data()));
  stream.avail_in = static_cast<uInt>(from.size());
  stream.next_out = reinterpret_cast<Bytef*>(to.data());
  stream.avail_out = static_cast<uInt>(to.size());
  const int status = inflate(&stream, Z_FINISH);
  const size_t count = stream.total_out;
  inflateEnd(&stream);
  return status == Z_STREAM_END ? std::optional(count) : std::nullopt;
}

std::optional<size_t> decodeZstd(std::span<const std::byte> from, std::span<std::byte> to) {
  const size_t count = ZSTD_decompress(to.data(), to.size(), from.data(), from.size());
  return ZSTD_isError(count) ? std::nullopt : std::optional(count);
}

std::optional<size_t> decodeBlosc(std::span<const std::byte> from, std::span<std::byte> to) {
  size_t count = 0;
  if (from.size() < BLOSC_MIN_HEADER_LENGTH || blosc_cbuffer_validate(from.data(), from.size(), &count) < 0 ||
      count > to.size())
    return std::nullopt;
  if (count == 0) return 0;
  const int done = blosc_decompress_ctx(from.data(), to.data(), to.size(), 1);
  return done >= 0 && static_cast<size_t>(done) == count ? std::optional(count) : std::nullopt;
}

/// Decodes a block of LZ4, which follows the number of its decompressed bytes.
std::optional<size_t> decodeLz4(std::span<const std::byte> from, std::span<std::byte> to) {
  constexpr size_t kCountBytes = 4;
  if (from.size() < kCountBytes) return std::nullopt;
  const int done = LZ4_decompress_safe(
      reinterpret_cast<const char*>(from.data()) + kCountBytes, reinterpret_cast<char*>(to.data()),
      static_cast<int>(from.size() - kCountBytes), static_cast<int>(to.size()));
  return done < 0 ? std::nullopt : std::optional(static_cast<size_t>(done));
}

/// Undoes a shuffle, which stores the first bytes of all elements, then their second ones, and so on. Bytes
/// after the last whole element are not shuffled.
Bytes unshuffled(const Bytes& from, size_t element_bytes) {
  Bytes to = from;
  const size_t elements = from.size() / element_bytes;
  for (size_t byte = 0; byte < element_bytes; ++byte)
    for (size_t n = 0; n < elements; ++n) to[n * element_bytes + byte] = from[byte * elements + n];
  return to;
}

/// CRC-32C (Castagnoli's polynomial, in reversed bits).
uint32_t crc32c(std::span<const std::byte> bytes) {
  static const std::array<uint32_t, 256> table = [] {
    std::array<uint32_t, 256> made{};
    for (uint32_t n = 0; n < made.size(); ++n) {
      made[n] = n;
      for (int bit = 0; bit < 8; ++bit) made[n] = made[n] >> 1 ^ (made[n] & 1 ? 0x82f63b78 : 0);
    }
    return made;
  }();
  uint32_t crc = 0xffffffff;
  for (const std::byte byte : bytes) crc = table[(crc ^ static_cast<uint32_t>(byte)) & 0xff] ^ crc >> 8;
  return ~crc;
}

/// CRC32C follows the bytes; the others stand before them.
void removeChecksum(ZarrCodec::Kind kind, Bytes& bytes, const std::string& place) {
  if (bytes.size() < kChecksumBytes) damaged(place, "has no checksum");
  const bool at_end = kind == ZarrCodec::Kind::kChecksum;
  const size_t count = bytes.size() - kChecksumBytes;
  const auto stored = loadStored<uint32_t>(&bytes[at_end ? count : 0], kSwap);
  if (at_end)
    bytes.resize(count);
  else
    bytes.erase(bytes.begin(), bytes.begin() + kChecksumBytes);
  const auto* const data = reinterpret_cast<const Bytef*>(bytes.data());
  const uint64_t found = at_end                            ? crc32c(bytes)
                         : kind == ZarrCodec::Kind::kCrc32 ? crc32(0, data, static_cast<uInt>(count))
                                                           : adler32(1, data, static_cast<uInt>(count));
  if (found != stored) damaged(place, "has a wrong checksum");
}

/// Numbers of which each was stored as its difference from the one before.
template <typename Stored>
void addDifferences(Bytes& bytes) {
  Stored sum{};
  for (size_t at = 0; at + sizeof sum <= bytes.size(); at += sizeof sum) {
    const auto difference = loadStored<Stored>(&bytes[at], kSwap);
    sum = at == 0 ? difference : static_cast<Stored>(sum + difference);
    Stored stored = sum;
    if (kSwap) stored = loadStored<Stored>(reinterpret_cast<const std::byte*>(&sum), true);
    std::memcpy(&bytes[at], &stored, sizeof stored);
  }
}

/// Differences of integers wrap around, whatever their sign.
void addDifferences(const ZarrCodec& codec, Bytes& bytes) {
  if (codec.number == ZarrNumber::kFloat) return addDifferences<float>(bytes);
  if (codec.number == ZarrNumber::kDouble) return addDifferences<double>(bytes);
  if (codec.element_bytes == 1) return addDifferences<uint8_t>(bytes);
  if (codec.element_bytes == 2) return addDifferences<uint16_t>(bytes);
  if (codec.element_bytes == 4) return addDifferences<uint32_t>(bytes);
  addDifferences<uint64_t>(bytes);
}

struct NamedDecoder {
  ZarrCodec::Kind kind;
  const char* name;
  Decoder decode;
};

constexpr NamedDecoder kDecoders[] = {{ZarrCodec::Kind::kZlib, "zlib", decodeZlib},
                                      {ZarrCodec::Kind::kZstd, "zstd", decodeZstd},
                                      {ZarrCodec::Kind::kBlosc, "Blosc", decodeBlosc},
                                      {ZarrCodec::Kind::kLz4, "LZ4", decodeLz4}};

}  // namespace

Bytes decodedZarr(const ZarrArray& array, Bytes bytes, const std::string& place) {
  const bool variable = array.value_bytes == 0;
  const size_t expected = variable ? kMaxVariableChunkBytes : array.chunkBytes();
  for (size_t n = array.codecs.size(); n-- > 0;) {
    const ZarrCodec::Kind kind = array.codecs[n].kind;
    if (kind == ZarrCodec::Kind::kShuffle) {
      bytes = unshuffled(bytes, array.codecs[n].element_bytes);
    } else if (kind == ZarrCodec::Kind::kDelta) {
      addDifferences(array.codecs[n], bytes);
    } else if (kind == ZarrCodec::Kind::kChecksum || kind == ZarrCodec::Kind::kCrc32 ||
               kind == ZarrCodec::Kind::kAdler32) {
      removeChecksum(kind, bytes, place);
    } else {
      for (const NamedDecoder& decoder : kDecoders) {
        if (decoder.kind != kind) continue;
        Bytes decoded(expected + n * kChecksumBytes);
        const auto count = decoder.decode(bytes, decoded);
        if (!count) damaged(place, fmt::format("cannot be decompressed with {}", decoder.name));
        decoded.resize(*count);
        bytes = std::move(decoded);
        break;
      }
    }
  }
  if (!variable && bytes.size() != expected)
    damaged(place, fmt::format("has {} bytes (expected {})", bytes.size(), expected));
  return bytes;
}

}  // namespace curvisplat
