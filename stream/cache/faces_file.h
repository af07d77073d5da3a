// faces.bin: faces of the grid as surfaces, with levels of detail (stream/model/grid_faces.h). An optional file: a
// reader of the volume does not need it.
//
//   FacesHeader | streams of patches | zeros | numbers of variables | FaceRecord x faces | PatchRecord x patches
//   ^ offset 0                               ^ table_offset         | RegionRecord x regions
//
// Files of the same form in the cache's own folder have the same faces with other values: faces.var<v>.bin those of
// variables that were added, v the first, and faces.step<s>.bin those of step s, where the geometry has several steps.
//
// Streams are aligned as in geometry.bin. The manifest's checksum is that of the header and the table.
#pragma once

#include <array>
#include <cstdint>
#include <filesystem>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <type_traits>
#include <vector>

#include "stream/base/file.h"
#include "stream/cache/manifest.h"
#include "stream/model/grid_faces.h"

namespace curvisplat {

inline constexpr const char* kFacesFileName = "faces.bin";
std::string facesFileOfVariable(uint32_t number);
std::string facesFileOfStep(uint64_t step);
/// Faces between drawn and blanked cells: each is a patch of strips of quads, without levels of detail.
inline constexpr const char* kBlanksFileName = "faces.blanks.bin";
/// The name of these faces in options and saved views. They have no values.
inline constexpr const char* kBlanks = "blanks";
/// Whether the name is that of any file of faces.
bool isFacesFile(const std::string& name);
inline constexpr std::array<char, 8> kFacesMagic{'C', 'V', 'S', 'f', 'a', 'c', 'e', 's'};

struct FacesHeader {
  std::array<char, 8> magic = kFacesMagic;       //  0
  uint32_t version = 1;                          //  8
  uint32_t variables = 0;                        // 12
  uint32_t faces = 0, patches = 0, regions = 0;  // 16
  uint32_t reserved = 0;                         // 28
  uint64_t table_offset = 0;                     // 32
  double lower[3] = {}, step[3] = {};            // 40
};                                               // 88
static_assert(sizeof(FacesHeader) == 88 && std::is_trivially_copyable_v<FacesHeader>);

struct FaceRecord {
  uint32_t block;      //  0
  uint8_t axis, side;  //  4
  uint16_t reserved;   //  6
  uint64_t index;      //  8
  uint64_t nodes[2];   // 16: along u, v
  uint32_t root;       // 32
  uint32_t reserved2;  // 36
};                     // 40
static_assert(sizeof(FaceRecord) == 40);

struct PatchRecord {
  uint32_t face;                      //   0
  uint32_t stride[2];                 //   4
  uint16_t nodes[2];                  //  12
  uint64_t first[2];                  //  16
  uint32_t first_child, child_count;  //  32
  float error;                        //  40
  uint32_t length;                    //  44
  uint64_t offset, checksum;          //  48
  double lower[3], upper[3];          //  64
};                                    // 112
static_assert(sizeof(PatchRecord) == 112);

struct RegionRecord {
  uint32_t face;               //   0
  uint32_t reserved;           //   4
  uint64_t first[2], last[2];  //   8
  std::array<char, 64> name;   //  40: zeros behind it
  std::array<char, 32> type;   // 104
};                             // 136
static_assert(sizeof(RegionRecord) == 136);

/// Writes faces.bin. Patches come in any order; finish() has them in that of the tree.
class FacesWriter {
 public:
  /// `variables`: their numbers in the cache.
  FacesWriter(const std::filesystem::path& path, const FaceBox& box, std::vector<uint32_t> variables);
  /// Returns the number of the patch's stream, for finish(). One thread at a time.
  Extent append(std::span<const std::byte> stream);
  /// `patches`: of each face, in the order of the file. Returns the manifest's entry.
  FileInfo finish(std::span<const GridFace> faces, std::span<const std::vector<FacePatch>> patches,
                  std::span<const FaceRegion> regions);

 private:
  OutputFile file_;
  FaceBox box_;
  std::vector<uint32_t> variables_;
};

/// The faces of a cache. Opening reads the tables and checks them. Immutable: any thread reads.
class FacesReader {
 public:
  /// Null if the manifest does not list the file. Throws Error if it is damaged.
  static std::shared_ptr<const FacesReader> open(const std::filesystem::path& folder,
                                                 const Manifest& manifest,
                                                 const std::string& name = kFacesFileName);

  const std::filesystem::path& path() const { return file_.path(); }
  std::span<const GridFace> faces() const { return faces_; }
  std::span<const FacePatch> patches() const { return patches_; }
  std::span<const FaceRegion> regions() const { return regions_; }
  const FaceBox& box() const { return box_; }
  /// The position of a variable among the scalars of patches, by its number in the cache; nullopt: the faces do not
  /// have it.
  std::optional<size_t> scalarOf(uint32_t variable_number) const;

  /// Reads, verifies and decodes a patch. Throws Error that names it.
  PatchNodes read(uint32_t patch) const;

 private:
  FacesReader(const std::filesystem::path& path, const FileInfo& info);

  InputFile file_;
  FaceBox box_;
  std::vector<uint32_t> variables_;
  std::vector<GridFace> faces_;
  std::vector<FacePatch> patches_;
  std::vector<FaceRegion> regions_;
};

}  // namespace curvisplat
