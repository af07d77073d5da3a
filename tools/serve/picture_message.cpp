#include "tools/serve/picture_message.h"

#include <jpeglib.h>

#include <algorithm>
#include <array>
#include <bit>
#include <csetjmp>
#include <cstddef>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <vector>

#include "render/image/image_file.h"
#include "stream/base/error.h"

namespace curvisplat {
namespace {

constexpr double kLateSeconds = 0.12;   // beyond the line's own delay
constexpr double kEarlySeconds = 0.04;  // beyond it
constexpr double kTooLongSeconds = 1;   // no line's own delay
constexpr int kInTimeToRefine = 12;
constexpr size_t kLately = 100;

// Each level has about half the bytes of the one before.
constexpr std::array<PictureQuality, LineQuality::kCoarsest + 1> kLevels{
    {{90, 1}, {75, 1}, {50, 1}, {60, 2}, {35, 2}, {50, 4}, {25, 4}}};

}  // namespace

PictureQuality LineQuality::quality() const {
  return kLevels[static_cast<size_t>(level_)];
}

void LineQuality::sent(uint64_t picture, double now_s, bool counts, uint64_t bytes) {
  // One that does not count holds up those behind it.
  const bool held_up = std::any_of(sent_.begin(), sent_.end(), [](const Sent& one) { return !one.counts; });
  sent_.push_back({picture, bytes, now_s, counts && !held_up});
  bytes_ += bytes;
}

void LineQuality::shown(uint64_t picture, double now_s) {
  const auto found =
      std::find_if(sent_.begin(), sent_.end(), [&](const Sent& one) { return one.picture == picture; });
  if (found == sent_.end()) return;
  const bool counts = found->counts;
  const double delay_s = now_s - found->at_s;
  for (auto one = sent_.begin(); one <= found; ++one) bytes_ -= one->bytes;
  sent_.erase(sent_.begin(), found + 1);
  if (counts) learn(delay_s);
}

void LineQuality::learn(double delay_s) {
  delays_.push_back(delay_s);
  if (delays_.size() > kLately) delays_.pop_front();
  const double over_s = delay_s - *std::min_element(delays_.begin(), delays_.end());
  ++since_change_;
  in_time_ = over_s < kEarlySeconds ? in_time_ + 1 : 0;
  int level = level_;
  // Pictures that were on their way at the last change say nothing about this level.
  if ((over_s > kLateSeconds || delay_s > kTooLongSeconds) && since_change_ > static_cast<int>(kMaxOnTheWay))
    level = std::min(kCoarsest, level_ + 1);
  else if (in_time_ >= kInTimeToRefine)
    level = std::max(0, level_ - 1);
  if (level == level_) return;
  level_ = level;
  in_time_ = since_change_ = 0;
}

namespace {

static_assert(std::endian::native == std::endian::little);

// libjpeg reports failure by a call that must not return: as for PNG in render/image, the functions here
// that call setjmp have no objects to destroy.
struct JpegErrors : jpeg_error_mgr {
  std::jmp_buf stop;
  char text[JMSG_LENGTH_MAX] = "";
};

[[noreturn]] void onError(j_common_ptr jpeg) {
  auto* const errors = static_cast<JpegErrors*>(jpeg->err);
  errors->format_message(jpeg, errors->text);
  std::longjmp(errors->stop, 1);
}

/// Owns the compressor, and the memory that it writes to.
struct JpegWriter {
  JpegErrors errors;
  jpeg_compress_struct jpeg{};
  unsigned char* bytes = nullptr;
  unsigned long size = 0;

  JpegWriter() {
    jpeg.err = jpeg_std_error(&errors);
    errors.error_exit = onError;
  }
  ~JpegWriter() {
    jpeg_destroy_compress(&jpeg);
    std::free(bytes);
  }
  JpegWriter(const JpegWriter&) = delete;
  JpegWriter& operator=(const JpegWriter&) = delete;
};

/// The picture that is encoded, a row at a time in red, green and blue.
class ByteRows {
 public:
  ByteRows(const Image& image, int reduction)
      : size{std::max(1, image.size.width / reduction), std::max(1, image.size.height / reduction)},
        image_(image),
        reduction_(reduction),
        row_(3 * static_cast<size_t>(size.width)) {}

  /// Valid until the next call.
  unsigned char* row(int y) {
    reduction_ > 1 ? reduce(y) : convert(y);
    return row_.data();
  }

  const ImageSize size;

 private:
  /// The mean of each `reduction` x `reduction` pixels; those that are left over at the right and below are
  /// left out.
  void reduce(int y) {
    const int columns = std::min(reduction_, image_.size.width),
              rows = std::min(reduction_, image_.size.height);
    const float share = 1 / static_cast<float>(columns * rows);
    unsigned char* to = row_.data();
    for (int x = 0; x < size.width; ++x)
      for (int c = 0; c < 3; ++c) {
        float sum = 0;
        for (int v = 0; v < rows; ++v)
          for (int u = 0; u < columns; ++u) sum += image_.pixel(x * reduction_ + u, y * reduction_ + v)[c];
        *to++ = toByte(sum * share);
      }
  }

  /// Converts a row without toByte(): a loop that the compiler turns into vector instructions.
  void convert(int y) {
    const float* const from = image_.pixel(0, y);
    for (size_t x = 0; x < row_.size() / 3; ++x)
      for (size_t c = 0; c < 3; ++c)
        row_[3 * x + c] =
            static_cast<unsigned char>(std::min(1.0f, std::max(0.0f, from[4 * x + c])) * 255 + 0.5f);
  }

  const Image& image_;
  const int reduction_;
  std::vector<unsigned char> row_;
};

bool writeAll(JpegWriter& writer, ByteRows& picture, int quality) {
  if (setjmp(writer.errors.stop)) return false;
  jpeg_create_compress(&writer.jpeg);
  jpeg_mem_dest(&writer.jpeg, &writer.bytes, &writer.size);
  writer.jpeg.image_width = static_cast<JDIMENSION>(picture.size.width);
  writer.jpeg.image_height = static_cast<JDIMENSION>(picture.size.height);
  writer.jpeg.input_components = 3;
  writer.jpeg.in_color_space = JCS_RGB;
  jpeg_set_defaults(&writer.jpeg);
  jpeg_set_quality(&writer.jpeg, quality, TRUE);
  writer.jpeg.dct_method = JDCT_IFAST;
  jpeg_start_compress(&writer.jpeg, TRUE);
  while (writer.jpeg.next_scanline < writer.jpeg.image_height) {
    JSAMPROW row = picture.row(static_cast<int>(writer.jpeg.next_scanline));
    jpeg_write_scanlines(&writer.jpeg, &row, 1);
  }
  jpeg_finish_compress(&writer.jpeg);
  return true;
}

template <typename T>
void put(std::string& bytes, size_t at, const T& value) {
  std::memcpy(bytes.data() + at, &value, sizeof value);
}

std::string message(const PictureHeader& header, const void* file, size_t file_bytes) {
  std::string bytes(kPictureHeaderBytes + file_bytes, '\0');
  std::memcpy(bytes.data(), "CVP1", 4);
  put(bytes, 4, header.picture);
  put(bytes, 8, header.request);
  put(bytes, 16, header.step);
  put(bytes, 20, static_cast<uint16_t>(header.size.width));
  put(bytes, 22, static_cast<uint16_t>(header.size.height));
  put(bytes, 24, static_cast<uint8_t>(header.is_png));
  put(bytes, 25, static_cast<uint8_t>(header.is_final));
  put(bytes, 26, header.level);
  put(bytes, 28, header.seconds);
  put(bytes, 32, header.error_px);
  put(bytes, 36, header.splats);
  put(bytes, 40, static_cast<uint16_t>(header.data_width));
  std::memcpy(bytes.data() + kPictureHeaderBytes, file, file_bytes);
  return bytes;
}

}  // namespace

uint64_t messageBytes(ImageSize size) {
  // Four bytes a pixel that cannot be compressed, and what zlib adds to them: 1/1000 of it, and some for each row.
  return 4 * size.pixels() + size.pixels() / 128 + 64 * static_cast<uint64_t>(size.height) + (64 << 10);
}

std::string losslessMessage(const PictureHeader& header, const Image& image) {
  const Bytes file = encodePng(image, PngEffort::kQuick);
  return message(header, file.data(), file.size());
}

std::string jpegMessage(const PictureHeader& header, const Image& image, const PictureQuality& quality) {
  ByteRows picture(image, quality.reduction);
  JpegWriter writer;
  if (!writeAll(writer, picture, quality.jpeg))
    throw Error("a picture of {} x {} pixels cannot be written as JPEG: {}", picture.size.width,
                picture.size.height, writer.errors.text);
  return message(header, writer.bytes, writer.size);
}

}  // namespace curvisplat
