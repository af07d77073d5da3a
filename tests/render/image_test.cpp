#include "render/image/image.h"
#include "render/image/image_file.h"

#include <gtest/gtest.h>
#include <png.h>
#include <tinyexr.h>

#include <cstdio>  // before jpeglib.h, which needs it

#include <jpeglib.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstring>
#include <limits>
#include <random>

#include "stream/base/error.h"
#include "stream/base/file.h"
#include "tests/support/expect_error.h"
#include "tests/support/temporary_folder.h"

namespace curvisplat {
namespace {

Image randomImage(ImageSize size, bool opaque, unsigned seed) {
  std::mt19937 random(seed);
  std::uniform_real_distribution<float> unit(0, 1);
  Image image(size);
  for (size_t n = 0; n < image.rgba.size(); n += 4) {
    image.rgba[n + 3] = opaque ? 1 : unit(random);
    for (size_t c = 0; c < 3; ++c) image.rgba[n + c] = unit(random) * image.rgba[n + 3];
  }
  return image;
}

std::span<const std::byte> asBytes(const std::string& text) {
  return std::as_bytes(std::span(text));
}

Bytes prefixOf(const Bytes& bytes, size_t length) {
  return {bytes.begin(), bytes.begin() + static_cast<std::ptrdiff_t>(length)};
}

using Decode = Image (*)(std::span<const std::byte>, const std::string&);

// Any byte may be anything: an error or a picture, never a crash (the sanitizers look on) nor much memory.
void expectToSurviveFlippedBits(const Bytes& bytes, Decode decode) {
  std::mt19937 random(5);
  for (int n = 0; n < 3000; ++n) {
    Bytes damaged = bytes;
    // Half of the damage goes to the header, where the sizes are.
    const size_t end = n % 2 == 0 ? std::min<size_t>(bytes.size(), 400) : bytes.size();
    for (int flips = 0; flips < 1 + n % 3; ++flips)
      damaged[random() % end] ^= static_cast<std::byte>(1u << random() % 8);
    try {
      const Image image = decode(damaged, "damaged");
      EXPECT_LE(image.rgba.size(), size_t{4} * 8 * 1032 * bytes.size());
    } catch (const Error&) {
    }
  }
}

struct FormatCase {
  const char* name;
  Bytes (*encode)(const Image&);
  Decode decode;
  bool exact;
  bool has_alpha;
};

class EveryFormat : public testing::TestWithParam<FormatCase> {};
INSTANTIATE_TEST_SUITE_P(Formats, EveryFormat,
                         testing::Values(FormatCase{"png", encodePng, decodePng, false, true},
                                         FormatCase{"exr", encodeExr, decodeExr, true, true},
                                         FormatCase{"pfm", encodePfm, decodePfm, true, false}),
                         [](const auto& format) { return std::string(format.param.name); });

TEST_P(EveryFormat, RoundTrips) {
  const FormatCase& format = GetParam();
  for (const ImageSize size : {ImageSize{1, 1}, ImageSize{7, 3}, ImageSize{33, 50}})
    for (const bool opaque : {true, false}) {
      if (!opaque && !format.has_alpha) continue;
      const Image image = randomImage(size, opaque, 1);
      const Image back = format.decode(format.encode(image), "back");
      ASSERT_EQ(back.size.width, size.width);
      ASSERT_EQ(back.size.height, size.height);
      for (size_t n = 0; n < image.rgba.size(); ++n) {
        if (format.exact)
          ASSERT_EQ(back.rgba[n], image.rgba[n]);
        else
          ASSERT_NEAR(back.rgba[n], image.rgba[n], 1.01 / 255);
      }
    }
}

TEST_P(EveryFormat, GivesTheSameBytesAgain) {
  const Image image = randomImage({19, 11}, !GetParam().has_alpha, 2);
  EXPECT_EQ(GetParam().encode(image), GetParam().encode(image));
}

TEST_P(EveryFormat, RefusesEveryTruncatedPrefix) {
  const Bytes bytes = GetParam().encode(randomImage({9, 21}, true, 3));
  for (size_t length = 0; length < bytes.size(); ++length)
    EXPECT_THROW(GetParam().decode(prefixOf(bytes, length), "prefix"), Error) << length;
}

TEST_P(EveryFormat, SurvivesFlippedBits) {
  expectToSurviveFlippedBits(GetParam().encode(randomImage({9, 21}, true, 4)), GetParam().decode);
}

TEST(Png, KeepsEightBitValuesExactly) {
  Image image({256, 1});
  for (int x = 0; x < 256; ++x) {
    const float value = static_cast<float>(x) / 255;
    const std::array<float, 4> pixel{value, 1 - value, 0.5f, 1};
    std::copy(pixel.begin(), pixel.end(), image.pixel(x, 0));
  }
  const Image back = decodePng(encodePng(image), "back");
  for (int x = 0; x < 256; ++x) EXPECT_EQ(back.pixel(x, 0)[0], image.pixel(x, 0)[0]);
  EXPECT_EQ(back.pixel(0, 0)[2], 128.0f / 255);
}

TEST(Png, ClampsWhatItCannotHold) {
  Image image({1, 1});
  image.rgba = {-1, 2, std::numeric_limits<float>::quiet_NaN(), 1};
  EXPECT_EQ(decodePng(encodePng(image), "back").rgba, (std::vector<float>{0, 1, 0, 1}));
}

// A PNG file as other programs write it, by libpng's other interface.
Bytes simplePng(png_uint_32 format, int width, const void* pixels, const void* palette = nullptr,
                png_uint_32 palette_entries = 0) {
  png_image image{};
  image.version = PNG_IMAGE_VERSION;
  image.format = format;
  image.width = static_cast<png_uint_32>(width);
  image.height = 1;
  image.colormap_entries = palette_entries;
  png_alloc_size_t size = 0;
  EXPECT_TRUE(png_image_write_to_memory(&image, nullptr, &size, 0, pixels, 0, palette));
  Bytes bytes(size);
  EXPECT_TRUE(png_image_write_to_memory(&image, bytes.data(), &size, 0, pixels, 0, palette));
  return bytes;
}

TEST(Png, ReadsGrey) {
  const std::array<png_byte, 2> pixels{51, 255};
  const Image image = decodePng(simplePng(PNG_FORMAT_GRAY, 2, pixels.data()), "grey");
  EXPECT_EQ(image.rgba, (std::vector<float>{0.2f, 0.2f, 0.2f, 1, 1, 1, 1, 1}));
}

TEST(Png, ReadsPaletteWithTransparency) {
  const std::array<png_byte, 3> pixels{1, 0, 1};
  const std::array<png_byte, 8> palette{255, 0, 0, 255, 0, 255, 0, 51};
  const Image image =
      decodePng(simplePng(PNG_FORMAT_RGBA_COLORMAP, 3, pixels.data(), palette.data(), 2), "palette");
  EXPECT_EQ(image.rgba, (std::vector<float>{0, 0.2f, 0, 0.2f, 1, 0, 0, 1, 0, 0.2f, 0, 0.2f}));
}

TEST(Png, ReadsSixteenBits) {
  const std::array<uint16_t, 3> pixels{0, 1000, 65535};
  const Image image = decodePng(simplePng(PNG_FORMAT_LINEAR_RGB, 1, pixels.data()), "wide");
  EXPECT_EQ(image.rgba, (std::vector<float>{0, 1000.0f / 65535, 1, 1}));
}

// An image whose channels are all `values`.
Bytes exrWith(int compression, bool half, int width, int height, std::vector<float> values) {
  EXRHeader header;
  InitEXRHeader(&header);
  std::array<EXRChannelInfo, 3> channels{};
  for (size_t c = 0; c < 3; ++c) channels[c].name[0] = "BGR"[c];
  std::array<int, 3> given, stored;
  given.fill(TINYEXR_PIXELTYPE_FLOAT);
  stored.fill(half ? TINYEXR_PIXELTYPE_HALF : TINYEXR_PIXELTYPE_FLOAT);
  header.num_channels = 3;
  header.channels = channels.data();
  header.pixel_types = given.data();
  header.requested_pixel_types = stored.data();
  header.compression_type = compression;
  EXRImage image;
  InitEXRImage(&image);
  std::array<unsigned char*, 3> planes;
  planes.fill(reinterpret_cast<unsigned char*>(values.data()));
  image.num_channels = 3;
  image.images = planes.data();
  image.width = width;
  image.height = height;
  unsigned char* memory = nullptr;
  const char* message = nullptr;
  const size_t size = SaveEXRImageToMemory(&image, &header, &memory, &message);
  EXPECT_GT(size, 0u);
  const auto* begin = reinterpret_cast<const std::byte*>(memory);
  Bytes bytes(begin, begin + size);
  std::free(memory);
  return bytes;
}

TEST(Exr, ReadsOtherCompressionsAndHalves) {
  const int width = 5, height = 37;
  std::vector<float> values;
  for (int n = 0; n < width * height; ++n) values.push_back(static_cast<float>(n % 64) / 64);
  for (const int compression : {TINYEXR_COMPRESSIONTYPE_NONE, TINYEXR_COMPRESSIONTYPE_RLE,
                                TINYEXR_COMPRESSIONTYPE_ZIPS, TINYEXR_COMPRESSIONTYPE_ZIP})
    for (const bool half : {false, true}) {
      const Bytes bytes = exrWith(compression, half, width, height, values);
      const Image image = decodeExr(bytes, "exr");
      for (size_t n = 0; n < values.size(); ++n) {
        for (size_t c = 0; c < 3; ++c)
          ASSERT_EQ(image.rgba[4 * n + c], values[n]) << compression << " " << half;
        ASSERT_EQ(image.rgba[4 * n + 3], 1);
      }
      for (size_t length = 0; length < bytes.size(); length += 7)
        EXPECT_THROW(decodeExr(prefixOf(bytes, length), "prefix"), Error);
      expectToSurviveFlippedBits(bytes, decodeExr);
    }
}

TEST(Exr, RefusesAChunkThatIsTooShort) {
  const int width = 5, height = 3;
  Bytes bytes = exrWith(TINYEXR_COMPRESSIONTYPE_NONE, false, width, height, std::vector<float>(15, 0.5f));
  ASSERT_NO_THROW(decodeExr(bytes, "whole"));
  // The last chunk: line, size, pixels.
  const size_t size_at = bytes.size() - width * 12 - 4;
  ASSERT_EQ(bytes[size_at], std::byte{width * 12});
  bytes[size_at] = std::byte{width * 12 - 4};
  expectError([&] { decodeExr(bytes, "short"); }, {"chunk 2"});
}

TEST(Exr, RefusesWhatItDoesNotCheck) {
  const std::vector<float> values(64 * 64, 0.5f);
  EXPECT_THROW(decodeExr(exrWith(TINYEXR_COMPRESSIONTYPE_PIZ, true, 64, 64, values), "piz"), Error);
}

TEST(Pfm, ReadsBothByteOrdersAndGrey) {
  // 2 x 1 grey pixels: 1 and -2.
  const std::string big = std::string("Pf\n2 1\n1.0\n") + std::string("\x3f\x80\0\0\xc0\0\0\0", 8);
  EXPECT_EQ(decodePfm(asBytes(big), "big").rgba, (std::vector<float>{1, 1, 1, 1, -2, -2, -2, 1}));
  const std::string little = std::string("Pf\n2 1\n-1.0\n") + std::string("\0\0\x80\x3f\0\0\0\xc0", 8);
  EXPECT_EQ(decodePfm(asBytes(little), "little").rgba, (std::vector<float>{1, 1, 1, 1, -2, -2, -2, 1}));
}

TEST(Pfm, HasItsRowsFromTheBottom) {
  Image image({1, 2});
  image.rgba = {1, 2, 3, 1, 4, 5, 6, 1};
  const Bytes bytes = encodePfm(image);
  std::array<float, 3> last;
  std::memcpy(last.data(), bytes.data() + bytes.size() - 12, 12);
  EXPECT_EQ(last, (std::array<float, 3>{1, 2, 3}));
}

TEST(Pfm, RefusesWrongHeaders) {
  const std::string pixel(12, '\0');
  for (const char* header : {"PF\n0 1\n-1\n", "PF\n-1 -1\n-1\n", "PF\n1 1\n0\n", "PF\n1 1\nnan\n",
                             "PF\n1.5 1\n-1\n", "PF\n99999999999 1\n-1\n", "PF\n65536 65536\n-1\n"})
    EXPECT_THROW(decodePfm(asBytes(header + pixel), "pfm"), Error) << header;
  EXPECT_NO_THROW(decodePfm(asBytes("PF\n1 1\n-1\n" + pixel), "pfm"));
  EXPECT_THROW(decodePfm(asBytes("PF\n1 1\n-1\n" + pixel + "x"), "pfm"), Error);
}

/// An image as libjpeg writes it: colours in full resolution, or grey.
Bytes jpegOf(const Image& image, bool progressive, bool grey = false,
             const std::vector<jpeg_scan_info>& scans = {}) {
  jpeg_compress_struct jpeg{};
  jpeg_error_mgr errors{};
  jpeg.err = jpeg_std_error(&errors);
  jpeg_create_compress(&jpeg);
  unsigned char* memory = nullptr;
  unsigned long size = 0;
  jpeg_mem_dest(&jpeg, &memory, &size);
  jpeg.image_width = static_cast<JDIMENSION>(image.size.width);
  jpeg.image_height = static_cast<JDIMENSION>(image.size.height);
  jpeg.input_components = grey ? 1 : 3;
  jpeg.in_color_space = grey ? JCS_GRAYSCALE : JCS_RGB;
  jpeg_set_defaults(&jpeg);
  jpeg_set_quality(&jpeg, 98, TRUE);
  jpeg.comp_info[0].h_samp_factor = jpeg.comp_info[0].v_samp_factor = 1;
  if (progressive) jpeg_simple_progression(&jpeg);
  if (!scans.empty()) {
    jpeg.scan_info = scans.data();
    jpeg.num_scans = static_cast<int>(scans.size());
  }
  jpeg_start_compress(&jpeg, TRUE);
  for (int y = 0; y < image.size.height; ++y) {
    std::vector<JSAMPLE> row;
    for (int x = 0; x < image.size.width; ++x)
      for (int c = 0; c < jpeg.input_components; ++c) row.push_back(toByte(image.pixel(x, y)[c]));
    JSAMPROW rows = row.data();
    jpeg_write_scanlines(&jpeg, &rows, 1);
  }
  jpeg_finish_compress(&jpeg);
  jpeg_destroy_compress(&jpeg);
  const auto* begin = reinterpret_cast<const std::byte*>(memory);
  Bytes bytes(begin, begin + size);
  std::free(memory);
  return bytes;
}

Image slopes(ImageSize size) {
  Image image(size);
  for (int y = 0; y < size.height; ++y)
    for (int x = 0; x < size.width; ++x) {
      const auto across = static_cast<float>(x) / static_cast<float>(size.width),
                 down = static_cast<float>(y) / static_cast<float>(size.height);
      const std::array<float, 4> pixel{across, down, 1 - across, 1};
      std::copy(pixel.begin(), pixel.end(), image.pixel(x, y));
    }
  return image;
}

TEST(Jpeg, ReadsColoursAndGrey) {
  const Image image = slopes({37, 19});
  for (const bool progressive : {false, true}) {
    const Image read = decodeJpeg(jpegOf(image, progressive), "a.jpg");
    ASSERT_EQ(read.size, image.size);
    for (size_t n = 0; n < image.rgba.size(); ++n) ASSERT_NEAR(read.rgba[n], image.rgba[n], 6.0 / 255) << n;
    const Image grey = decodeJpeg(jpegOf(image, progressive, true), "a.jpg");
    for (size_t n = 0; n < image.rgba.size(); n += 4)
      for (size_t c = 0; c < 3; ++c) ASSERT_NEAR(grey.rgba[n + c], image.rgba[n], 6.0 / 255) << n;
  }
}

TEST(Jpeg, RefusesEveryTruncatedPrefixAndSurvivesFlippedBits) {
  for (const bool progressive : {false, true}) {
    const Bytes bytes = jpegOf(slopes({21, 18}), progressive);
    for (size_t length = 0; length < bytes.size(); ++length)
      EXPECT_THROW(decodeJpeg(prefixOf(bytes, length), "prefix"), Error) << length;
    expectToSurviveFlippedBits(bytes, decodeJpeg);
  }
}

/// Programs write other numbers into headers than libjpeg knows.
TEST(Jpeg, ReadsUnknownRevisionsAndTransforms) {
  const Bytes bytes = jpegOf(slopes({21, 18}), false);
  const std::vector<float> expected = decodeJpeg(bytes, "a.jpg").rgba;
  Bytes revision = bytes;
  revision.at(11) = std::byte{2};  // the major one of JFIF
  EXPECT_EQ(decodeJpeg(revision, "a.jpg").rgba, expected);
  // A marker of Adobe in place of that of JFIF, with the transform 9.
  const std::string adobe(
      "\xff\xee\0\x0e"
      "Adobe\0\x64\0\0\0\0\x09",
      16);
  Bytes transform = prefixOf(bytes, 2);
  for (const char letter : adobe) transform.push_back(static_cast<std::byte>(letter));
  transform.insert(transform.end(), bytes.begin() + 20, bytes.end());
  EXPECT_EQ(decodeJpeg(transform, "a.jpg").rgba, expected);
}

/// A scan of a few bytes goes through all pixels: a short file would take hours.
TEST(Jpeg, RefusesTooManyScans) {
  const auto scansOf = [](int bits) {  // each coefficient in a scan of its own, and each of its last bits
    std::vector<jpeg_scan_info> scans{{1, {0}, 0, 0, 0, 0}};
    for (int low = bits; low >= 0; --low)
      for (int n = 1; n < 64; ++n) scans.push_back({1, {0}, n, n, low == bits ? 0 : low + 1, low});
    return scans;
  };
  EXPECT_EQ(decodeJpeg(jpegOf(slopes({16, 16}), false, true, scansOf(1)), "a.jpg").size, (ImageSize{16, 16}));
  expectError(
      [&] {
        decodeJpeg(jpegOf(slopes({16, 16}), false, true, scansOf(3)), "a.jpg");
      },
      {"a.jpg: the JPEG file's pixels cannot be read: it has too many scans"});
}

TEST(ImageFiles, HaveTheirSizeInTheHeader) {
  const TemporaryFolder folder;
  const Image image = slopes({14, 6});
  for (const char* name : {"a.png", "a.exr", "a.pfm"}) {
    writeImage(image, folder / name);
    EXPECT_EQ(readImageSize(folder / name), image.size) << name;
    // Behind the header anything may be missing.
    writeFileAtomically(folder / name, readTextFile(folder / name).substr(0, 400));
    EXPECT_EQ(readImageSize(folder / name), image.size) << name;
    writeFileAtomically(folder / name, readTextFile(folder / name).substr(0, 9));
    EXPECT_THROW(readImageSize(folder / name), Error) << name;
  }
  const Bytes jpeg = jpegOf(image, false);
  EXPECT_EQ(sizeOfJpeg(jpeg, "a.jpg"), image.size);
  EXPECT_THROW(sizeOfJpeg(prefixOf(jpeg, 30), "a.jpg"), Error);
  writeFileAtomically(folder / "a.jpg", std::string(reinterpret_cast<const char*>(jpeg.data()), jpeg.size()));
  EXPECT_EQ(readImage(folder / "a.jpg").size, image.size);
  EXPECT_EQ(readImageSize(folder / "a.jpg"), image.size);
  // Comments of 5 MB come before the size.
  std::string commented("\xff\xd8", 2);
  for (int n = 0; n < 80; ++n) commented += std::string("\xff\xfe\xff\xff", 4) + std::string(65533, ' ');
  commented.append(reinterpret_cast<const char*>(jpeg.data()) + 2, jpeg.size() - 2);
  writeFileAtomically(folder / "a.jpg", commented);
  expectError([&] { readImageSize(folder / "a.jpg"); },
              {"the JPEG header cannot be read: ", " (headers of at most 4194304 bytes are read)"});
  EXPECT_EQ(readImage(folder / "a.jpg").size, image.size);
  writeFileAtomically(folder / "a.pfm", std::string("PF\n70000 1\n-1\n"));
  EXPECT_THROW(readImageSize(folder / "a.pfm"), Error);
}

TEST(ImageFiles, AreKnownByTheirBytes) {
  const TemporaryFolder folder;
  const Image image = randomImage({4, 4}, true, 6);
  for (const char* name : {"a.png", "a.EXR", "a.pfm"}) {
    writeImage(image, folder / name);
    EXPECT_EQ(readImage(folder / name).size.width, 4);
  }
  writeFileAtomically(folder / "a.png", std::string("not an image"));
  EXPECT_THROW(readImage(folder / "a.png"), Error);
  writeFileAtomically(folder / "a.png", std::string());
  EXPECT_THROW(readImage(folder / "a.png"), Error);
  EXPECT_THROW(readImage(folder / "missing.png"), Error);
}

TEST(ImageFiles, RefuseOtherEndings) {
  EXPECT_NO_THROW(checkImageName("a.b/c.Png"));
  for (const char* name : {"a.jpg", "a", "png", "a.png.gz"}) EXPECT_THROW(checkImageName(name), UsageError);
  EXPECT_THROW(writeImage(Image({1, 1}), "a.gif"), UsageError);
}

TEST(CompareImages, KnowsPsnrAndTheWorstPixel) {
  Image a({10, 10}), b({10, 10});
  for (Image* image : {&a, &b})
    for (size_t n = 3; n < image->rgba.size(); n += 4) image->rgba[n] = 1;
  EXPECT_EQ(compareImages(a, b).psnr_db, std::numeric_limits<double>::infinity());
  b.pixel(3, 7)[1] = 0.5f;
  const ImageDifference difference = compareImages(a, b);
  EXPECT_NEAR(difference.psnr_db, 10 * std::log10(300 / 0.25), 1e-9);
  EXPECT_EQ(difference.largest, 0.5);
  EXPECT_EQ(difference.largest_x, 3);
  EXPECT_EQ(difference.largest_y, 7);
}

TEST(CompareImages, ComparesOverWhite) {
  Image clear({1, 1}), white({1, 1});
  white.rgba = {1, 1, 1, 1};
  EXPECT_EQ(compareImages(clear, white).largest, 0);
}

TEST(CompareImages, RefusesOtherSizesAndNaN) {
  EXPECT_THROW(compareImages(Image({1, 2}), Image({2, 1})), Error);
  Image broken({1, 1});
  broken.rgba[0] = std::numeric_limits<float>::quiet_NaN();
  EXPECT_THROW(compareImages(broken, Image({1, 1})), Error);
}

}  // namespace
}  // namespace curvisplat
