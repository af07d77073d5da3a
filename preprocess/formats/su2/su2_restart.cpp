#include "preprocess/formats/su2/su2_restart.h"

#include <algorithm>
#include <array>
#include <string_view>

#include "preprocess/formats/common/ascii_spool.h"
#include "preprocess/formats/common/stored_values.h"
#include "preprocess/formats/common/text_reader.h"
#include "stream/base/error.h"
#include "stream/base/words.h"

namespace curvisplat {
namespace {

constexpr int32_t kMagic = 535532;
constexpr size_t kNameBytes = 33, kHeadBytes = 5 * sizeof(int32_t);
constexpr int32_t kMaxVariables = 10'000;

/// The fields of a line: separated by commas, or by tabs and spaces; quotes are left out.
std::vector<std::string_view> fieldsOf(std::string_view line) {
  const bool commas = line.find(',') != std::string_view::npos;
  const std::string_view separators = commas ? "," : " \t";
  std::vector<std::string_view> fields;
  for (size_t at = 0; at < line.size();) {
    const size_t quote = line.find_first_not_of(kWhiteSpace, at);
    const bool quoted = quote != std::string_view::npos && line[quote] == '"';
    const size_t closing = quoted ? std::min(line.find('"', quote + 1), line.size()) : at;
    const size_t end = std::min(line.find_first_of(separators, closing), line.size());
    const std::string_view field =
        trimmed(quoted ? line.substr(quote + 1, closing - quote - 1) : line.substr(at, end - at));
    if (!field.empty()) fields.push_back(field);
    at = end + 1;
  }
  return fields;
}

}  // namespace

Su2Restart::Su2Restart(std::shared_ptr<const PooledFile> file, uint64_t points,
                       const std::filesystem::path& folder)
    : file_(std::move(file)) {
  std::array<std::byte, sizeof(int32_t)> begin{};
  if (file_->size() >= begin.size()) file_->readAt(0, begin);
  swap_ = loadStored<int32_t>(begin.data(), true) == kMagic;
  binary_ = swap_ || loadStored<int32_t>(begin.data(), false) == kMagic;
  binary_ ? openBinary(points) : readText(points, folder);
  if (names_.empty()) throw Error("{}: has no variables besides positions", file_->name());
}

void Su2Restart::keepNames(const std::vector<std::string>& all) {
  stride_ = all.size();
  for (size_t n = 0; n < all.size(); ++n) {
    const std::string& name = all[n];
    if (name.empty() || name == "PointID" || name == "x" || name == "y" || name == "z") continue;
    names_.push_back(printable(name));
    columns_.push_back(n);
  }
}

void Su2Restart::openBinary(uint64_t points) {
  if (file_->size() < kHeadBytes)
    throw Error("{}: is truncated (found {} bytes)", file_->name(), file_->size());
  std::array<std::byte, kHeadBytes> head{};
  file_->readAt(0, head);
  const auto variables = loadStored<int32_t>(head.data() + 4, swap_);
  const auto stored = loadStored<int32_t>(head.data() + 8, swap_);
  if (variables < 1 || variables > kMaxVariables || stored < 0 || static_cast<uint64_t>(stored) != points)
    throw Error("{}: has {} variables at {} points; expected some at {}, the mesh's", file_->name(),
                variables, stored, points);
  const auto count = static_cast<size_t>(variables);
  data_ = kHeadBytes + count * kNameBytes;
  if (file_->size() < data_ || (file_->size() - data_) / sizeof(double) / count < points)
    throw Error("{}: is truncated (found {} bytes, expected {} variables at {} points)", file_->name(),
                file_->size(), variables, points);
  std::vector<char> text(count * kNameBytes);
  file_->readAt(kHeadBytes, std::as_writable_bytes(std::span(text)));
  std::vector<std::string> names;
  for (size_t n = 0; n < count; ++n) {
    const std::string name(text.data() + n * kNameBytes, kNameBytes);
    names.push_back(name.substr(0, name.find('\0')));
  }
  keepNames(names);
}

void Su2Restart::readText(uint64_t points, const std::filesystem::path& folder) {
  TextReader text(file_, 0, file_->size());
  const auto header = text.line();
  std::vector<std::string> names;
  if (header)
    for (const std::string_view field : fieldsOf(*header)) names.emplace_back(field);
  if (names.size() < 2 || std::any_of(names.begin(), names.end(), [](const std::string& name) {
        double number = 0;
        return parseNumber(name, number);
      }))
    throw Error("{}: is not a restart file of SU2; expected the variables' names, or the number 535532",
                file_->name());
  keepNames(names);
  NumberSpool<double> values(folder);
  for (uint64_t point = 0; point < points; ++point) {
    const auto line = text.line();
    if (!line) throw Error("{}: has {} points; expected {}, the mesh's", file_->name(), point, points);
    const std::vector<std::string_view> fields = fieldsOf(*line);
    double value = 0;
    for (size_t n = 0; n < stride_; ++n) {
      if (n >= fields.size() || !parseNumber(fields[n], value))
        throw Error("{}: line {} has {} fields, or one that is not a number; expected {} numbers",
                    file_->name(), point + 2, fields.size(), stride_);
      if (names[n] == "PointID" && value != static_cast<double>(point))
        throw Error("{}: line {} is of point {}; expected {}: points in the mesh's order", file_->name(),
                    point + 2, value, point);
      values.add(value);
    }
  }
  const auto behind = text.line();
  if (behind && fieldsOf(*behind).size() == stride_)
    throw Error("{}: has more than {} points, the mesh's", file_->name(), points);
  text_ = values.finish();
}

void Su2Restart::read(size_t variable, uint64_t first, std::span<float> to) const {
  constexpr uint64_t kPointsAtOnce = 4096;
  std::vector<double> values;
  for (uint64_t done = 0; done < to.size(); done += kPointsAtOnce) {
    const uint64_t count = std::min(kPointsAtOnce, to.size() - done);
    values.resize(count * stride_);
    if (binary_) {
      file_->readAt(data_ + (first + done) * stride_ * sizeof(double),
                    std::as_writable_bytes(std::span(values)));
      if (swap_)
        for (double& value : values) value = loadStored<double>(reinterpret_cast<std::byte*>(&value), true);
    } else {
      text_.read((first + done) * stride_, std::span(values));
    }
    for (uint64_t n = 0; n < count; ++n)
      to[done + n] = static_cast<float>(values[n * stride_ + columns_[variable]]);
  }
}

}  // namespace curvisplat
