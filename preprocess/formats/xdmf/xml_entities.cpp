#include "preprocess/formats/xdmf/xml_entities.h"

#include <algorithm>
#include <functional>
#include <map>
#include <optional>

#include "preprocess/formats/common/text_reader.h"
#include "stream/base/error.h"

namespace curvisplat {
namespace {

constexpr int kMaxDepth = 8;
constexpr size_t kMaxGrowth = size_t{1} << 20;
constexpr size_t kMaxReferences = size_t{1} << 20;  // those to empty text cost time alone
constexpr size_t kMaxName = 200;
constexpr std::string_view kBlanks = " \t\r\n";

/// nullopt: the entity is in another file.
using Entities = std::map<std::string, std::optional<std::string>, std::less<>>;

/// Reads the internal DTD. What is malformed ends it: pugixml reports that.
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

}  // namespace

std::string withEntities(const std::string& name, std::string text) {
  const Dtd dtd(text);
  if (dtd.entities().empty()) return text;
  Expansion expansion(name, dtd.entities(), text.size() + kMaxGrowth);
  expansion.text() = text.substr(0, dtd.end());
  expansion.add(std::string_view(text).substr(dtd.end()), 0);
  return std::move(expansion.text());
}

}  // namespace curvisplat
