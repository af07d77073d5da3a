// The words and numbers of a legacy VTK file (.vtk), from its beginning to its end. Words are text in any file; numbers
// are text or big-endian bytes.
#pragma once

#include <fmt/format.h>

#include <cstdint>
#include <filesystem>
#include <memory>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "preprocess/formats/common/text_reader.h"
#include "preprocess/formats/vtk/vtk_grid.h"
#include "preprocess/formats/vtk/vtk_source.h"
#include "stream/base/error.h"
#include "stream/base/text.h"

namespace curvisplat {

class VtkLegacyFile {
 public:
  static constexpr uint64_t kMaxCount = 100'000'000'000'000;

  VtkLegacyFile(const VtkFiles& files, const std::filesystem::path& path);

 protected:
  template <typename... Args>
  [[noreturn]] void fail(fmt::format_string<Args...> format, Args&&... args) const {
    throw Error("{}: byte {}: {}", file_->name(), text_.offset(),
                printable(fmt::format(format, std::forward<Args>(args)...)));
  }

  std::string nextWord() { return lowerCase(text_.word()); }
  /// The next name as it was before it was written: special characters are coded.
  std::string nextName();
  /// The remaining words of the line.
  std::vector<std::string> restOfLine();
  /// Reads the type, the last word before the numbers, and the line break; binary numbers follow at once.
  std::string lineOfType();
  bool wordFollows(std::string_view word);
  uint64_t count(std::string_view word) const;
  uint64_t nextCount() { return count(text_.word()); }

  /// Numbers in text are unpacked into a temporary file.
  VtkArray readNumbers(const std::string& name, const std::string& type, uint64_t components,
                       uint64_t tuples);
  void skipBits(const std::string& name, uint64_t components, uint64_t tuples);
  void skipStrings(uint64_t components, uint64_t tuples);
  /// Skips everything up to and including the next empty line.
  void skipMetadata();

  VtkFiles files_;
  std::shared_ptr<const PooledFile> file_;
  TextReader text_;
  bool ascii_ = true;
};

}  // namespace curvisplat
