#include "stream/codec/planes.h"

#include <zstd.h>

#include <algorithm>
#include <bit>
#include <memory>
#include <new>

#include "stream/base/error.h"
#include "stream/base/threads.h"

namespace curvisplat {
namespace {

// Level 1 compresses these planes as well as level 3 (they resemble noise, not text), at twice the speed.
constexpr int kZstdLevel = 1;
// Shorter planes share a block: a block's header and tables would cost more than they save.
constexpr size_t kSmallestBlock = 2048;

/// A context of zstd. `make` and `free`: zstd's functions for its kind.
template <typename Kind, Kind* (*make)(), size_t (*free)(Kind*)>
class Context {
 public:
  Context() : context_(make()) {
    if (!context_) throw std::bad_alloc();
  }
  ~Context() { free(context_); }
  Context(const Context&) = delete;
  Context& operator=(const Context&) = delete;

  Kind* get() const { return context_; }

 private:
  Kind* context_;
};

ZSTD_CCtx* compressor() {
  static const PerThread<Context<ZSTD_CCtx, ZSTD_createCCtx, ZSTD_freeCCtx>> context;
  return context.own().get();
}

ZSTD_DCtx* decompressor() {
  static const PerThread<Context<ZSTD_DCtx, ZSTD_createDCtx, ZSTD_freeDCtx>> context;
  return context.own().get();
}

size_t checked(size_t result) {
  // The parameters are valid and the output is large enough, so the only possible error is lack of memory.
  if (ZSTD_isError(result)) throw std::bad_alloc();
  return result;
}

}  // namespace

void PlaneWriter::addBytes(std::span<const std::byte> bytes) {
  bytes_.insert(bytes_.end(), bytes.begin(), bytes.end());
  ends_.push_back(bytes_.size());
}

uint8_t PlaneWriter::add(std::span<const uint32_t> values) {
  uint32_t any = 0;
  for (uint32_t value : values) any |= value;
  const auto planes = static_cast<uint8_t>((std::bit_width(any) + 7) / 8);
  constexpr size_t kPlanesOfMost = 8;  // room for some arrays at once
  if (bytes_.capacity() - bytes_.size() < planes * values.size())
    bytes_.reserve(bytes_.size() + kPlanesOfMost * values.size());
  for (int plane = 0; plane < planes; ++plane) {
    const size_t from = bytes_.size();
    bytes_.resize(from + values.size());
    std::byte* to = bytes_.data() + from;
    for (size_t n = 0; n < values.size(); ++n) to[n] = static_cast<std::byte>(values[n] >> (8 * plane));
    ends_.push_back(bytes_.size());
  }
  return planes;
}

std::vector<std::byte> PlaneWriter::compress(std::span<const std::byte> header) const {
  ZSTD_CCtx* context = compressor();
  checked(ZSTD_CCtx_reset(context, ZSTD_reset_session_and_parameters));
  checked(ZSTD_CCtx_setParameter(context, ZSTD_c_compressionLevel, kZstdLevel));
  checked(ZSTD_CCtx_setPledgedSrcSize(context, bytes_.size()));

  // Each flushed block adds three bytes of header and whatever zstd had buffered. What is returned has no such room, since
  // many bricks wait for being written.
  static const PerThread<std::vector<std::byte>> packed;
  std::vector<std::byte>& scratch = packed.own();
  const size_t most = ZSTD_compressBound(bytes_.size()) + 64 * (ends_.size() + 1);
  if (scratch.size() < most) scratch.resize(most);
  ZSTD_outBuffer to{scratch.data(), most, 0};
  size_t from = 0;
  for (size_t n = 0; n < ends_.size(); ++n) {
    const bool last = n + 1 == ends_.size();
    if (!last && ends_[n] - from < kSmallestBlock) continue;
    ZSTD_inBuffer plane{bytes_.data() + from, ends_[n] - from, 0};
    const size_t left = checked(ZSTD_compressStream2(context, &to, &plane, last ? ZSTD_e_end : ZSTD_e_flush));
    CURVISPLAT_CHECK_OP(left, ==, 0u);
    from = ends_[n];
  }
  if (ends_.empty()) {
    ZSTD_inBuffer nothing{nullptr, 0, 0};
    CURVISPLAT_CHECK_OP(checked(ZSTD_compressStream2(context, &to, &nothing, ZSTD_e_end)), ==, 0u);
  }
  std::vector<std::byte> out;
  out.reserve(header.size() + to.pos);
  out.insert(out.end(), header.begin(), header.end());
  out.insert(out.end(), scratch.begin(), scratch.begin() + static_cast<ptrdiff_t>(to.pos));
  return out;
}

PlaneReader::PlaneReader(std::span<const std::byte> frame, size_t unpacked_bytes) {
  const unsigned long long stated = ZSTD_getFrameContentSize(frame.data(), frame.size());
  if (stated != unpacked_bytes)
    throw Error("it does not begin with a zstd frame of {} unpacked bytes", unpacked_bytes);
  static const PerThread<std::vector<std::byte>> unpacked;
  std::vector<std::byte>& scratch = unpacked.own();
  if (scratch.size() < unpacked_bytes) scratch.resize(unpacked_bytes);
  const size_t got =
      ZSTD_decompressDCtx(decompressor(), scratch.data(), unpacked_bytes, frame.data(), frame.size());
  if (ZSTD_isError(got)) throw Error("zstd cannot unpack it: {}", ZSTD_getErrorName(got));
  if (got != unpacked_bytes) throw Error("it unpacks to {} bytes (expected {})", got, unpacked_bytes);
  rest_ = std::span(scratch).first(unpacked_bytes);
}

std::span<const std::byte> PlaneReader::bytes(size_t count) {
  if (count > rest_.size()) throw Error("it is truncated");
  const auto taken = rest_.first(count);
  rest_ = rest_.subspan(count);
  return taken;
}

void PlaneReader::values(uint8_t planes, std::span<uint32_t> values) {
  CURVISPLAT_CHECK_OP(planes, <=, 4);
  const size_t count = values.size();
  const auto* p = reinterpret_cast<const uint8_t*>(bytes(planes * count).data());
  uint32_t* v = values.data();
  switch (planes) {
    case 0:
      std::fill_n(v, count, 0u);
      break;
    case 1:
      for (size_t n = 0; n < count; ++n) v[n] = p[n];
      break;
    case 2:
      for (size_t n = 0; n < count; ++n) v[n] = p[n] | uint32_t{p[n + count]} << 8;
      break;
    case 3:
      for (size_t n = 0; n < count; ++n)
        v[n] = p[n] | uint32_t{p[n + count]} << 8 | uint32_t{p[n + 2 * count]} << 16;
      break;
    default:
      for (size_t n = 0; n < count; ++n)
        v[n] = p[n] | uint32_t{p[n + count]} << 8 | uint32_t{p[n + 2 * count]} << 16 |
               uint32_t{p[n + 3 * count]} << 24;
  }
}

void appendVarint(std::vector<std::byte>& bytes, uint64_t value) {
  for (; value >= 0x80; value >>= 7) bytes.push_back(static_cast<std::byte>(value | 0x80));
  bytes.push_back(static_cast<std::byte>(value));
}

uint64_t takeVarint(std::span<const std::byte>& bytes) {
  uint64_t value = 0;
  for (int shift = 0; shift < 70; shift += 7) {
    if (bytes.empty()) throw Error("a varint is truncated");
    const auto byte = static_cast<uint64_t>(bytes.front());
    bytes = bytes.subspan(1);
    if (shift == 63 && byte > 1) break;
    value |= (byte & 0x7f) << shift;
    if (byte < 0x80) return value;
  }
  throw Error("a varint exceeds 64 bits");
}

}  // namespace curvisplat
