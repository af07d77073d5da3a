// The XML of an XDMF file: parsed as a whole, with the entities that it defines for itself, the references
// between its elements, and the numbers in its text. Depth, counts and the growth by entities are limited,
// since the file is untrusted. For one thread.
#pragma once

#include <cstdint>
#include <filesystem>
#include <initializer_list>
#include <map>
#include <pugixml.hpp>
#include <string>
#include <string_view>
#include <vector>

namespace curvisplat {

/// Elements and references are followed this deep.
inline constexpr int kXdmfMaxDepth = 32;
/// Dimensions and counts are this at most.
inline constexpr uint64_t kXdmfMaxCount = uint64_t{1} << 40;

/// The first of the attributes that there is, trimmed; empty if there is none.
std::string xdmfAttribute(const pugi::xml_node& node, std::initializer_list<const char*> names);

class XdmfDocument {
 public:
  /// This and every member function throws Error with the file and the element.
  explicit XdmfDocument(std::filesystem::path path);

  const std::filesystem::path& path() const { return path_; }
  std::string name() const { return path_.string(); }
  pugi::xml_node domain() const { return domain_; }

  /// "FILE: Grid NAME", for messages.
  std::string describe(const pugi::xml_node& node) const;
  /// The element that `node` refers to or includes, or itself.
  pugi::xml_node resolved(pugi::xml_node node) const;

  /// A finite number, numbers, or whole numbers from 0 in a text of `node`.
  double numberIn(const pugi::xml_node& node, const std::string& text) const;
  std::vector<double> numbersIn(const pugi::xml_node& node, const std::string& text) const;
  std::vector<uint64_t> countsIn(const pugi::xml_node& node, const std::string& text) const;

 private:
  /// Replaces each include by empty elements, one for each element that it selects; resolved() leads from the one to the other.
  void replaceIncludes();

  std::filesystem::path path_;
  pugi::xml_document document_;
  mutable std::map<std::string, pugi::xml_node> referred_;  // by their paths
  std::map<pugi::xml_node, pugi::xml_node> included_;
  pugi::xml_node domain_;
};

}  // namespace curvisplat
