// The markup of a VTK XML file, and the arrays that it describes. Opening a file scans it once for its tags,
// through a buffer; the data between them are not kept: the markup, 16 MiB at most, has their positions. One
// thread reads the markup; any number may read the arrays.
#pragma once

#include <optional>
#include <pugixml.hpp>
#include <string>

#include "preprocess/formats/vtk/encoded_bytes.h"
#include "preprocess/formats/vtk/vtk_grid.h"

namespace curvisplat {

/// Holds the markup of one file. Arrays that it returns are independent of it.
class VtkXmlFile {
 public:
  /// Throws Error if it is not a VTK XML file, or damaged.
  VtkXmlFile(const VtkFiles& files, const std::filesystem::path& path);

  std::string name() const { return file_->name(); }
  const std::filesystem::path& path() const { return file_->path(); }
  /// The version of the format: 2.2.
  double version() const { return root_.attribute("version").as_double(); }
  /// "StructuredGrid".
  const std::string& type() const { return type_; }
  /// The element with the name of the type. Throws Error if there is none.
  pugi::xml_node content() const;
  /// How a <DataArray> is stored: "little-endian, appended raw, zlib".
  std::string encoding(const pugi::xml_node& node) const;

  /// The array of a <DataArray> that must have `tuples` tuples. Throws Error if it has not, or if it is
  /// truncated; text and the contents of compressed blocks are checked when they are read.
  VtkArray array(const pugi::xml_node& node, uint64_t tuples) const;
  /// Returns what array() does, but nullopt for arrays that are not numeric.
  std::optional<VtkArray> numericArray(const pugi::xml_node& node, uint64_t tuples) const;

  /// The numbers in an attribute. Throws Error unless there are `count`.
  std::vector<double> numbers(const pugi::xml_node& node, const char* attribute, size_t count) const;
  /// The six integers of an extent; nullopt for "0 -1 0 -1 0 -1", that of an empty piece. Throws Error if
  /// the attribute is not a valid extent, or too large.
  std::optional<VtkExtent> extent(const pugi::xml_node& node, const char* attribute) const;

  [[noreturn]] void fail(const std::string& what) const;

 private:
  struct Part {
    uint64_t begin = 0, end = 0;
  };
  Part textOf(const pugi::xml_node& node) const;
  std::shared_ptr<const ByteSource> stored(const pugi::xml_node& node, const VtkArray& array, Part part,
                                           bool base64) const;
  std::shared_ptr<const ByteSource> text(const VtkArray& array, Part part) const;

  std::shared_ptr<const PooledFile> file_;
  std::shared_ptr<SpoolFile> spool_;
  std::string markup_;  // document_ points into it
  pugi::xml_document document_;
  pugi::xml_node root_;
  std::string type_;
  HeaderIntegers header_;
  std::optional<BlockCompressor> compressor_;
  uint64_t appended_begin_ = 0;
  bool appended_base64_ = false;
};

/// Whether the file begins as a VTK XML file does.
bool isVtkXml(const InputFile& file);

}  // namespace curvisplat
