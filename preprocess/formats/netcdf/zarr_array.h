// The metadata of an array of a Zarr store, version 2 or 3: its shape, its chunks, the type of its values,
// and the codecs that its chunks are stored with. Pure functions: any thread may call.
//
//   version 2   NAME/.zarray, NAME/.zattrs       chunks NAME/0.1.2 or NAME/0/1/2
//   version 3   NAME/zarr.json                   chunks NAME/c/0/1/2; shards hold several chunks and their index
//
// Source: the Zarr specifications, versions 2 and 3, and their lists of codecs and data types.
#pragma once

#include <cstddef>
#include <cstdint>
#include <limits>
#include <map>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "preprocess/formats/netcdf/netcdf_variable.h"

namespace curvisplat {

enum class ZarrNumber {
  kNone,
  kInt8,
  kUint8,
  kInt16,
  kUint16,
  kInt32,
  kUint32,
  kInt64,
  kUint64,
  kHalf,
  kFloat,
  kDouble
};

/// One of the steps that turn the bytes of a chunk's values into those of its file.
struct ZarrCodec {
  enum class Kind {
    kZlib,
    kZstd,
    kBlosc,
    kLz4,
    kShuffle,
    kDelta,
    kChecksum,
    kCrc32,
    kAdler32
  } kind;                                 // kZlib: gzip, too
  size_t element_bytes = 0;               // of kShuffle
  ZarrNumber number = ZarrNumber::kNone;  // of kDelta
};

struct ZarrArray {
  std::string name;
  int version = 2;
  std::vector<uint64_t> shape, chunks;  // [axis]
  std::vector<uint64_t> shards;         // [axis]: chunks in a file; all 1 without shards
  std::vector<std::string> dimensions;  // [axis]; empty where the file has no name
  std::vector<size_t> stored_axes;      // [axis in a chunk, slowest first]: of the array
  ZarrNumber number = ZarrNumber::kNone, declared = ZarrNumber::kNone;  // as stored; of the values
  double scale = 1, offset = 0;  // a value: what is stored, divided by the scale, plus the offset
  enum class Text { kNone, kBytes, kUtf32, kVariable } text = Text::kNone;
  size_t value_bytes = 0;  // bytes of a stored value; 0: variable length
  bool big_endian = false;
  double fill = std::numeric_limits<double>::quiet_NaN();  // value of chunks that have no file
  std::vector<ZarrCodec> codecs;                           // in the order of writing
  bool sharded = false, index_first = false;               // index_first: a shard's index precedes its chunks
  bool index_checked = false;                              // a checksum of four bytes follows the index
  std::string prefix, separator;                           // of the names of chunks' files
  std::string refused;                                     // why values cannot be read; empty if they can
  std::map<std::string, NetcdfAttribute> attributes;

  uint64_t chunkValues() const;
  uint64_t chunkBytes() const { return chunkValues() * value_bytes; }
  uint64_t chunksInShard() const;
  /// The type of the values, as NetCDF's nc_type.
  int type() const;
};

/// Parses the attributes in the JSON text of a .zattrs file. `file` is its name, for messages. Throws Error.
std::map<std::string, NetcdfAttribute> zarrAttributes(std::string_view text, const std::string& file);

/// Parses an array of version 2 from the texts of its .zarray and .zattrs. Throws Error if the metadata is
/// invalid or chunks are larger than 500 MiB. If it is valid but not supported (a codec, a filter, a type),
/// `refused` says why.
ZarrArray zarrArray2(const std::string& name, std::string_view array, std::string_view attributes,
                     const std::string& file);

/// The contents of a zarr.json: an array, or a group with its attributes.
struct ZarrNode {
  std::optional<ZarrArray> array;
  std::map<std::string, NetcdfAttribute> attributes;
};
ZarrNode zarrNode3(const std::string& name, std::string_view text, const std::string& file);

}  // namespace curvisplat
