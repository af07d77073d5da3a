// JPEG by libjpeg, to be read: maps often come so. libjpeg reports failure by a call that must not return: as for PNG, the
// functions here that call setjmp have no objects to destroy, and their callers own what they work on.
#include <cstdio>  // before jpeglib.h, which needs it

#include <jpeglib.h>

#include <jerror.h>  // after jpeglib.h, whose version numbers its messages

#include <csetjmp>
#include <cstring>
#include <vector>

#include "render/image/image_file.h"
#include "stream/base/error.h"

namespace curvisplat {
namespace {

// A block of 8 x 8 pixels takes a bit or more in one of the scans, but for runs of empty ones.
constexpr uint64_t kLargestJpegRatio = 4096;
constexpr int kMaxScans = 200;  // of progressive files: each goes through all pixels, and usual ones have ten

struct JpegErrors : jpeg_error_mgr {
  std::jmp_buf stop;
  bool in_header = false;
  char text[JMSG_LENGTH_MAX] = "";
};

[[noreturn]] void onError(j_common_ptr jpeg) {
  auto* const errors = static_cast<JpegErrors*>(jpeg->err);
  errors->format_message(jpeg, errors->text);
  std::longjmp(errors->stop, 1);
}

/// Warnings are of damaged data, which would become grey pixels. Those of a header are accepted, unless it
/// ends early: they are of revisions and transforms that libjpeg does not know.
void onMessage(j_common_ptr jpeg, int level) {
  const auto* const errors = static_cast<const JpegErrors*>(jpeg->err);
  if (level < 0 && (!errors->in_header || errors->msg_code == JWRN_JPEG_EOF)) onError(jpeg);
}

void onProgress(j_common_ptr jpeg) {
  if (reinterpret_cast<j_decompress_ptr>(jpeg)->input_scan_number <= kMaxScans) return;
  auto* const errors = static_cast<JpegErrors*>(jpeg->err);
  std::strncpy(errors->text, "it has too many scans", sizeof errors->text - 1);
  std::longjmp(errors->stop, 1);
}

struct JpegReader {
  JpegErrors errors;
  jpeg_progress_mgr progress{};
  jpeg_decompress_struct jpeg{};

  JpegReader() {
    jpeg.err = jpeg_std_error(&errors);
    errors.error_exit = onError;
    errors.emit_message = onMessage;
    progress.progress_monitor = onProgress;
  }
  ~JpegReader() { jpeg_destroy_decompress(&jpeg); }
  JpegReader(const JpegReader&) = delete;
  JpegReader& operator=(const JpegReader&) = delete;
};

bool readJpegHeader(JpegReader& reader, std::span<const std::byte> bytes) {
  if (setjmp(reader.errors.stop)) return false;
  jpeg_create_decompress(&reader.jpeg);
  reader.jpeg.progress = &reader.progress;
  jpeg_mem_src(&reader.jpeg, reinterpret_cast<const unsigned char*>(bytes.data()), bytes.size());
  reader.errors.in_header = true;
  jpeg_read_header(&reader.jpeg, TRUE);
  reader.errors.in_header = false;
  return true;
}

bool readJpegPixels(JpegReader& reader, JSAMPROW row, Image& image) {
  if (setjmp(reader.errors.stop)) return false;
  reader.jpeg.out_color_space = JCS_RGB;
  jpeg_start_decompress(&reader.jpeg);
  for (int y = 0; y < image.size.height; ++y) {
    jpeg_read_scanlines(&reader.jpeg, &row, 1);
    float* pixel = image.pixel(0, y);
    for (int x = 0; x < image.size.width; ++x, pixel += 4) {
      for (int c = 0; c < 3; ++c) pixel[c] = static_cast<float>(row[3 * x + c]) / 255;
      pixel[3] = 1;
    }
  }
  jpeg_finish_decompress(&reader.jpeg);
  return true;
}

ImageSize takeHeader(JpegReader& reader, std::span<const std::byte> bytes, const std::string& name) {
  if (!readJpegHeader(reader, bytes))
    throw Error("{}: the JPEG header cannot be read: {}{}", name, reader.errors.text, limitOfHeader(bytes));
  return {static_cast<int>(reader.jpeg.image_width), static_cast<int>(reader.jpeg.image_height)};
}

}  // namespace

ImageSize sizeOfJpeg(std::span<const std::byte> bytes, const std::string& name) {
  JpegReader reader;
  return takeHeader(reader, bytes, name);
}

Image decodeJpeg(std::span<const std::byte> bytes, const std::string& name) {
  JpegReader reader;
  const ImageSize size = takeHeader(reader, bytes, name);
  requirePlausibleSize(size.width, size.height, 1, bytes.size(), kLargestJpegRatio, name);
  Image image(size);
  std::vector<JSAMPLE> row(3 * static_cast<size_t>(size.width));
  if (!readJpegPixels(reader, row.data(), image))
    throw Error("{}: the JPEG file's pixels cannot be read: {}", name, reader.errors.text);
  return image;
}

}  // namespace curvisplat
