// Changes HDF5 files into ones that no CGNS library writes: attributes of other types and sizes, links in
// circles.
#pragma once

#include <cstddef>
#include <filesystem>
#include <string>

namespace curvisplat {

/// What stands where a short fixed text should.
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
  /// As a fixed string of `bytes` bytes, without a terminating zero where `text` fills them.
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
