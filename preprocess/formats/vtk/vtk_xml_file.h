// The head of a VTK XML file, and the arrays it tells of.
#pragma once

#include <optional>
#include <pugixml.hpp>
#include <string>

#include "preprocess/formats/vtk/compressed_bytes.h"
#include "preprocess/formats/vtk/vtk_grid.h"

namespace curvisplat {

/// Holds the markup of one file; the arrays it gives need it no longer.
class VtkXmlFile {
 public:
  /// Throws Error if it is no VTK XML file, or damaged.
  VtkXmlFile(const VtkFiles& files, const std::filesystem::path& path);

  std::string name() const { return file_->name(); }
  const std::filesystem::path& path() const { return file_->path(); }
  /// "StructuredGrid".
  const std::string& type() const { return type_; }
  /// The element that is called as the type. Throws Error if there is none.
  pugi::xml_node content() const;
  /// "little-endian, appended raw, zlib": how a <DataArray> is stored.
  std::string encoding(const pugi::xml_node& node) const;

  /// The array of a <DataArray> that should have so many tuples. Throws Error if it has not, or if its bytes
  /// are not all there; of texts, and of compressed blocks, one learns that when they are read.
  VtkArray array(const pugi::xml_node& node, uint64_t tuples) const;
  /// The same, but nothing for arrays that are no numbers.
  std::optional<VtkArray> numericArray(const pugi::xml_node& node, uint64_t tuples) const;

  /// Numbers of an attribute. Throws Error unless there are as many.
  std::vector<double> numbers(const pugi::xml_node& node, const char* attribute, size_t count) const;
  /// An extent: six integers; nothing for "0 -1 0 -1 0 -1", which is what an empty piece has. Throws Error if
  /// it is anything else that is no extent, or too large.
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
  std::string markup_;  // that document_ points into
  pugi::xml_document document_;
  pugi::xml_node root_;
  std::string type_;
  HeaderIntegers header_;
  std::optional<BlockCompressor> compressor_;
  uint64_t appended_begin_ = 0;
  bool appended_base64_ = false;
};

/// Whether the file's first bytes are those of a VTK XML file.
bool isVtkXml(const InputFile& file);

}  // namespace curvisplat
