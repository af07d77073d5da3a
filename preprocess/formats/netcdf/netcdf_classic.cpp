#include "preprocess/formats/netcdf/netcdf_classic.h"

#include <netcdf.h>

#include <algorithm>
#include <array>
#include <cstdint>
#include <span>
#include <vector>

#include "stream/base/error.h"

namespace curvisplat {
namespace {

constexpr uint64_t kBlock = 1 << 16;

/// Reads the big-endian numbers of a header in sequence.
class HeaderCursor {
 public:
  explicit HeaderCursor(const InputFile& file) : file_(file) {}

  uint64_t number(size_t bytes) {
    uint64_t value = 0;
    for (size_t n = 0; n < bytes; ++n) value = value << 8 | next();
    return value;
  }

  /// Skips `bytes`, rounded up to a multiple of 4.
  void skip(uint64_t bytes) {
    if (bytes > file_.size() - position_) end();
    position_ += bytes;
    while (position_ % 4 != 0) next();
  }

  [[noreturn]] void damaged(const char* what) const {
    throw Error("{}: its NetCDF header has {} before byte {}; the file is damaged: copy or write it again",
                file_.path().string(), what, position_);
  }

 private:
  uint8_t next() {
    if (position_ == file_.size()) end();
    if (position_ / kBlock != block_number_) {
      block_number_ = position_ / kBlock;
      block_.resize(std::min(kBlock, file_.size() - block_number_ * kBlock));
      file_.readAt(block_number_ * kBlock, std::span<uint8_t>(block_));
    }
    return block_[position_++ % kBlock];
  }

  [[noreturn]] void end() const {
    throw Error("{}: ends at byte {}, inside its NetCDF header; it is truncated: copy or write it again",
                file_.path().string(), file_.size());
  }

  const InputFile& file_;
  uint64_t position_ = 0;
  uint64_t block_number_ = ~uint64_t{0};
  std::vector<uint8_t> block_;
};

struct Variable {
  double record_bytes;  // of one record, or of the whole variable if it has no records
  double begin;
  bool in_records;
};

class Header {
 public:
  explicit Header(const InputFile& file) : cursor_(file) {
    cursor_.number(3);  // "CDF"
    version_ = cursor_.number(1);
    count_bytes_ = version_ == 5 ? 8 : 4;
    offset_bytes_ = version_ == 1 ? 4 : 8;
    records_ = count();
    const bool unknown = records_ == (count_bytes_ == 4 ? 0xffffffffu : ~uint64_t{0});
    for (uint64_t n = listed(0x0a); n > 0; --n) {
      skipName();
      dimensions_.push_back(count());
    }
    skipAttributes();
    for (uint64_t n = listed(0x0b); n > 0; --n) readVariable();
    if (unknown) records_ = recordsIn(static_cast<double>(file.size()));
  }

  uint64_t records() const { return records_; }

  /// The end of the last value.
  double bytes() const {
    const double record = recordBytes();
    double end = 0;
    for (const Variable& variable : variables_) {
      if (variable.in_records && records_ == 0) continue;
      const double before = variable.in_records ? static_cast<double>(records_ - 1) * record : 0;
      end = std::max(end, variable.begin + before + variable.record_bytes);
    }
    return end;
  }

 private:
  static double padded(double bytes) {
    return static_cast<double>((static_cast<uint64_t>(std::min(bytes, 1e18)) + 3) / 4 * 4);
  }

  /// Of all variables together.
  double recordBytes() const {
    const auto in_records = [](const Variable& variable) { return variable.in_records; };
    const bool one = std::count_if(variables_.begin(), variables_.end(), in_records) == 1;
    double bytes = 0;
    for (const Variable& variable : variables_)
      if (variable.in_records) bytes += one ? variable.record_bytes : padded(variable.record_bytes);
    return bytes;
  }

  /// Of a file that is still being written, whose header does not count them: those that are complete.
  uint64_t recordsIn(double file_bytes) const {
    double begin = file_bytes;  // of the first record
    for (const Variable& variable : variables_)
      if (variable.in_records) begin = std::min(begin, variable.begin);
    const double record = recordBytes();
    return record > 0 ? static_cast<uint64_t>(std::max(0.0, file_bytes - begin) / record) : 0;
  }

  uint64_t count() { return cursor_.number(count_bytes_); }
  void skipName() {
    const uint64_t characters = count();
    // The library copies longer ones beyond its callers' buffers.
    if (characters > NC_MAX_NAME) cursor_.damaged("a name longer than 256 characters");
    cursor_.skip(characters);
  }

  /// The number of entries of a list; the list may be absent.
  uint64_t listed(uint64_t tag) {
    const uint64_t found = cursor_.number(4), entries = count();
    if (found != tag && !(found == 0 && entries == 0)) cursor_.damaged("an unknown list tag");
    return entries;
  }

  uint64_t typeBytes() {
    constexpr std::array<uint64_t, 12> kBytes{0, 1, 1, 2, 4, 4, 8, 1, 2, 4, 8, 8};  // byte, char, short, ...
    const uint64_t type = cursor_.number(4);
    if (type == 0 || type >= kBytes.size()) cursor_.damaged("an unknown type");
    return kBytes[type];
  }

  void skipAttributes() {
    for (uint64_t n = listed(0x0c); n > 0; --n) {
      skipName();
      const uint64_t bytes = typeBytes(), values = count();
      if (values > uint64_t{1} << 40) cursor_.damaged("an attribute of impossible length");
      cursor_.skip(values * bytes);
    }
  }

  void readVariable() {
    Variable variable{1, 0, false};
    skipName();
    const uint64_t dimensions = count();
    for (uint64_t n = 0; n < dimensions; ++n) {
      const uint64_t id = count();
      if (id >= dimensions_.size()) cursor_.damaged("an unknown dimension");
      if (n == 0 && dimensions_[id] == 0)
        variable.in_records = true;
      else
        variable.record_bytes *= static_cast<double>(dimensions_[id]);
    }
    skipAttributes();
    variable.record_bytes *= static_cast<double>(typeBytes());
    count();  // vsize: redundant, and wrong for large variables
    variable.begin = static_cast<double>(cursor_.number(offset_bytes_));
    variables_.push_back(variable);
  }

  HeaderCursor cursor_;
  uint64_t version_ = 0, records_ = 0;
  size_t count_bytes_ = 4, offset_bytes_ = 4;
  std::vector<uint64_t> dimensions_;  // lengths; 0: the record dimension
  std::vector<Variable> variables_;
};

}  // namespace

uint64_t checkClassicNetcdf(const InputFile& file) {
  const Header header(file);
  const double bytes = header.bytes();
  if (bytes > static_cast<double>(file.size()))
    throw Error("{}: is truncated or damaged (found {} bytes, expected {:.0f}); copy or write it again",
                file.path().string(), file.size(), bytes);
  return header.records();
}

}  // namespace curvisplat
