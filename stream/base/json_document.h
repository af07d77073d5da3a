// How the program reads JSON: every value knows the file that it stands in, and its place there, so that errors name
// both.
//
//   JsonDocument file(readTextFile(path), path.string(), "a camera path");
//   for (const JsonField& key : file.root().at("key_frames").elements())
//     times.push_back(key.at("time").number());
//
// An error reads: "path.json: key_frames[2].time is invalid (found "a", expected a finite number)".
#pragma once

#include <cstddef>
#include <cstdint>
#include <glm/vec3.hpp>
#include <limits>
#include <memory>
#include <nlohmann/json_fwd.hpp>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

namespace curvisplat {

class JsonDocument;

/// A value of a JsonDocument, which must outlive it. What a member expects and does not find is an Error, which names
/// the file, the value's place, what was found and what was expected. Any thread.
class JsonField {
 public:
  // The member `name` of an object.
  JsonField at(std::string_view name) const;
  /// nullopt if there is no such field, or its value is null.
  std::optional<JsonField> find(std::string_view name) const;
  bool has(std::string_view name) const { return find(name).has_value(); }
  std::vector<std::string> names() const;

  // The elements of an array.
  std::vector<JsonField> elements(size_t most = std::numeric_limits<size_t>::max()) const;
  size_t size() const;
  JsonField operator[](size_t n) const;

  bool isObject() const;
  bool isArray() const;
  bool isText() const;

  bool flag() const;
  std::string text() const;
  /// Finite.
  double number() const;
  /// A number from `least` to `most`.
  double number(double least, double most) const;
  uint64_t count(uint64_t least = 0, uint64_t most = std::numeric_limits<uint64_t>::max()) const;
  /// Three numbers of magnitudes up to `largest`.
  glm::dvec3 point(double largest = std::numeric_limits<double>::max()) const;
  std::vector<double> numbers() const;
  std::vector<std::string> texts() const;

  [[noreturn]] void fail(std::string_view expected) const;
  const nlohmann::ordered_json& json() const { return *value_; }

 private:
  friend class JsonDocument;
  JsonField(const JsonDocument& document, const nlohmann::ordered_json& value)
      : document_(&document), value_(&value) {}
  JsonField of(const nlohmann::ordered_json& value) const { return {*document_, value}; }

  const JsonDocument* document_;
  const nlohmann::ordered_json* value_;
};

/// A parsed JSON text. Its fields must not outlive it.
class JsonDocument {
 public:
  /// Parses `text`, the contents of `file`. Throws Error, which says that `what` ("a camera path") was expected, with
  /// line and column of the fault, or that brackets nest more than 64 deep: values are walked recursively. `advice`
  /// ("convert again") ends all errors.
  JsonDocument(std::string_view text, std::string file, std::string_view what, std::string advice = "");
  ~JsonDocument();
  JsonDocument(const JsonDocument&) = delete;
  JsonDocument& operator=(const JsonDocument&) = delete;

  JsonField root() const { return {*this, *json_}; }
  /// No JsonField may be in use.
  nlohmann::ordered_json& json() { return *json_; }

 private:
  friend class JsonField;
  std::string placeOf(const nlohmann::ordered_json& value) const;
  [[noreturn]] void fail(const std::string& place, std::string_view fault) const;

  const std::string file_, advice_;
  std::unique_ptr<nlohmann::ordered_json> json_;
};

}  // namespace curvisplat
