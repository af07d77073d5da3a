// A geometry or variable file of EnSight Gold, C Binary in either byte order or ASCII: texts, and lists of numbers that are
// read by position afterwards. Numbers of ASCII files go to a spool file.
#pragma once

#include <cstdint>
#include <filesystem>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "preprocess/formats/common/byte_source.h"
#include "preprocess/formats/common/file_index.h"
#include "preprocess/formats/common/spool_file.h"
#include "preprocess/formats/common/text_reader.h"
#include "preprocess/formats/ensight/ensight_case.h"

namespace curvisplat {

/// Numbers of a file, of 4 bytes or in the spool file. Any number of threads may read once the file has been passed.
struct EnsightList {
  std::shared_ptr<const PooledFile> file;  // null: spooled
  std::shared_ptr<const SpooledNumbers> spooled;
  uint64_t begin = 0, count = 0;  // begin: in bytes, or in numbers
  bool integers = false, swap = false;

  /// Reads integers or floats, from the number `first` on.
  void read(uint64_t first, std::span<double> to) const;
  void read(uint64_t first, std::span<float> to) const;
  std::vector<double> all() const;
};

/// Temporary files that the readers of a case share, so that any number of variables takes few open files.
struct EnsightScratch {
  explicit EnsightScratch(const std::filesystem::path& folder, FileIndex* of_steps = nullptr)
      : spools(folder), index(of_steps) {}

  std::shared_ptr<OpenFiles> pool = std::make_shared<OpenFiles>();
  ListSpools spools;  // items: numbers of all files; begins: of polyhedra
  FileIndex* index;   // of the places of steps in files; may be null
};

/// Reads texts and lists in their order. One thread at a time.
class EnsightFile {
 public:
  /// `binary`: whether it has to be; nullopt: as a geometry file itself tells, whose first text says so.
  EnsightFile(const EnsightPlace& place, std::optional<bool> binary, const EnsightScratch& scratch);

  bool binary() const { return binary_; }
  bool swap() const { return swap_; }
  void setSwap(bool swap) { swap_ = swap; }
  std::string name() const { return file_->name(); }

  /// The next text of 80 characters, or the next line, without surrounding space.
  std::string text();
  /// The next text() that is not empty, in small letters; empty at the end of the file.
  std::string keyword();
  /// The next list. Throws Error if the file is too short for it.
  EnsightList integers(uint64_t count) { return list(count, true); }
  EnsightList floats(uint64_t count) { return list(count, false); }
  /// The next integer, as a number from 0 to 2^40. In a binary file that `decides_order`, in the order that makes it
  /// smaller.
  uint64_t integer(bool decides_order = false);
  /// The numbers that integers() has passed, of an ASCII file before finish() too.
  std::vector<double> valuesOf(const EnsightList& list);
  /// Ends the file after its last text or list: spooled lists can be read.
  void finish();

 private:
  void findStep(const EnsightPlace& place, FileIndex* index);
  std::optional<FilePart> guessedStep(const EnsightPlace& place) const;
  uint64_t endOfStep(const EnsightPlace& place, uint64_t begin) const;
  [[noreturn]] void lacksStep(const EnsightPlace& place) const;
  std::optional<uint64_t> find(std::string_view words, uint64_t from) const;
  EnsightList list(uint64_t count, bool integers);
  uint64_t left() const;

  std::shared_ptr<const PooledFile> file_;
  bool binary_ = false, swap_ = false;
  uint64_t at_ = 0, end_ = 0;  // of a binary file
  std::optional<TextReader> text_;
  NumberSpool<double> spool_;
  std::shared_ptr<SpooledNumbers> spooled_ = std::make_shared<SpooledNumbers>();
};

}  // namespace curvisplat
