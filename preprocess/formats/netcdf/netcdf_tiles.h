// A NetCDF file whose map several processors have written, each a part to a file of its own, as NEMO and XIOS
// do: NAME_0000.nc, NAME_0001.nc, ... with the attributes DOMAIN_*. NetcdfTiles reads the parts as one file.
// What no part has is missing (NEMO leaves out processors of land alone); what several parts have, a halo, is
// read from the part that owns it. Any other file is a single part.
//
// Any number of threads may read. If there are many parts, one at a time is open.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "preprocess/formats/netcdf/netcdf_file.h"

namespace curvisplat {

/// The place of a part in the map, halos included, by the attributes DOMAIN_*.
struct NetcdfDomain {
  uint64_t total = 0;                // parts of the map
  std::array<size_t, 2> dims{};      // along x and y: indices into NetcdfFile::dimensions()
  std::array<uint64_t, 2> whole{};   // lengths of the map
  std::array<uint64_t, 2> first{};   // position of the first value, as stored: from 1, or from 0
  std::array<uint64_t, 2> before{};  // widths of the halos
  std::array<uint64_t, 2> after{};

  /// nullopt for a file of a whole map. Throws Error if the attributes do not fit the dimensions.
  static std::optional<NetcdfDomain> of(const NetcdfFile& file);
};

class NetcdfTiles {
 public:
  NetcdfTiles(std::unique_ptr<NetcdfFile> file, std::optional<NetcdfDomain> domain);

  /// Whether `file` is a further part of the same map: by its name, but for the number at its end.
  bool includes(const NetcdfFile& file, const std::optional<NetcdfDomain>& domain) const;
  /// Adds it. Throws Error if its dimensions are not those of the first.
  void add(std::unique_ptr<NetcdfFile> file, const NetcdfDomain& domain);

  /// The first part, for everything but lengths and values.
  const NetcdfFile& front() const { return *parts_.front().file; }
  size_t size() const { return parts_.size(); }
  /// How many parts belong to the map; 1 of other files.
  uint64_t total() const { return parts_.front().domain ? parts_.front().domain->total : 1; }
  std::vector<std::string> paths() const;
  /// The length of the dimension in the whole map.
  uint64_t length(size_t dimension) const;

  /// Reads a variable of the front as NetcdfFile does. NaN where no part has a value.
  template <typename Value>
  void read(const NetcdfVariable& variable, const NetcdfBox& box, std::span<Value> to) const;
  void release() const;

 private:
  struct Part {
    std::unique_ptr<NetcdfFile> file;
    std::optional<NetcdfDomain> domain;
  };
  template <typename Value>
  void readPart(const Part& part, const NetcdfVariable& variable, const NetcdfBox& box,
                std::span<Value> to) const;
  /// The direction of the map (0 or 1) along which a dimension of the front runs, if this is one of several
  /// parts.
  std::optional<size_t> directionOf(size_t dimension) const;

  std::vector<Part> parts_;
  uint64_t origin_ = 1;  // the position that DOMAIN_position_first gives to the map's first value
};

}  // namespace curvisplat
