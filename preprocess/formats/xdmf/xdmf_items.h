// The arrays that an XDMF file names: data items in its XML, in HDF5 or in binary files, and HyperSlabs and
// joins of others.
//
// XdmfItems gives an XdmfValues for each item; numbers are read later, by position. XdmfItems is for one
// thread; any number of threads may read the arrays, and reads from HDF5 wait for one another.
#pragma once

#include <cstddef>
#include <filesystem>
#include <map>
#include <memory>
#include <string>
#include <vector>

#include "preprocess/formats/common/byte_source.h"
#include "preprocess/formats/common/hdf5_arrays.h"
#include "preprocess/formats/xdmf/xdmf_document.h"
#include "preprocess/formats/xdmf/xdmf_values.h"
#include "stream/base/error.h"

namespace curvisplat {

/// An item whose numbers would have to be computed.
class XdmfComputedItem : public Error {
 public:
  using Error::Error;
};

/// The arrays of a document's data items.
class XdmfItems {
 public:
  /// `folder` is the folder of the files that the document names. `document` must outlive the object, but
  /// not the arrays.
  XdmfItems(const XdmfDocument& document, std::filesystem::path folder);

  /// The array of a DataItem. One that many elements refer to is kept once. Throws Error with the element;
  /// XdmfComputedItem for functions other than JOIN.
  std::shared_ptr<const XdmfValues> read(const pugi::xml_node& item) { return readItem(item, 0); }

  /// The files of the arrays that were read, each once.
  const std::vector<std::string>& files() const { return files_; }

 private:
  std::shared_ptr<const XdmfValues> readItem(const pugi::xml_node& given, int depth);
  std::shared_ptr<const XdmfValues> readNewItem(const pugi::xml_node& item, int depth);
  std::shared_ptr<const XdmfValues> readFunction(const pugi::xml_node& item, int depth);
  std::shared_ptr<const XdmfValues> readSlab(const pugi::xml_node& item, int depth);
  void addFile(const std::filesystem::path& path);
  std::filesystem::path existing(const pugi::xml_node& item, const std::string& text) const;
  std::shared_ptr<const XdmfValues> readHdf5(const pugi::xml_node& item, const std::string& text,
                                             std::vector<uint64_t> dims);
  std::shared_ptr<const XdmfValues> readBinary(const pugi::xml_node& item, const std::string& text,
                                               std::vector<uint64_t> dims);

  const XdmfDocument& document_;
  const std::filesystem::path folder_;
  const std::shared_ptr<OpenFiles> pool_ = std::make_shared<OpenFiles>();
  const std::shared_ptr<Hdf5Sets> hdf5_sets_ = std::make_shared<Hdf5Sets>();
  std::map<pugi::xml_node, std::shared_ptr<const XdmfValues>> items_;
  std::vector<std::string> files_;
};

}  // namespace curvisplat
