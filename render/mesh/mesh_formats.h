// The formats that readMeshFile() knows (triangle_mesh.h), a function for each, and what they share: text in
// lines and words, and polygons as fans of triangles.
//
// Their results are checked in mesh_file.cpp: a parser may give indices and positions as the file has them.
// `path` is for messages; each function throws Error. Any thread. Included by the parsers only.
#pragma once

#include <charconv>
#include <cmath>
#include <filesystem>
#include <string_view>

#include "render/mesh/triangle_mesh.h"
#include "stream/base/error.h"

namespace curvisplat {

bool isBinaryStl(std::string_view bytes);
RawMesh parseBinaryStl(std::string_view bytes, const std::filesystem::path& path);
RawMesh parseAsciiStl(std::string_view bytes, const std::filesystem::path& path);
RawMesh parsePly(std::string_view bytes, const std::filesystem::path& path);
RawMesh parseObj(std::string_view bytes, const std::filesystem::path& path);

/// Text in lines and words.
class MeshText {
 public:
  MeshText(std::string_view text, const std::filesystem::path& path) : text_(text), path_(path) {}

  /// The next word of any line; empty at the end.
  std::string_view word() {
    while (at_ < text_.size() && isSpace(text_[at_])) line_ += text_[at_++] == '\n';
    const size_t begin = at_;
    while (at_ < text_.size() && !isSpace(text_[at_])) ++at_;
    return text_.substr(begin, at_ - begin);
  }
  /// The next word of this line; empty at its end.
  std::string_view wordOfLine() {
    while (at_ < text_.size() && isSpace(text_[at_]) && text_[at_] != '\n') ++at_;
    const size_t begin = at_;
    while (at_ < text_.size() && !isSpace(text_[at_])) ++at_;
    return text_.substr(begin, at_ - begin);
  }
  /// Goes to the next line. False at the end.
  bool nextLine() {
    const size_t end = text_.find('\n', at_);
    if (end == std::string_view::npos) {
      at_ = text_.size();
      return false;
    }
    at_ = end + 1;
    ++line_;
    return at_ < text_.size();
  }
  size_t line() const { return line_; }
  size_t left() const { return text_.size() - at_; }

  /// A finite number, of any word.
  double number() {
    const std::string_view found = word();
    double value = 0;
    const char* const begin = found.data() + (found.starts_with('+') ? 1 : 0);
    const auto [end, error] = std::from_chars(begin, found.data() + found.size(), value);
    if (found.empty())
      throw Error("{}: is truncated: it ends in line {} within a list of numbers", path_.string(), line_);
    if (error != std::errc{} || end != found.data() + found.size() || !std::isfinite(value))
      throw Error("{}: line {} has no finite number where one is expected (found '{}')", path_.string(),
                  line_, found.substr(0, 32));
    return value;
  }

 private:
  static bool isSpace(char c) {
    return c == ' ' || c == '\t' || c == '\n' || c == '\r' || c == '\v' || c == '\f';
  }

  const std::string_view text_;
  const std::filesystem::path& path_;
  size_t at_ = 0, line_ = 1;
};

/// Adds the triangles of a polygon, a fan from its first corner.
template <typename Corners>
void addPolygon(RawMesh& mesh, const Corners& corners) {
  for (size_t n = 2; n < corners.size(); ++n)
    mesh.triangles.push_back({static_cast<uint32_t>(corners[0]), static_cast<uint32_t>(corners[n - 1]),
                              static_cast<uint32_t>(corners[n])});
}

}  // namespace curvisplat
