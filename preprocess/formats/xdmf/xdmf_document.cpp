#include "preprocess/formats/xdmf/xdmf_document.h"

#include <fmt/format.h>

#include <cmath>
#include <sstream>

#include "preprocess/formats/common/ascii_spool.h"
#include "preprocess/formats/common/text_reader.h"
#include "preprocess/formats/xdmf/xml_entities.h"
#include "stream/base/error.h"
#include "stream/base/file.h"
#include "stream/base/words.h"

namespace curvisplat {

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
  if (text.find("<xi:include") != std::string::npos)
    throw Error("{}: includes parts by XInclude, which is not read; write the grids out", name());
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
    std::string path = xdmfAttribute(node, {"Reference"});
    if (path.empty()) return node;
    if (path == "XML") path = trimmed(node.text().get());
    // Nothing that takes long to look up.
    const bool simple = path.size() < 1000 && path.starts_with('/') && path.find("//") == std::string::npos &&
                        path.find_first_of("(*|:") == std::string::npos;
    pugi::xml_node found;
    try {
      if (simple) found = document_.select_node(path.c_str()).node();
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
