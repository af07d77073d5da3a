// PNG by libpng. libpng reports failure by longjmp, which must not skip C++ destructors: the functions here
// that call setjmp have no objects to destroy, and their callers own what they work on.
#include <png.h>

#include <algorithm>
#include <cmath>
#include <csetjmp>
#include <cstring>

#include "render/image/image_file.h"
#include "stream/base/error.h"

namespace curvisplat {
namespace {

// zlib compresses at most 1032 bytes into one.
constexpr uint64_t kLargestRatio = 1032;

struct Message {
  char text[200] = "";
};

[[noreturn]] void onError(png_structp png, png_const_charp text) {
  auto* message = static_cast<Message*>(png_get_error_ptr(png));
  std::strncpy(message->text, text, sizeof message->text - 1);
  std::longjmp(png_jmpbuf(png), 1);
}

void onWarning(png_structp, png_const_charp) {}  // warnings are about ancillary chunks, which are not used

struct PngWriter {
  Message message;
  png_structp png = png_create_write_struct(PNG_LIBPNG_VER_STRING, &message, onError, onWarning);
  png_infop info = png ? png_create_info_struct(png) : nullptr;

  PngWriter() {
    if (info == nullptr) throw std::bad_alloc();
  }
  ~PngWriter() { png_destroy_write_struct(&png, &info); }
  PngWriter(const PngWriter&) = delete;
  PngWriter& operator=(const PngWriter&) = delete;
};

struct PngReader {
  Message message;
  std::span<const std::byte> left;
  png_structp png = png_create_read_struct(PNG_LIBPNG_VER_STRING, &message, onError, onWarning);
  png_infop info = png ? png_create_info_struct(png) : nullptr;

  explicit PngReader(std::span<const std::byte> bytes) : left(bytes) {
    if (info == nullptr) throw std::bad_alloc();
  }
  ~PngReader() { png_destroy_read_struct(&png, &info, nullptr); }
  PngReader(const PngReader&) = delete;
  PngReader& operator=(const PngReader&) = delete;
};

void appendBytes(png_structp png, png_bytep from, size_t count) {
  bool appended = true;
  try {
    auto& bytes = *static_cast<Bytes*>(png_get_io_ptr(png));
    const auto* begin = reinterpret_cast<const std::byte*>(from);
    bytes.insert(bytes.end(), begin, begin + count);
  } catch (...) {  // an exception must not cross libpng
    appended = false;
  }
  if (!appended) png_error(png, "out of memory");
}

void takeBytes(png_structp png, png_bytep to, size_t count) {
  auto& left = static_cast<PngReader*>(png_get_io_ptr(png))->left;
  if (count > left.size()) png_error(png, "the file is truncated");
  std::memcpy(to, left.data(), count);
  left = left.subspan(count);
}

void writeRow(const Image& image, int y, bool opaque, png_bytep row) {
  for (int x = 0; x < image.size.width; ++x) {
    const float* const pixel = image.pixel(x, y);
    const float alpha = pixel[3];
    for (size_t c = 0; c < 3; ++c) *row++ = toByte(alpha > 0 ? pixel[c] / alpha : 0);
    if (!opaque) *row++ = toByte(alpha);
  }
}

bool writeAll(PngWriter& writer, Bytes& out, const Image& image, PngEffort effort, png_bytep row) {
  if (setjmp(png_jmpbuf(writer.png))) return false;
  const bool opaque = isOpaque(image);
  png_set_write_fn(writer.png, &out, appendBytes, nullptr);
  png_set_user_limits(writer.png, kLargestImageSide, kLargestImageSide);
  if (effort == PngEffort::kQuick) {
    png_set_compression_level(writer.png, 1);
    png_set_filter(writer.png, PNG_FILTER_TYPE_BASE, PNG_FILTER_SUB);
  }
  png_set_IHDR(writer.png, writer.info, static_cast<png_uint_32>(image.size.width),
               static_cast<png_uint_32>(image.size.height), 8,
               opaque ? PNG_COLOR_TYPE_RGB : PNG_COLOR_TYPE_RGB_ALPHA, PNG_INTERLACE_NONE,
               PNG_COMPRESSION_TYPE_DEFAULT, PNG_FILTER_TYPE_DEFAULT);
  png_write_info(writer.png, writer.info);
  for (int y = 0; y < image.size.height; ++y) {
    writeRow(image, y, opaque, row);
    png_write_row(writer.png, row);
  }
  png_write_end(writer.png, nullptr);
  return true;
}

// Reads up to the pixels, and has libpng convert them to red, green, blue and alpha of 8 or 16 bits.
bool readHeader(PngReader& reader) {
  if (setjmp(png_jmpbuf(reader.png))) return false;
  png_set_read_fn(reader.png, &reader, takeBytes);
  png_set_user_limits(reader.png, kLargestImageSide, kLargestImageSide);
  png_set_chunk_malloc_max(reader.png, 8 << 20);
  png_read_info(reader.png, reader.info);
  png_set_expand(reader.png);
  png_set_gray_to_rgb(reader.png);
  png_set_add_alpha(reader.png, 0xffff, PNG_FILLER_AFTER);
  png_set_interlace_handling(reader.png);
  png_read_update_info(reader.png, reader.info);
  return true;
}

bool readPixels(PngReader& reader, png_bytepp rows) {
  if (setjmp(png_jmpbuf(reader.png))) return false;
  png_read_image(reader.png, rows);
  png_read_end(reader.png, nullptr);
  return true;
}

std::vector<png_bytep> rowPointers(std::vector<png_byte>& pixels, size_t rows) {
  std::vector<png_bytep> pointers(rows);
  for (size_t y = 0; y < rows; ++y) pointers[y] = pixels.data() + y * (pixels.size() / rows);
  return pointers;
}

}  // namespace

Bytes encodePng(const Image& image) {
  return encodePng(image, PngEffort::kUsual);
}

Bytes encodePng(const Image& image, PngEffort effort) {
  std::vector<png_byte> row(4 * static_cast<size_t>(image.size.width));
  PngWriter writer;
  Bytes bytes;
  bytes.reserve(4 * image.size.pixels() + image.size.pixels() / 128 + (64 << 10));  // never grows by copying
  if (!writeAll(writer, bytes, image, effort, row.data()))
    throw Error("an image of {} x {} pixels cannot be written as PNG: {}", image.size.width,
                image.size.height, writer.message.text);
  return bytes;
}

/// Does without libpng, which would first complain of a header whose checksum is wrong, too.
ImageSize sizeOfPng(std::span<const std::byte> bytes, const std::string& name) {
  constexpr size_t kHeader = 24;  // 8 bytes of signature, of length and name, and of the size, big-endian
  if (bytes.size() < kHeader) throw Error("{}: the PNG header is truncated", name);
  const auto number = [&](size_t at) {
    int64_t value = 0;
    for (size_t n = 0; n < 4; ++n) value = 256 * value + std::to_integer<int64_t>(bytes[at + n]);
    return value;
  };
  const int64_t width = number(16), height = number(20);
  requirePossibleSize(width, height, name);
  return {static_cast<int>(width), static_cast<int>(height)};
}

Image decodePng(std::span<const std::byte> bytes, const std::string& name) {
  PngReader reader(bytes);
  if (!readHeader(reader)) throw Error("{}: the PNG header cannot be read: {}", name, reader.message.text);
  const auto width = static_cast<int>(png_get_image_width(reader.png, reader.info));
  const auto height = static_cast<int>(png_get_image_height(reader.png, reader.info));
  const bool wide = png_get_bit_depth(reader.png, reader.info) == 16;
  // A pixel may take a single bit in the file: eight pixels then fit each byte that zlib compresses.
  requirePlausibleSize(width, height, 1, bytes.size(), 8 * kLargestRatio, name);

  const size_t row_bytes = png_get_rowbytes(reader.png, reader.info);
  if (row_bytes != static_cast<size_t>(width) * (wide ? 8 : 4))
    throw Error("{}: the PNG file's rows have {} bytes; expected {} pixels of {} bytes", name, row_bytes,
                width, wide ? 8 : 4);
  std::vector<png_byte> pixels(row_bytes * static_cast<size_t>(height));
  auto rows = rowPointers(pixels, static_cast<size_t>(height));
  if (!readPixels(reader, rows.data()))
    throw Error("{}: the PNG file's pixels cannot be read: {}", name, reader.message.text);

  Image image({width, height});
  for (size_t n = 0; n < image.rgba.size(); ++n)
    image.rgba[n] = wide ? static_cast<float>(pixels[2 * n] * 256 + pixels[2 * n + 1]) / 65535
                         : static_cast<float>(pixels[n]) / 255;
  for (size_t n = 0; n < image.rgba.size(); n += 4)
    for (size_t c = 0; c < 3; ++c) image.rgba[n + c] *= image.rgba[n + 3];
  return image;
}

}  // namespace curvisplat
