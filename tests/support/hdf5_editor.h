// HDF5 files that no CGNS library writes. Hdf5Editor changes a file into one with attributes of other types
// and sizes, and links in circles; renewChecksum() lets a byte be changed in a structure that carries a
// checksum.
#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <string>
#include <string_view>

namespace curvisplat {

/// The checksum of HDF5's structures of version 2: Bob Jenkins' lookup3, of the bytes before it.
uint32_t hdf5Checksum(std::string_view bytes);

/// Renews a checksum: if the structure that begins there in `whole` has its checksum at its end, puts that of
/// the same place in `changed` right, and returns true.
bool renewChecksum(std::string_view whole, size_t begin, std::string& changed);

/// Contents that stand where a short fixed text should.
enum class HostileAttribute {
  kMissing,
  kStringOf34,  // one more than any text of CGNS's has
  kLongString,
  kHugeString,
  kVariableString,
  kStrings,  // several
  kNullSpace,
  kEmptySpace,
  kInteger,
  kIntegers,
  kLongLetters,
  kReal,
  kCompound,
  kReference,
  kVariableList,
  kArray,
  kEnumerator,
  kOpaque,
};
inline constexpr int kHostileAttributes = static_cast<int>(HostileAttribute::kOpaque) + 1;

/// Throws std::runtime_error where HDF5 refuses. Objects are given by their paths.
class Hdf5Editor {
 public:
  explicit Hdf5Editor(const std::filesystem::path& path);
  ~Hdf5Editor();  // closes the file
  Hdf5Editor(const Hdf5Editor&) = delete;
  Hdf5Editor& operator=(const Hdf5Editor&) = delete;

  void replaceAttribute(const std::string& object, const std::string& attribute, HostileAttribute hostile);
  /// Writes a fixed string of `bytes` bytes, without a terminating zero where `text` fills them.
  void writeText(const std::string& object, const std::string& attribute, const std::string& text,
                 size_t bytes);
  void group(const std::string& path);
  void softLink(const std::string& target, const std::string& path);
  void hardLink(const std::string& target, const std::string& path);
  void remove(const std::string& path);

 private:
  long long file_;
};

}  // namespace curvisplat
