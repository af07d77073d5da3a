#include "tests/support/vts_writer.h"

#include <fmt/format.h>
#include <lz4.h>
#include <lzma.h>
#include <zlib.h>

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstring>

namespace curvisplat {
namespace {

using Format = VtsEncoding::Format;
using Compressor = VtsEncoding::Compressor;

template <typename Number>
void appendNumber(std::string& to, double value, bool big_endian) {
  const auto number = static_cast<Number>(value);
  char bytes[sizeof number];
  std::memcpy(bytes, &number, sizeof number);
  if (big_endian != (std::endian::native == std::endian::big)) std::reverse(bytes, bytes + sizeof number);
  to.append(bytes, sizeof number);
}

void appendAs(const std::string& type, std::string& to, double value, bool big_endian) {
  if (type == "Int8") appendNumber<int8_t>(to, value, big_endian);
  if (type == "UInt8") appendNumber<uint8_t>(to, value, big_endian);
  if (type == "Int16") appendNumber<int16_t>(to, value, big_endian);
  if (type == "UInt16") appendNumber<uint16_t>(to, value, big_endian);
  if (type == "Int32") appendNumber<int32_t>(to, value, big_endian);
  if (type == "UInt32") appendNumber<uint32_t>(to, value, big_endian);
  if (type == "Int64") appendNumber<int64_t>(to, value, big_endian);
  if (type == "UInt64") appendNumber<uint64_t>(to, value, big_endian);
  if (type == "Float32") appendNumber<float>(to, value, big_endian);
  if (type == "Float64") appendNumber<double>(to, value, big_endian);
}

std::string base64(const std::string& bytes) {
  static constexpr char kAlphabet[] = "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
  std::string text;
  for (size_t n = 0; n < bytes.size(); n += 3) {
    uint32_t bits = 0;
    for (size_t b = 0; b < 3; ++b)
      bits = bits << 8 | (n + b < bytes.size() ? static_cast<uint8_t>(bytes[n + b]) : 0);
    for (size_t c = 0; c < 4; ++c) text += n + c > bytes.size() ? '=' : kAlphabet[bits >> (18 - 6 * c) & 63];
  }
  return text;
}

std::string compressed(const std::string& bytes, Compressor compressor) {
  std::string packed;
  if (compressor == Compressor::kZlib) {
    uLongf size = compressBound(bytes.size());
    packed.resize(size);
    compress(reinterpret_cast<Bytef*>(packed.data()), &size, reinterpret_cast<const Bytef*>(bytes.data()),
             bytes.size());
    packed.resize(size);
  } else if (compressor == Compressor::kLzma) {
    size_t size = 0;
    packed.resize(lzma_stream_buffer_bound(bytes.size()));
    lzma_easy_buffer_encode(0, LZMA_CHECK_CRC32, nullptr, reinterpret_cast<const uint8_t*>(bytes.data()),
                            bytes.size(), reinterpret_cast<uint8_t*>(packed.data()), &size, packed.size());
    packed.resize(size);
  } else {
    packed.resize(static_cast<size_t>(LZ4_compressBound(static_cast<int>(bytes.size()))));
    packed.resize(static_cast<size_t>(LZ4_compress_default(
        bytes.data(), packed.data(), static_cast<int>(bytes.size()), static_cast<int>(packed.size()))));
  }
  return packed;
}

class VtsText {
 public:
  explicit VtsText(const VtsEncoding& encoding) : encoding_(encoding) {}

  std::string array(const VtsArray& array) {
    std::string text = fmt::format("        <DataArray type=\"{}\" Name=\"{}\" NumberOfComponents=\"{}\"",
                                   array.type, array.name, array.components);
    if (encoding_.format == Format::kAscii)
      return text + " format=\"ascii\">\n" + digits(array) + "</DataArray>\n";
    const std::string bytes = encoded(packedNumbers(array.values, array.type, encoding_.big_endian));
    if (encoding_.format == Format::kInlineBase64)
      return text + " format=\"binary\">\n          " + bytes + "\n        </DataArray>\n";
    text += fmt::format(" format=\"appended\" offset=\"{}\"/>\n", appended_.size());
    appended_ += bytes;
    return text;
  }

  const std::string& appended() const { return appended_; }

 private:
  static std::string digits(const VtsArray& array) {
    std::string text;
    for (size_t n = 0; n < array.values.size(); ++n) {
      const double value = array.values[n];
      text += array.type == "Float32"   ? fmt::format("{}", static_cast<float>(value))
              : array.type == "Float64" ? fmt::format("{}", value)
                                        : fmt::format("{}", static_cast<int64_t>(value));
      text += n % 6 == 5 ? '\n' : ' ';
    }
    return text;
  }

  void appendHeader(std::string& to, size_t value) const {
    appendAs(encoding_.header_bytes == 8 ? "UInt64" : "UInt32", to, static_cast<double>(value),
             encoding_.big_endian);
  }

  std::string encoded(const std::string& bytes) const {
    const bool text = encoding_.format != Format::kAppendedRaw;
    std::string header, data;
    if (encoding_.compressor == Compressor::kNone) {
      appendHeader(header, bytes.size());
      return text ? base64(header + bytes) : header + bytes;
    }
    const size_t block = encoding_.block_bytes, blocks = (bytes.size() + block - 1) / block;
    appendHeader(header, blocks);
    appendHeader(header, block);
    appendHeader(header, bytes.size() % block);
    for (size_t n = 0; n < blocks; ++n) {
      const std::string packed = compressed(bytes.substr(n * block, block), encoding_.compressor);
      appendHeader(header, packed.size());
      data += packed;
    }
    return text ? base64(header) + base64(data) : header + data;
  }

  const VtsEncoding& encoding_;
  std::string appended_;
};

}  // namespace

std::string VtsEncoding::describe() const {
  const char* const formats[] = {"ascii", "inline base64", "appended raw", "appended base64"};
  const char* const compressors[] = {"", " zlib", " lz4", " lzma"};
  return fmt::format("{}{} {}-bit {}", formats[static_cast<int>(format)],
                     compressors[static_cast<int>(compressor)], 8 * header_bytes,
                     big_endian ? "big" : "little");
}

std::string packedNumbers(const std::vector<double>& values, const std::string& type, bool big_endian) {
  std::string bytes;
  for (const double value : values) appendAs(type, bytes, value, big_endian);
  return bytes;
}

std::string vtsFile(const VtsGrid& grid, const VtsEncoding& encoding, size_t* data_begins) {
  const char* const compressors[] = {"", " compressor=\"vtkZLibDataCompressor\"",
                                     " compressor=\"vtkLZ4DataCompressor\"",
                                     " compressor=\"vtkLZMADataCompressor\""};
  const std::string extent = fmt::format("{}", fmt::join(grid.extent, " "));
  VtsText text(encoding);
  std::string file = fmt::format(
      "<?xml version=\"1.0\"?>\n<!-- a > b -->\n"
      "<VTKFile type=\"StructuredGrid\" version=\"1.0\" byte_order=\"{}Endian\" header_type=\"UInt{}\"{}>\n"
      "  <StructuredGrid WholeExtent=\"{}\">\n    <Piece Extent=\"{}\">\n      <PointData>\n",
      encoding.big_endian ? "Big" : "Little", 8 * encoding.header_bytes,
      compressors[static_cast<int>(encoding.compressor)], extent, extent);
  for (const VtsArray& array : grid.point_data) file += text.array(array);
  file += "      </PointData>\n      <CellData>\n";
  for (const VtsArray& array : grid.cell_data) file += text.array(array);
  file += "      </CellData>\n      <Points>\n" + text.array(grid.points);
  file += "      </Points>\n    </Piece>\n  </StructuredGrid>\n";
  if (!text.appended().empty()) {
    file += fmt::format("  <AppendedData encoding=\"{}\">\n   _",
                        encoding.format == Format::kAppendedRaw ? "raw" : "base64");
    if (data_begins) *data_begins = file.size();
    file += text.appended() + "\n  </AppendedData>\n";
  }
  return file + "</VTKFile>\n";
}

std::vector<VtsEncoding> allVtsEncodings() {
  std::vector<VtsEncoding> encodings = {{Format::kAscii}};
  for (const Format format : {Format::kInlineBase64, Format::kAppendedRaw, Format::kAppendedBase64})
    for (const Compressor compressor :
         {Compressor::kNone, Compressor::kZlib, Compressor::kLz4, Compressor::kLzma})
      for (const size_t header_bytes : {4, 8})
        for (const bool big_endian : {false, true})
          encodings.push_back({format, compressor, header_bytes, big_endian,
                               header_bytes == 4 ? size_t{1000} : size_t{1} << 15});
  return encodings;
}

VtsGrid annulusVtsGrid(int64_t ni, int64_t nj, int64_t nk, std::array<int64_t, 3> first) {
  VtsGrid grid;
  grid.extent = {first[0], first[0] + ni - 1, first[1], first[1] + nj - 1, first[2], first[2] + nk - 1};
  VtsArray p{"p", "Float32", 1, {}}, u{"U", "Float32", 3, {}}, id{"id", "Int32", 1, {}},
      t{"T", "Float32", 1, {}};
  for (int64_t k = first[2]; k < first[2] + nk; ++k)
    for (int64_t j = first[1]; j < first[1] + nj; ++j)
      for (int64_t i = first[0]; i < first[0] + ni; ++i) {
        const double a = 0.1 * static_cast<double>(i), r = 1 + 0.17 * static_cast<double>(j),
                     z = 0.3 * static_cast<double>(k) + 0.01 * a * r;
        for (const double x : {-r * std::sin(a), r * std::cos(a), z})
          grid.points.values.push_back(static_cast<float>(x));
        p.values.push_back(static_cast<float>(std::sin(a) + r * z));
        for (const double x : {r, a - z, -z}) u.values.push_back(static_cast<float>(x));
        id.values.push_back(static_cast<double>(i - 100 * j + 1000 * k));
        if (i < grid.extent[1] && j < grid.extent[3] && k < grid.extent[5])
          t.values.push_back(static_cast<float>(std::cos(a) + r - z));
      }
  grid.point_data = {p, u, id};
  grid.cell_data = {t};
  return grid;
}

}  // namespace curvisplat
