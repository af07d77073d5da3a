#include "stream/base/json_document.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <nlohmann/json.hpp>
#include <utility>

#include "stream/base/error.h"
#include "stream/base/text.h"

namespace curvisplat {
namespace {

using Json = nlohmann::ordered_json;

constexpr size_t kLongestShown = 60;

void requireShallow(std::string_view text, const std::string& file) {
  constexpr int kDeepest = 64;
  int depth = 0;
  bool in_string = false;
  for (size_t n = 0; n < text.size(); ++n) {
    const char c = text[n];
    if (in_string) {
      if (c == '\\') ++n;
      if (c == '"') in_string = false;
      continue;
    }
    if (c == '"') in_string = true;
    if (c == '[' || c == '{') ++depth;
    if (c == ']' || c == '}') --depth;
    if (depth > kDeepest)
      throw Error("{}: has brackets more than {} deep at byte {}; the file is damaged or of another kind",
                  file, kDeepest, n);
  }
}

/// Describes what is wrong with a text that is not JSON. `error`: what the parser threw, whose own text is
/// for programmers.
std::string faultOf(std::string_view text, const Json::exception& error) {
  const auto* const syntax = dynamic_cast<const Json::parse_error*>(&error);
  if (!syntax) return "a number that is too large";  // nothing else is thrown while parsing
  if (text.find_first_not_of(" \t\r\n") == std::string_view::npos) return "no text";
  const std::string_view before = text.substr(0, syntax->byte > 0 ? syntax->byte - 1 : 0);
  const auto line = 1 + std::count(before.begin(), before.end(), '\n');
  const size_t begin = before.rfind('\n') + 1;  // 0 if there is none
  return fmt::format("a syntax error at line {}, column {}", line, before.size() - begin + 1);
}

std::string shown(const Json& value) {
  if (value.is_object()) return "an object";
  std::string text = value.dump(-1, ' ', false, Json::error_handler_t::replace);
  if (text.size() <= kLongestShown) return text;
  return std::string(firstBytes(text, kLongestShown)) + "...";
}

/// The place of `value`, such as "key_frames[2].time", if it is in `from`, whose place is `place`.
std::optional<std::string> placeIn(const Json& from, const std::string& place, const Json& value) {
  if (&value == &from) return place;
  std::optional<std::string> found;
  if (from.is_array()) {
    for (size_t n = 0; n < from.size() && !found; ++n)
      found = placeIn(from[n], fmt::format("{}[{}]", place, n), value);
  } else if (from.is_object()) {
    for (auto below = from.begin(); below != from.end() && !found; ++below)
      found = placeIn(*below, place.empty() ? below.key() : place + "." + below.key(), value);
  }
  return found;
}

}  // namespace

JsonDocument::JsonDocument(std::string_view text, std::string file, std::string_view what, std::string advice)
    : file_(std::move(file)), advice_(std::move(advice)) {
  requireShallow(text, file_);
  try {
    json_ = std::make_unique<Json>(Json::parse(text));
  } catch (const Json::exception& error) {
    fail("", fmt::format("is not JSON (found {}, expected {})", faultOf(text, error), what));
  }
}

JsonDocument::~JsonDocument() = default;

std::string JsonDocument::placeOf(const Json& value) const {
  return placeIn(*json_, "", value).value_or("");
}

void JsonDocument::fail(const std::string& place, std::string_view fault) const {
  throw Error("{}: {}{}{}{}{}", file_, place, place.empty() ? "" : " ", fault, advice_.empty() ? "" : "; ",
              advice_);
}

void JsonField::fail(std::string_view expected) const {
  document_->fail(document_->placeOf(*value_),
                  fmt::format("is invalid (found {}, expected {})", shown(*value_), expected));
}

JsonField JsonField::at(std::string_view name) const {
  if (!value_->is_object()) fail("an object");
  const auto found = value_->find(std::string(name));
  if (found == value_->end()) {
    const std::string place = document_->placeOf(*value_);
    document_->fail(fmt::format("{}{}{}", place, place.empty() ? "" : ".", name), "is missing");
  }
  return of(*found);
}

std::optional<JsonField> JsonField::find(std::string_view name) const {
  if (!value_->is_object()) fail("an object");
  const auto found = value_->find(std::string(name));
  if (found == value_->end() || found->is_null()) return std::nullopt;
  return of(*found);
}

std::vector<std::string> JsonField::names() const {
  if (!value_->is_object()) fail("an object");
  std::vector<std::string> names;
  for (const auto& [name, value] : value_->items()) names.push_back(name);
  return names;
}

std::vector<JsonField> JsonField::elements(size_t most) const {
  if (!value_->is_array()) fail("a list");
  if (value_->size() > most)
    document_->fail(
        document_->placeOf(*value_),
        fmt::format("has too many entries (found {}, expected at most {})", value_->size(), most));
  std::vector<JsonField> elements;
  elements.reserve(value_->size());
  for (const Json& value : *value_) elements.push_back(of(value));
  return elements;
}

size_t JsonField::size() const {
  if (!value_->is_array()) fail("a list");
  return value_->size();
}

JsonField JsonField::operator[](size_t n) const {
  if (!(value_->is_array() && n < value_->size())) fail(fmt::format("a list of {} or more", n + 1));
  return of((*value_)[n]);
}

bool JsonField::isObject() const {
  return value_->is_object();
}

bool JsonField::isArray() const {
  return value_->is_array();
}

bool JsonField::isText() const {
  return value_->is_string();
}

bool JsonField::flag() const {
  if (!value_->is_boolean()) fail("true or false");
  return value_->get<bool>();
}

std::string JsonField::text() const {
  if (!value_->is_string()) fail("a string");
  return value_->get<std::string>();
}

double JsonField::number() const {
  if (!(value_->is_number() && std::isfinite(value_->get<double>()))) fail("a finite number");
  return value_->get<double>();
}

double JsonField::number(double least, double most) const {
  const bool right = value_->is_number() && value_->get<double>() >= least && value_->get<double>() <= most;
  if (!right) fail(fmt::format("a number from {} to {}", least, most));
  return value_->get<double>();
}

uint64_t JsonField::count(uint64_t least, uint64_t most) const {
  const bool right =
      value_->is_number_unsigned() && value_->get<uint64_t>() >= least && value_->get<uint64_t>() <= most;
  if (!right) fail(fmt::format("a whole number from {} to {}", least, most));
  return value_->get<uint64_t>();
}

glm::dvec3 JsonField::point(double largest) const {
  if (!(value_->is_array() && value_->size() == 3)) fail("three numbers");
  const glm::dvec3 point((*this)[0].number(), (*this)[1].number(), (*this)[2].number());
  if (std::max({std::abs(point.x), std::abs(point.y), std::abs(point.z)}) > largest)
    fail(fmt::format("three numbers of magnitude up to {}", largest));
  return point;
}

std::vector<double> JsonField::numbers() const {
  std::vector<double> numbers;
  for (const JsonField& value : elements()) numbers.push_back(value.number());
  return numbers;
}

std::vector<std::string> JsonField::texts() const {
  std::vector<std::string> texts;
  for (const JsonField& value : elements()) texts.push_back(value.text());
  return texts;
}

}  // namespace curvisplat
