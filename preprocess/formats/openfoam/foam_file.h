// One file of an OpenFOAM case, plain or gzip: its header and one list of numbers, ASCII or binary, which goes to a
// spool file as numbers of 8 bytes, so that all later reads go by position.
//
//    FoamFile { format ascii; class vectorField; arch "LSB;label=32;scalar=64"; ... }
//    8 ( (0 0 0) (1 0 0) ... )               a list; in binary files bytes follow the opening parenthesis
//    5{300}                                  a list of equal elements
//    internalField nonuniform List<scalar> 8 ( ... )    in files of fields; or: uniform 300
//
// Values may be entries of the dictionary, `$name`, which the file or one that it includes defines. Collated files
// (decomposedBlockData) hold the text of all processors, one after the other.
#pragma once

#include <cstdint>
#include <filesystem>
#include <memory>
#include <string>
#include <string_view>
#include <vector>

#include "preprocess/formats/common/spool_file.h"
#include "preprocess/formats/common/unpacked_file.h"

namespace curvisplat {

using FoamList = SpooledNumbers;

/// A file of OpenFOAM. One thread at a time.
class FoamFile {
 public:
  /// Opens `path`, or `path`.gz where that is what there is; of a collated file, the processor's part. Throws Error
  /// if it is not a file of OpenFOAM.
  FoamFile(const std::filesystem::path& path, ListSpools spools,
           const std::filesystem::path& temporary_folder, uint32_t processor = 0);
  FoamFile(FoamFile&&) noexcept;
  ~FoamFile();

  /// Whether `path` or `path`.gz is there. Throws Error as isFileThere().
  static bool exists(const std::filesystem::path& path);
  /// `path`, or `path`.gz where that is what there is.
  static std::filesystem::path pathOf(const std::filesystem::path& path);
  /// How many processors' parts a collated file has; 1 for any other.
  static uint32_t processorsIn(const std::filesystem::path& path);

  /// "volScalarField".
  const std::string& type() const { return type_; }
  bool isBinary() const { return binary_; }
  std::string name() const { return original_.string(); }

  /// The list that comes next, of tuples of `components` numbers. Throws Error if it is damaged.
  FoamList numbers(size_t components);
  /// The same, of labels.
  FoamList labels();
  /// A faceList or a faceCompactList: where each face begins among the labels, and the end of the last; the labels.
  struct Faces {
    FoamList begins, labels;
  };
  Faces faces();

  /// Goes to the values of a field. Returns the numbers of a uniform one, and none of a list. Throws Error if only
  /// OpenFOAM could evaluate them (#codeStream, #calc).
  std::vector<double> beginField(size_t components);
  /// Reads how many tuples the list has that comes next; of such a file no more can be read.
  uint64_t readCount();

 private:
  struct Parser;
  void readHeader();
  void enterProcessor(uint32_t processor);
  std::filesystem::path original_;
  std::unique_ptr<UnpackedFile> unpacked_;
  std::unique_ptr<Parser> parser_;
  ListSpools spools_;
  std::string type_;
  bool binary_ = false;
};

}  // namespace curvisplat
