#include "preprocess/formats/xdmf/xdmf_document.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <functional>
#include <map>
#include <optional>
#include <regex>
#include <sstream>
#include <string>
#include <string_view>
#include <vector>

#include "preprocess/formats/common/text_reader.h"
#include "stream/base/error.h"
#include "stream/base/file.h"
#include "stream/base/text.h"

namespace curvisplat {
namespace {

// Entities that an XML file defines for itself, which pugixml skips:
//
//   <!DOCTYPE Xdmf SYSTEM "Xdmf.dtd" [<!ENTITY HeavyData "run.h5">]>
//   ...
//   <DataItem>&HeavyData;:/p</DataItem>

constexpr int kMaxDepth = 8;
constexpr size_t kMaxGrowth = size_t{1} << 20;
constexpr size_t kMaxReferences = size_t{1} << 20;  // those to empty text cost time alone
constexpr size_t kMaxName = 200;
constexpr std::string_view kBlanks = " \t\r\n";

/// nullopt: the entity is in another file.
using Entities = std::map<std::string, std::optional<std::string>, std::less<>>;

/// Reads the internal DTD. Malformed text ends it; pugixml reports the fault later.
class Dtd {
 public:
  explicit Dtd(std::string_view text) : text_(text), at_(text.find("<!DOCTYPE")) {
    if (at_ >= text_.size()) return;
    while (at_ < text_.size() && text_[at_] != '[' && text_[at_] != '>') skipOne();
    if (at_ >= text_.size() || text_[at_] == '>') return;
    ++at_;
    while (at_ < text_.size() && text_[at_] != ']') {
      if (follows("<!--"))
        skipBehind("-->");
      else if (follows("<?"))
        skipBehind("?>");
      else if (follows("<!ENTITY"))
        readEntity();
      else
        skipOne();
    }
  }

  const Entities& entities() const { return entities_; }
  size_t end() const { return std::min(at_, text_.size()); }

 private:
  bool follows(std::string_view word) const { return text_.substr(at_).starts_with(word); }

  void skipBehind(std::string_view word) {
    const size_t found = text_.find(word, at_);
    at_ = found == std::string_view::npos ? text_.size() : found + word.size();
  }

  /// A character, or text in quotes.
  void skipOne() {
    const char c = text_[at_++];
    if (c == '"' || c == '\'') skipBehind(std::string_view(&c, 1));
  }

  void skipBlanks() { at_ = std::min(text_.find_first_not_of(kBlanks, at_), text_.size()); }

  void readEntity() {
    at_ += std::string_view("<!ENTITY").size();
    skipBlanks();
    const size_t end = std::min(text_.find_first_of(" \t\r\n\"'>", at_), text_.size());
    const std::string name(text_.substr(at_, end - at_));
    at_ = end;
    skipBlanks();
    if (at_ < text_.size() && name != "%") {
      const char quote = text_[at_];
      const bool inside = quote == '"' || quote == '\'';
      const size_t close = inside ? text_.find(quote, at_ + 1) : std::string_view::npos;
      // The first definition counts.
      if (!inside)
        entities_.try_emplace(name, std::nullopt);
      else if (close != std::string_view::npos)
        entities_.try_emplace(name, text_.substr(at_ + 1, close - at_ - 1));
    }
    while (at_ < text_.size() && text_[at_] != '>') skipOne();
  }

  std::string_view text_;
  size_t at_;
  Entities entities_;
};

/// Replaces references to entities.
class Expansion {
 public:
  Expansion(const std::string& name, const Entities& entities, size_t max_size)
      : name_(name), entities_(entities), max_size_(max_size) {}

  void add(std::string_view text, int depth) {
    if (depth > kMaxDepth)
      throw Error("{}: its entities refer to one another more than {} deep; write their values out", name_,
                  kMaxDepth);
    for (size_t at = 0; at < text.size();) {
      const size_t start = std::min(text.find('&', at), text.size());
      append(text.substr(at, start - at));
      const size_t end = text.substr(start, kMaxName).find(';');
      const auto found =
          end == std::string_view::npos ? entities_.end() : entities_.find(text.substr(start + 1, end - 1));
      if (found == entities_.end()) {
        append(text.substr(start, 1));
        at = start + 1;
        continue;
      }
      if (!found->second)
        throw Error("{}: its entity &{}; is in another file, which is not read; write its value out", name_,
                    printable(found->first));
      if (++references_ > kMaxReferences)
        throw Error("{}: refers to its entities more than {} times; write their values out", name_,
                    kMaxReferences);
      add(*found->second, depth + 1);
      at = start + end + 1;
    }
  }

  std::string& text() { return expanded_; }

 private:
  void append(std::string_view text) {
    if (expanded_.size() + text.size() > max_size_)
      throw Error("{}: its entities make it longer by more than {} MiB; write their values out", name_,
                  kMaxGrowth >> 20);
    expanded_ += text;
  }

  const std::string& name_;
  const Entities& entities_;
  size_t max_size_;
  size_t references_ = 0;
  std::string expanded_;
};

/// The text with references to the entities of its internal DTD replaced, even within comments, where that
/// changes nothing. Character references, the five that XML knows and undefined ones stay. Entities may
/// refer to others, eight deep; the text grows by 1 MiB at most. Throws Error, which begins with `name`, if
/// an entity exceeds these limits or is in another file.
std::string withEntities(const std::string& name, std::string text) {
  const Dtd dtd(text);
  if (dtd.entities().empty()) return text;
  Expansion expansion(name, dtd.entities(), text.size() + kMaxGrowth);
  expansion.text() = text.substr(0, dtd.end());
  expansion.add(std::string_view(text).substr(dtd.end()), 0);
  return std::move(expansion.text());
}

// Parts of the document that stand elsewhere in it (XInclude), as dolfinx and meshio write each step's mesh:
//
//   <xi:include xpointer="xpointer(//Grid[@Name='mesh']/*[self::Topology or self::Geometry])"/>

constexpr size_t kMaxIncluded = 1'000'000;
constexpr size_t kMaxLookedAt = 20'000'000;  // elements, some seconds
constexpr size_t kMaxPointer = 1000;

bool isInclude(const pugi::xml_node& node) {
  const std::string_view named = node.name();
  return named == "include" || named.ends_with(":include");
}

/// The elements that a pointer selects. nullopt if it is not a path of names with conditions: XPath has functions
/// that take as long as one likes.
std::optional<std::vector<pugi::xml_node>> selectedBy(const std::string& pointer,
                                                      const pugi::xml_document& document) {
  static const std::regex path(R"(xpointer\((/?(?:/[\w*.-]+(?:\[(?:[^\[\]()/'"]|'[^']*'|"[^"]*")*\])*)+)\))");
  std::smatch match;
  if (pointer.size() > kMaxPointer || !std::regex_match(pointer, match, path)) return std::nullopt;
  std::vector<pugi::xml_node> selected;
  try {
    for (const pugi::xpath_node& found : document.select_nodes(match[1].str().c_str()))
      if (found.node() && !isInclude(found.node())) selected.push_back(found.node());
  } catch (const pugi::xpath_exception&) {
    return std::nullopt;
  }
  return selected;
}

}  // namespace

std::string xdmfAttribute(const pugi::xml_node& node, std::initializer_list<const char*> names) {
  for (const char* const name : names)
    if (const pugi::xml_attribute attribute = node.attribute(name))
      return std::string(trimmed(attribute.value()));
  return "";
}

XdmfDocument::XdmfDocument(std::filesystem::path path) : path_(std::move(path)) {
  const std::string text = withEntities(name(), readTextFile(path_));
  const pugi::xml_parse_result parsed = document_.load_buffer(text.data(), text.size());
  if (!parsed) throw Error("{}: byte {}: is not valid XML ({})", name(), parsed.offset, parsed.description());
  domain_ = document_.child("Xdmf").child("Domain");
  if (!domain_) throw Error("{}: has no Domain; expected an XDMF file with a grid", name());
  if (text.find("include") != std::string::npos) replaceIncludes();
}

void XdmfDocument::replaceIncludes() {
  std::vector<pugi::xml_node> elements{document_.document_element()}, includes;
  for (size_t n = 0; n < elements.size(); ++n)
    for (const pugi::xml_node child : elements[n].children()) {
      if (child.type() != pugi::node_element) continue;
      (isInclude(child) ? includes : elements).push_back(child);
    }
  // Many steps include the same.
  std::map<std::string, std::vector<pugi::xml_node>> selected;
  size_t looked_at = 0, included = 0;
  for (pugi::xml_node include : includes) {
    const std::string pointer = xdmfAttribute(include, {"xpointer"});
    if (include.attribute("href") && *include.attribute("href").value() != '\0')
      throw Error("{}: includes parts of another file (XInclude), which is not read; write the grids out",
                  name());
    const auto [found, is_new] = selected.try_emplace(pointer);
    if (is_new) {
      if ((looked_at += elements.size()) > kMaxLookedAt)
        throw Error("{}: has too many includes; write the grids out", name());
      const auto parts = selectedBy(pointer, document_);
      if (!parts || parts->empty())
        throw Error("{}: includes {}, which {}; write the grids out", name(),
                    printable(pointer.substr(0, 200)), parts ? "the file does not have" : "is not read");
      found->second = *parts;
    }
    if ((included += found->second.size()) > kMaxIncluded)
      throw Error("{}: includes more than {} elements; write the grids out", name(), kMaxIncluded);
    pugi::xml_node parent = include.parent();
    for (const pugi::xml_node& part : found->second) {
      pugi::xml_node place = parent.insert_child_before(part.name(), include);
      // Elements whose texts are alike include the same.
      place.append_attribute("included").set_value(static_cast<unsigned long long>(part.hash_value()));
      included_.emplace(place, part);
    }
  }
  for (pugi::xml_node include : includes) include.parent().remove_child(include);
}

std::string XdmfDocument::describe(const pugi::xml_node& node) const {
  const auto called = [](const pugi::xml_node& one) {
    const std::string own = xdmfAttribute(one, {"Name"});
    return fmt::format("{}{}{}", one.name(), own.empty() ? "" : " ", printable(own.substr(0, 60)));
  };
  // An item is known by what it belongs to.
  pugi::xml_node owner = node.parent();
  while (std::string_view(owner.name()) == "DataItem") owner = owner.parent();
  const bool is_item =
      std::string_view(node.name()) == "DataItem" && owner && owner != document_.document_element();
  return fmt::format("{}: {}{}", name(), called(node), is_item ? " of " + called(owner) : "");
}

pugi::xml_node XdmfDocument::resolved(pugi::xml_node node) const {
  for (int depth = 0; depth < kXdmfMaxDepth; ++depth) {
    if (const auto part = included_.find(node); part != included_.end()) {
      node = part->second;
      continue;
    }
    std::string path = xdmfAttribute(node, {"Reference"});
    if (path.empty()) return node;
    if (path == "XML") path = trimmed(node.text().get());
    // Nothing that takes long to look up.
    const bool simple = path.size() < 1000 && path.starts_with('/') && path.find("//") == std::string::npos &&
                        path.find_first_of("(*|:") == std::string::npos;
    // Many grids refer to the same node.
    pugi::xml_node& found = referred_[path];
    try {
      if (simple && !found) found = document_.select_node(path.c_str()).node();
    } catch (const pugi::xpath_exception&) {
    }
    if (!found) throw Error("{} refers to {}, which the file does not have", describe(node), printable(path));
    node = found;
  }
  throw Error("{} refers to itself", describe(node));
}

double XdmfDocument::numberIn(const pugi::xml_node& node, const std::string& text) const {
  double value = 0;
  if (!parseNumber(text, value) || !std::isfinite(value))
    throw Error("{} has {}; expected a number", describe(node), printable(text.substr(0, 40)));
  return value;
}

std::vector<double> XdmfDocument::numbersIn(const pugi::xml_node& node, const std::string& text) const {
  std::vector<double> numbers;
  std::istringstream words(text);
  for (std::string word; words >> word;) {
    double value = 0;
    if (!parseNumber(word, value))
      throw Error("{} has {}; expected a number", describe(node), printable(word.substr(0, 40)));
    numbers.push_back(value);
  }
  return numbers;
}

std::vector<uint64_t> XdmfDocument::countsIn(const pugi::xml_node& node, const std::string& text) const {
  std::vector<uint64_t> counts;
  for (const double number : numbersIn(node, text)) {
    if (!(number >= 0 && number <= static_cast<double>(kXdmfMaxCount)) || number != std::floor(number))
      throw Error("{} has {}; expected dimensions", describe(node), printable(text.substr(0, 40)));
    counts.push_back(static_cast<uint64_t>(number));
  }
  return counts;
}

}  // namespace curvisplat
