#include "preprocess/formats/vtk/encoded_bytes.h"

#include <lz4.h>
#include <lzma.h>
#include <zlib.h>

#include <algorithm>
#include <array>
#include <atomic>
#include <string_view>

#include "preprocess/formats/common/byte_source.h"
#include "stream/base/error.h"
#include "stream/base/threads.h"

namespace curvisplat {
namespace {

constexpr size_t kPieceCharacters = size_t{16} << 10;  // a multiple of 4
constexpr uint8_t kNone = 64, kPadding = 65;

constexpr std::array<uint8_t, 256> valuesOfCharacters() {
  constexpr std::string_view kAlphabet = "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
  std::array<uint8_t, 256> values{};
  values.fill(kNone);
  for (size_t n = 0; n < kAlphabet.size(); ++n)
    values[static_cast<uint8_t>(kAlphabet[n])] = static_cast<uint8_t>(n);
  values['='] = kPadding;
  return values;
}
constexpr std::array<uint8_t, 256> kValues = valuesOfCharacters();

/// Decodes a group of four characters. Returns the number of bytes (1 to 3), or 0 if they are not base64.
size_t decodeFour(const std::byte* from, std::array<std::byte, 3>& to) {
  std::array<uint32_t, 4> values;
  for (size_t n = 0; n < 4; ++n) values[n] = kValues[static_cast<uint8_t>(from[n])];
  size_t bytes = 3;
  if (values[3] == kPadding) {
    bytes = 2;
    values[3] = 0;
    if (values[2] == kPadding) {
      bytes = 1;
      values[2] = 0;
    }
  }
  if ((values[0] | values[1] | values[2] | values[3]) >= kNone) return 0;
  const uint32_t bits = values[0] << 18 | values[1] << 12 | values[2] << 6 | values[3];
  to = {std::byte(bits >> 16), std::byte(bits >> 8 & 255), std::byte(bits & 255)};
  return bytes;
}

bool isSpaceByte(std::byte c) {
  return c == std::byte{' '} || (c >= std::byte{'\t'} && c <= std::byte{'\r'});
}

}  // namespace

Base64Bytes::Base64Bytes(std::shared_ptr<const PooledFile> file, uint64_t begin, uint64_t end)
    : file_(std::move(file)), begin_(std::min(begin, file_->size())), end_(std::min(end, file_->size())) {
  findLines();
  const uint64_t span = std::max(end_, begin_) - begin_;
  characters_ = std::min(span, first_);
  if (span > first_ + break_) {
    const uint64_t rest = span - first_ - break_;
    characters_ += rest / (line_ + break_) * line_ + std::min(rest % (line_ + break_), line_);
  }
}

/// Finds the length of a line, from the first two line breaks. Lines that groups of four do not fill are no
/// lines of base64.
void Base64Bytes::findLines() {
  std::array<std::byte, 4096> text;
  const auto some = std::span(text).first(std::min<uint64_t>(text.size(), std::max(end_, begin_) - begin_));
  file_->readAt(begin_, some);
  const auto first = std::find_if(some.begin(), some.end(), isSpaceByte);
  const auto next = std::find_if_not(first, some.end(), isSpaceByte);
  const auto last = std::find_if(next, some.end(), isSpaceByte);
  const auto length = static_cast<uint64_t>(first - some.begin()), line = static_cast<uint64_t>(last - next);
  if (next == some.end() || length % 4 != 0 || length == 0 || line % 4 != 0) return;
  first_ = length;
  break_ = static_cast<uint64_t>(next - first);
  line_ = last == some.end() ? kUnbroken : line;
}

uint64_t Base64Bytes::position(uint64_t four) const {
  const uint64_t character = 4 * four;
  if (character < first_) return begin_ + character;
  return begin_ + character + (1 + (character - first_) / line_) * break_;
}

size_t Base64Bytes::readFours(uint64_t four, size_t count, std::span<std::byte> text) const {
  const auto room = static_cast<uint64_t>(text.size());
  while (position(four + count - 1) + 4 - position(four) > room) count /= 2;
  const uint64_t from = position(four);
  const auto raw = text.first(static_cast<size_t>(position(four + count - 1) + 4 - from));
  file_->readAt(from, raw);
  if (raw.size() > 4 * count)
    for (size_t n = 0; n < count; ++n)
      std::copy_n(&raw[static_cast<size_t>(position(four + n) - from)], 4, &text[4 * n]);
  return count;
}

void Base64Bytes::readAt(uint64_t offset, std::span<std::byte> to) const {
  std::array<std::byte, 2 * kPieceCharacters> text;
  uint64_t four = offset / 3;
  auto skipped = static_cast<size_t>(offset % 3);
  while (!to.empty()) {
    const uint64_t wanted = (skipped + to.size() + 2) / 3;
    const uint64_t left = characters_ / 4 - std::min(four, characters_ / 4);
    auto fours = static_cast<size_t>(std::min({wanted, left, uint64_t{kPieceCharacters / 4}}));
    if (fours == 0)
      throw Error("{}: byte {}: expected {} more bytes in base64; the file is truncated or damaged",
                  file_->name(), position(four), to.size());
    fours = readFours(four, fours, text);
    for (size_t n = 0; n < fours && !to.empty(); ++n) {
      std::array<std::byte, 3> bytes;
      const std::byte* const group = &text[4 * n];
      const size_t count = decodeFour(group, bytes);
      const size_t used = std::min(3 - skipped, to.size());
      if (count == 0 && std::any_of(group, group + 4, isSpaceByte))
        throw Error(
            "{}: byte {}: not valid base64: it is broken into lines of several lengths; write it without "
            "line breaks",
            file_->name(), position(four + n));
      if (count < skipped + used)
        throw Error("{}: byte {}: {}; the file is damaged", file_->name(), position(four + n),
                    count == 0 ? "not valid base64" : "the base64 ends before the end of its data");
      std::copy_n(&bytes[skipped], used, to.begin());
      to = to.subspan(used);
      skipped = 0;
    }
    four += fours;
  }
}

bool Base64Bytes::endsWith(uint64_t bytes) const {
  const uint64_t last = (bytes - 1) / 3;
  if (last >= characters_ / 4 || bytes % 3 == 0) return false;
  std::array<std::byte, 4> group;
  file_->readAt(position(last), group);
  const auto padding = static_cast<uint64_t>(std::count(group.begin(), group.end(), std::byte{'='}));
  return padding == 3 - bytes % 3;
}

std::shared_ptr<const Base64Bytes> Base64Bytes::behind(uint64_t bytes) const {
  const uint64_t fours = std::min((bytes + 2) / 3, characters_ / 4);
  return std::make_shared<const Base64Bytes>(file_, position(fours), end_);
}

namespace {

constexpr uint64_t kTableStride = 1024;
constexpr size_t kPieceBytes = size_t{256} << 10;

struct Table {
  uint64_t blocks = 0, block_bytes = 0, last_bytes = 0;  // the last block has 1 .. block_bytes bytes
};

/// The largest size that `packed` bytes can decompress to. zlib: the ratio in its documentation; LZ4: each
/// further byte of a length encodes up to 255 bytes; LZMA: a match of 273 bytes takes ten bits of a
/// probability of 31/32 and more.
uint64_t maxUnpackedBytes(BlockCompressor compressor, uint64_t packed) {
  const uint64_t ratio = compressor == BlockCompressor::kZlib  ? 1032
                         : compressor == BlockCompressor::kLz4 ? 255
                                                               : 16384;
  return packed > UINT64_MAX / ratio - 64 ? UINT64_MAX : packed * ratio + 64;
}

/// Upper bound of the compressed size of incompressible data.
uint64_t maxPackedBytes(uint64_t unpacked) {
  return unpacked + unpacked / 8 + 1024;
}

Table readTable(const CompressedBytes::Parts& parts, uint64_t size) {
  const HeaderIntegers& integers = parts.integers;
  Table table{integers.at(*parts.table, 0), integers.at(*parts.table, integers.bytes),
              integers.at(*parts.table, 2 * integers.bytes)};
  const uint64_t slots = parts.table->size() / integers.bytes;
  if (table.blocks == 0 || table.blocks > slots - 3)
    throw Error("{}: its header declares {} compressed blocks, but at most {} fit; the file is damaged",
                parts.place, table.blocks, slots - 3);
  if (table.last_bytes == 0) table.last_bytes = table.block_bytes;
  const bool overflows = table.block_bytes == 0 || table.last_bytes > table.block_bytes ||
                         table.blocks > UINT64_MAX / table.block_bytes;
  if (overflows || (table.blocks - 1) * table.block_bytes + table.last_bytes != size)
    throw Error("{}: should have {} bytes, but its header declares {} blocks of {} bytes, the last of {}",
                parts.place, size, table.blocks, table.block_bytes, table.last_bytes);
  return table;
}

/// Calls visit(block, offset, bytes) for all blocks of the table in order, and checks that they fit the
/// file.
template <typename Visit>
void forEachBlock(const CompressedBytes::Parts& parts, const Table& table, const Visit& visit) {
  const HeaderIntegers& integers = parts.integers;
  std::vector<std::byte> piece;
  uint64_t offset = 0;
  for (uint64_t first = 0; first < table.blocks; first += kTableStride) {
    const uint64_t count = std::min(kTableStride, table.blocks - first);
    piece.resize(static_cast<size_t>(count * integers.bytes));
    parts.table->readAt((3 + first) * integers.bytes, piece);
    for (uint64_t n = 0; n < count; ++n) {
      const uint64_t bytes = integers.at(std::span(piece).subspan(static_cast<size_t>(n * integers.bytes)));
      const uint64_t unpacked = first + n + 1 == table.blocks ? table.last_bytes : table.block_bytes;
      if (bytes > parts.blocks->size() - offset || bytes > maxPackedBytes(unpacked) ||
          maxUnpackedBytes(parts.compressor, bytes) < unpacked)
        throw Error("{}: block {} of {} bytes, compressed to {}, does not fit the {} bytes left in the file",
                    parts.place, first + n, unpacked, bytes, parts.blocks->size() - offset);
      visit(first + n, offset, bytes);
      offset += bytes;
    }
  }
}

[[noreturn]] void failBlock(const std::string& place, uint64_t block, const char* reason) {
  throw Error("{}: block {} cannot be decompressed: {}; the file is damaged", place, block, reason);
}

/// Decompresses a zlib stream piece by piece.
class Inflater {
 public:
  Inflater(const std::string& place, uint64_t block) : place_(place), block_(block) {
    if (inflateInit(&stream_) != Z_OK) failBlock(place_, block_, "zlib is out of memory");
  }
  ~Inflater() { inflateEnd(&stream_); }
  Inflater(const Inflater&) = delete;
  Inflater& operator=(const Inflater&) = delete;

  void give(std::span<const std::byte> packed) {
    stream_.next_in = reinterpret_cast<Bytef*>(const_cast<std::byte*>(packed.data()));
    stream_.avail_in = static_cast<uInt>(packed.size());
  }

  /// Decompresses to `to` as far as the input allows; returns the number of bytes written.
  size_t read(std::span<std::byte> to) {
    if (ended_) return 0;
    stream_.next_out = reinterpret_cast<Bytef*>(to.data());
    stream_.avail_out = static_cast<uInt>(to.size());
    const int result = inflate(&stream_, Z_NO_FLUSH);
    ended_ = result == Z_STREAM_END;
    if (!ended_ && result != Z_OK && result != Z_BUF_ERROR)
      failBlock(place_, block_, stream_.msg ? stream_.msg : "not a zlib stream");
    return to.size() - stream_.avail_out;
  }

  bool ended() const { return ended_; }

 private:
  const std::string& place_;
  uint64_t block_;
  z_stream stream_{};
  bool ended_ = false;
};

void unpackZlib(const std::string& place, uint64_t block, std::span<const std::byte> packed,
                std::span<std::byte> to) {
  Inflater inflater(place, block);
  inflater.give(packed);
  const size_t bytes = inflater.read(to);
  std::byte more;
  // zlib checks the checksum at the end of the stream only when more than the last byte is requested.
  if (bytes != to.size() || (!inflater.ended() && inflater.read(std::span(&more, 1)) > 0) ||
      !inflater.ended())
    failBlock(place, block, "its size differs from the table");
}

void unpackLz4(const std::string& place, uint64_t block, std::span<const std::byte> packed,
               std::span<std::byte> to) {
  const int bytes =
      LZ4_decompress_safe(reinterpret_cast<const char*>(packed.data()), reinterpret_cast<char*>(to.data()),
                          static_cast<int>(packed.size()), static_cast<int>(to.size()));
  if (bytes < 0) failBlock(place, block, "not an LZ4 block");
  if (static_cast<size_t>(bytes) != to.size()) failBlock(place, block, "its size differs from the table");
}

void unpackLzma(const std::string& place, uint64_t block, std::span<const std::byte> packed,
                std::span<std::byte> to) {
  uint64_t memory =
      uint64_t{128} << 20;  // of a dictionary, of which no more is touched than the block has bytes
  size_t read = 0, written = 0;
  const lzma_ret result =
      lzma_stream_buffer_decode(&memory, 0, nullptr, reinterpret_cast<const uint8_t*>(packed.data()), &read,
                                packed.size(), reinterpret_cast<uint8_t*>(to.data()), &written, to.size());
  if (result == LZMA_MEM_ERROR) failBlock(place, block, "liblzma is out of memory");
  if (result == LZMA_BUF_ERROR || (result == LZMA_OK && written != to.size()))
    failBlock(place, block, "its size differs from the table");
  if (result != LZMA_OK) failBlock(place, block, "not an LZMA stream");
}

/// Decompresses one zlib block of any size in pieces.
void spoolZlib(const CompressedBytes::Parts& parts, uint64_t block, uint64_t offset, uint64_t packed,
               uint64_t unpacked, const SpoolFile::Sink& sink) {
  Inflater inflater(parts.place, block);
  std::vector<std::byte> in(kPieceBytes), out(kPieceBytes);
  while (!inflater.ended()) {
    if (packed == 0) failBlock(parts.place, block, "it is truncated");
    const auto given = static_cast<size_t>(std::min<uint64_t>(packed, in.size()));
    parts.blocks->readAt(offset, std::span(in).first(given));
    inflater.give(std::span(in).first(given));
    offset += given;
    packed -= given;
    for (size_t bytes; (bytes = inflater.read(out)) > 0;) {
      if (bytes > unpacked) failBlock(parts.place, block, "it is larger than the table declares");
      sink(std::span(out).first(bytes));
      unpacked -= bytes;
    }
  }
  if (unpacked > 0) failBlock(parts.place, block, "it is smaller than the table declares");
}

uint64_t nextId() {
  static std::atomic<uint64_t> ids = 0;
  return ++ids;
}

/// The block that a thread decompressed last.
struct UnpackedBlock {
  uint64_t id = 0, block = 0;
  std::vector<std::byte> packed, bytes;
};

}  // namespace

uint64_t HeaderIntegers::at(const ByteSource& source, uint64_t offset) const {
  std::array<std::byte, 8> stored;
  source.readAt(offset, std::span(stored).first(bytes));
  return at(stored);
}

uint64_t HeaderIntegers::at(std::span<const std::byte> stored) const {
  const bool swap = order != kMachineByteOrder;
  return bytes == 8 ? loadStored<uint64_t>(stored.data(), swap) : loadStored<uint32_t>(stored.data(), swap);
}

CompressedBytes::CompressedBytes(Parts parts, uint64_t size)
    : id_(nextId()), parts_(std::move(parts)), size_(size) {
  const Table table = readTable(parts_, size);
  if (table.block_bytes > kLargestBlockInMemory)
    throw Error(
        "{}: has compressed blocks of {} bytes, which cannot be read in parts; write it with blocks of at "
        "most {} bytes (VTK's default is 32768), or with zlib",
        parts_.place, table.block_bytes, kLargestBlockInMemory);
  blocks_ = table.blocks;
  block_bytes_ = table.block_bytes;
  forEachBlock(parts_, table, [&](uint64_t block, uint64_t offset, uint64_t) {
    if (block % kTableStride == 0) offsets_.push_back(offset);
  });
}

uint64_t CompressedBytes::bytesOf(uint64_t block) const {
  return std::min(block_bytes_, size_ - block * block_bytes_);
}

CompressedBytes::Place CompressedBytes::placeOf(uint64_t block) const {
  const HeaderIntegers& integers = parts_.integers;
  const uint64_t first = block / kTableStride * kTableStride;
  std::array<std::byte, kTableStride * 8> piece;
  const auto bytes = std::span(piece).first(static_cast<size_t>((block - first + 1) * integers.bytes));
  parts_.table->readAt((3 + first) * integers.bytes, bytes);
  const auto packedBytes = [&](uint64_t n) {
    return integers.at(bytes.subspan(static_cast<size_t>((n - first) * integers.bytes)));
  };
  Place place{offsets_[block / kTableStride], 0};
  for (uint64_t n = first; n < block; ++n) place.offset += packedBytes(n);
  place.bytes = packedBytes(block);
  return place;
}

std::span<const std::byte> CompressedBytes::unpacked(uint64_t block) const {
  static const PerThread<UnpackedBlock> blocks;
  UnpackedBlock& kept = blocks.own();
  if (kept.id == id_ && kept.block == block) return kept.bytes;
  kept.id = 0;
  const Place place = placeOf(block);
  if (place.bytes > maxPackedBytes(bytesOf(block))) failBlock(parts_.place, block, "the file has changed");
  kept.packed.resize(static_cast<size_t>(place.bytes));
  kept.bytes.resize(static_cast<size_t>(bytesOf(block)));
  parts_.blocks->readAt(place.offset, kept.packed);
  switch (parts_.compressor) {
    case BlockCompressor::kZlib:
      unpackZlib(parts_.place, block, kept.packed, kept.bytes);
      break;
    case BlockCompressor::kLz4:
      unpackLz4(parts_.place, block, kept.packed, kept.bytes);
      break;
    case BlockCompressor::kLzma:
      unpackLzma(parts_.place, block, kept.packed, kept.bytes);
      break;
  }
  kept.id = id_;
  kept.block = block;
  return kept.bytes;
}

void CompressedBytes::readAt(uint64_t offset, std::span<std::byte> to) const {
  CURVISPLAT_CHECK(offset <= size_ && to.size() <= size_ - offset);
  while (!to.empty()) {
    const std::span<const std::byte> bytes = unpacked(offset / block_bytes_);
    const auto begin = static_cast<size_t>(offset % block_bytes_);
    const size_t count = std::min(to.size(), bytes.size() - begin);
    std::copy_n(bytes.begin() + static_cast<ptrdiff_t>(begin), count, to.begin());
    to = to.subspan(count);
    offset += count;
  }
}

std::shared_ptr<const ByteSource> compressedBytes(CompressedBytes::Parts parts, uint64_t size,
                                                  const std::shared_ptr<SpoolFile>& spool) {
  const Table table = readTable(parts, size);
  if (table.block_bytes <= kLargestBlockInMemory || parts.compressor != BlockCompressor::kZlib)
    return std::make_shared<CompressedBytes>(std::move(parts), size);
  forEachBlock(parts, table, [](uint64_t, uint64_t, uint64_t) {});
  return std::make_shared<SpooledBytes>(
      spool, size, [parts = std::move(parts), table](const SpoolFile::Sink& sink) {
        forEachBlock(parts, table, [&](uint64_t block, uint64_t offset, uint64_t bytes) {
          const bool last = block + 1 == table.blocks;
          spoolZlib(parts, block, offset, bytes, last ? table.last_bytes : table.block_bytes, sink);
        });
      });
}

}  // namespace curvisplat
