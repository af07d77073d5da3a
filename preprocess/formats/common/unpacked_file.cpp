#include "preprocess/formats/common/unpacked_file.h"

#include <fmt/format.h>
#include <lzma.h>
#include <zlib.h>
#include <zstd.h>
#include <zstd_errors.h>

#include <array>
#include <functional>
#include <string_view>
#include <vector>

#include "preprocess/formats/common/byte_source.h"
#include "stream/base/disk_space.h"

namespace curvisplat {
namespace {

using namespace std::string_view_literals;
namespace fs = std::filesystem;

constexpr size_t kPackedBytesAtOnce = size_t{1} << 20;
constexpr std::string_view kGzip = "\x1f\x8b"sv,
                           kXz =
                               "\xfd"
                               "7zXZ\0"sv,
                           kZstd = "\x28\xb5\x2f\xfd"sv;

/// The bytes of the compressed file, in order.
class Input {
 public:
  explicit Input(const InputFile& file) : file_(file), buffer_(kPackedBytesAtOnce) {}

  /// The next bytes; empty at the end.
  std::span<std::byte> next() {
    const auto count = static_cast<size_t>(std::min<uint64_t>(buffer_.size(), file_.size() - at_));
    const std::span<std::byte> bytes(buffer_.data(), count);
    file_.readAt(at_, bytes);
    at_ += count;
    return bytes;
  }
  bool ended() const { return at_ == file_.size(); }

  [[noreturn]] void fail(std::string_view format, std::string_view reason) const {
    throw Error("{}: cannot be decompressed as {}: {}; if the file is damaged, copy it again",
                file_.path().string(), format, reason);
  }
  /// The file is whole, but cannot be decompressed here.
  [[noreturn]] void refuse(std::string_view format, std::string_view reason) const {
    throw Error("{}: cannot be decompressed as {}: {}", file_.path().string(), format, reason);
  }

 private:
  const InputFile& file_;
  std::vector<std::byte> buffer_;
  uint64_t at_ = 0;
};

using Sink = std::function<void(std::span<const std::byte>)>;

struct GzipStream {
  z_stream stream{};
  GzipStream() { open = inflateInit2(&stream, 15 + 16) == Z_OK; }
  ~GzipStream() { inflateEnd(&stream); }
  GzipStream(const GzipStream&) = delete;
  GzipStream& operator=(const GzipStream&) = delete;
  bool open = false;
};

void unpackGzip(Input& input, const Sink& sink) {
  GzipStream gzip;
  if (!gzip.open) input.fail("gzip", "no memory");
  std::vector<std::byte> out(kPackedBytesAtOnce);
  bool complete = false;
  for (std::span<std::byte> in = input.next(); !in.empty(); in = input.next()) {
    gzip.stream.next_in = reinterpret_cast<Bytef*>(in.data());
    gzip.stream.avail_in = static_cast<uInt>(in.size());
    do {
      // A file may have several members, one after another; zeros may follow the last.
      if (complete && *gzip.stream.next_in == 0) return;
      if (complete) inflateReset(&gzip.stream);
      gzip.stream.next_out = reinterpret_cast<Bytef*>(out.data());
      gzip.stream.avail_out = static_cast<uInt>(out.size());
      const int status = inflate(&gzip.stream, Z_NO_FLUSH);
      if (status != Z_OK && status != Z_STREAM_END && status != Z_BUF_ERROR)
        input.fail("gzip", gzip.stream.msg ? gzip.stream.msg : "its data is wrong");
      complete = status == Z_STREAM_END;
      sink({out.data(), out.size() - gzip.stream.avail_out});
      // Past the end of a member there is nothing to come, though the buffer is full.
    } while (gzip.stream.avail_in > 0 || (gzip.stream.avail_out == 0 && !complete));
  }
  if (!complete) input.fail("gzip", "it ends early");
}

struct XzStream {
  lzma_stream stream = LZMA_STREAM_INIT;
  XzStream() = default;
  ~XzStream() { lzma_end(&stream); }
  XzStream(const XzStream&) = delete;
  XzStream& operator=(const XzStream&) = delete;
};

void unpackXz(Input& input, const Sink& sink) {
  XzStream xz;
  if (lzma_stream_decoder(&xz.stream, kUnpackingMemory, LZMA_CONCATENATED) != LZMA_OK)
    input.fail("xz", "no memory");
  std::vector<std::byte> out(kPackedBytesAtOnce);
  lzma_ret status = LZMA_OK;
  while (status != LZMA_STREAM_END) {
    if (xz.stream.avail_in == 0 && !input.ended()) {
      const std::span<std::byte> in = input.next();
      xz.stream.next_in = reinterpret_cast<const uint8_t*>(in.data());
      xz.stream.avail_in = in.size();
    }
    xz.stream.next_out = reinterpret_cast<uint8_t*>(out.data());
    xz.stream.avail_out = out.size();
    status = lzma_code(&xz.stream, input.ended() ? LZMA_FINISH : LZMA_RUN);
    if (status == LZMA_MEMLIMIT_ERROR)
      input.refuse("xz", fmt::format("it needs more than {} MiB of memory; compress it again with "
                                     "--lzma2=dict=64MiB or less",
                                     kUnpackingMemory >> 20));
    if (status == LZMA_BUF_ERROR) input.fail("xz", "it ends early");
    if (status != LZMA_OK && status != LZMA_STREAM_END) input.fail("xz", "its data is wrong");
    sink({out.data(), out.size() - xz.stream.avail_out});
  }
}

[[noreturn]] void failAtZstd(const Input& input, size_t code) {
  switch (ZSTD_getErrorCode(code)) {
    case ZSTD_error_frameParameter_windowTooLarge:
      input.refuse("zstd", "it needs more than 128 MiB of memory; compress it again without --long");
    case ZSTD_error_dictionary_wrong:
      input.refuse("zstd", "it needs a dictionary; compress it again without one");
    case ZSTD_error_memory_allocation:
      input.refuse("zstd", "no memory");
    default:
      input.fail("zstd", ZSTD_getErrorName(code));
  }
}

void unpackZstd(Input& input, const Sink& sink) {
  const std::unique_ptr<ZSTD_DStream, decltype(&ZSTD_freeDStream)> zstd(ZSTD_createDStream(),
                                                                        &ZSTD_freeDStream);
  if (!zstd) input.fail("zstd", "no memory");
  std::vector<std::byte> out(kPackedBytesAtOnce);
  size_t left = 1;
  for (std::span<std::byte> bytes = input.next(); !bytes.empty(); bytes = input.next()) {
    ZSTD_inBuffer from{bytes.data(), bytes.size(), 0};
    bool full = false;
    while (from.pos < from.size || full) {
      ZSTD_outBuffer to{out.data(), out.size(), 0};
      left = ZSTD_decompressStream(zstd.get(), &to, &from);
      if (ZSTD_isError(left)) failAtZstd(input, left);
      sink({out.data(), to.pos});
      full = to.pos == to.size &&
             left != 0;  // 0: the frame is complete; a call without input would begin another
    }
  }
  if (left != 0) input.fail("zstd", "it ends early");
}

}  // namespace

bool UnpackedFile::recognises(const InputFile& file) {
  const std::string begin = beginningOf(file, kXz.size());
  return begin.starts_with(kGzip) || begin.starts_with(kXz) || begin.starts_with(kZstd);
}

UnpackedFile::UnpackedFile(const fs::path& path, const fs::path& folder)
    : original_(path), folder_(folder, ".unpacked"), path_(folder_.path() / path.stem()) {
  const InputFile file(path);
  Input input(file);
  OutputFile out(path_);
  const Sink sink = [&](std::span<const std::byte> bytes) { out.append(bytes); };
  const std::string begin = beginningOf(file, kXz.size());
  try {
    begin.starts_with(kGzip) ? unpackGzip(input, sink)
    : begin.starts_with(kXz) ? unpackXz(input, sink)
                             : unpackZstd(input, sink);
  } catch (const DiskFull& full) {
    throw OutputError("{}: is decompressed into {}, where there is no room: {}; make room there",
                      path.string(), folder.string(), full.reason());
  }
}

}  // namespace curvisplat
