#include "preprocess/formats/openfoam/foam_parser.h"

#include <fmt/format.h>

#include <algorithm>
#include <charconv>
#include <initializer_list>
#include <iterator>
#include <span>
#include <utility>

#include "preprocess/formats/common/byte_source.h"
#include "preprocess/formats/common/text_reader.h"
#include "stream/base/error.h"

namespace curvisplat {
namespace {

constexpr size_t kBufferBytes = size_t{256} << 10;
constexpr size_t kFirstRead = 4096;
constexpr uint64_t kMaxNumbers = 100'000'000'000'000;
constexpr int kMaxExpansions = 100;
constexpr size_t kMaxEntryTokens = 100;  // longer ones are lists of values, which no field uses
constexpr int kMaxIncludeDepth = 8;
constexpr int kMaxIncludes = 100;  // of one file, with those of the files that it includes

bool isSpace(int c) {
  return c == ' ' || c == '\t' || c == '\n' || c == '\r';
}

bool isPunctuation(int c) {
  return c == '(' || c == ')' || c == '{' || c == '}' || c == '[' || c == ']' || c == ';';
}

/// The tokens of the entry `key` of a dictionary, { key tokens ; ... }; none if it has no such entry.
std::vector<std::string> entryWithin(const std::vector<std::string>& dictionary, const std::string& key) {
  for (size_t n = 1; n < dictionary.size(); ++n) {
    const std::string& name = dictionary[n];
    std::vector<std::string> tokens;
    int braces = 0;
    for (++n; n < dictionary.size() && (braces > 0 || dictionary[n] != ";"); ++n) {
      braces += dictionary[n] == "{" ? 1 : dictionary[n] == "}" ? -1 : 0;
      tokens.push_back(dictionary[n]);
      if (dictionary[n] == "}" && braces == 0) break;
    }
    if (name == key) return tokens;
  }
  return {};
}

/// The folder of the case that the file belongs to: the nearest one around it that has a folder "system", else "constant".
std::filesystem::path caseAround(const std::filesystem::path& file) {
  std::error_code error;
  const std::filesystem::path from = std::filesystem::absolute(file, error).parent_path();
  for (const char* const has : {"system", "constant"})
    for (std::filesystem::path folder = from; folder.has_relative_path(); folder = folder.parent_path())
      if (std::filesystem::is_directory(folder / has, error)) return folder;
  return from;
}

}  // namespace

FoamParser::FoamParser(const std::filesystem::path& path, std::string shown)
    : file_(path), name_(std::move(shown)), end_(file_.size()), buffer_(kBufferBytes), refill_(kFirstRead) {}

void FoamParser::fail(const std::string& what) const {
  throw Error("{}: byte {}: {}", name_, offset(), printable(what));
}

int FoamParser::peek() {
  if (at_ == filled_) {
    buffer_offset_ += filled_;
    at_ = 0;
    filled_ = static_cast<size_t>(std::min<uint64_t>(refill_, end_ - buffer_offset_));
    refill_ = std::min(2 * refill_, buffer_.size());
    file_.readAt(buffer_offset_, std::span(buffer_.data(), filled_));
    if (filled_ == 0) return -1;
  }
  return static_cast<unsigned char>(buffer_[at_]);
}

int FoamParser::get() {
  const int c = peek();
  if (c >= 0) ++at_;
  return c;
}

void FoamParser::add(std::string& word, int c) const {
  word += static_cast<char>(c);
  if (word.size() > 1000) fail("has a word of more than 1000 characters; the file is damaged");
}

void FoamParser::seek(uint64_t offset) {
  buffer_offset_ = offset;
  at_ = filled_ = 0;
  refill_ = kFirstRead;
}

uint64_t FoamParser::enterPart() {
  const uint64_t bytes = label();
  expect("(");
  if (bytes >= end_ - offset())
    fail(fmt::format("needs {} bytes, but {} are left; the file is truncated", bytes, end_ - offset()));
  return offset() + bytes;
}

void FoamParser::skipSpace() {
  while (isSpace(peek())) get();
}

std::string FoamParser::token() {
  for (;;) {
    std::string word = nextToken();
    if (word.empty() || word[0] != '$') return word;
    if (word == "$" && peek() == '{')
      for (int next = 0; next != '}' && peek() >= 0; add(word, next)) next = get();
    std::string key = word.substr(1);
    if (key.size() > 2 && key.front() == '{') key = key.substr(1, key.size() - 2);
    const std::vector<std::string> tokens = entryNamed(key);
    // Entries may name one another in a circle.
    if (tokens.empty() || ++expansions_ > kMaxExpansions) return word;
    expanded_.insert(expanded_.begin(), tokens.begin(), tokens.end());
  }
}

/// The tokens of "name", ":name" and "!name" (from the top), "..name" (from a dictionary around), and "a.b" or "a/b" (within a).
std::vector<std::string> FoamParser::entryNamed(const std::string& key) const {
  const auto whole = entries_.find(key);
  if (whole != entries_.end()) return whole->second;
  const size_t begin = key.find_first_not_of(":!./^");
  if (begin == std::string::npos) return {};
  size_t end = std::min(key.find_first_of("./", begin), key.size());
  const auto entry = entries_.find(key.substr(begin, end - begin));
  if (entry == entries_.end()) return {};
  std::vector<std::string> tokens = entry->second;
  while (end < key.size()) {
    const size_t from = end + 1;
    end = std::min(key.find_first_of("./", from), key.size());
    tokens = entryWithin(tokens, key.substr(from, end - from));
  }
  return tokens;
}

std::string FoamParser::nextToken() {
  if (!expanded_.empty()) {
    std::string word = std::move(expanded_.front());
    expanded_.pop_front();
    return word;
  }
  for (;;) {
    skipSpace();
    const int c = get();
    if (c < 0) return "";
    if (c == '/' && peek() == '/') {
      while (peek() >= 0 && peek() != '\n') get();
      continue;
    }
    if (c == '/' && peek() == '*') {
      for (int before = 0; peek() >= 0;) {
        const int next = get();
        if (before == '*' && next == '/') break;
        before = next;
      }
      continue;
    }
    std::string word(1, static_cast<char>(c));
    if (isPunctuation(c)) return word;
    if (c == '"') {
      for (int next = get(); next >= 0 && next != '"'; next = get()) add(word, next);
      return word;
    }
    while (peek() >= 0 && !isSpace(peek()) && !isPunctuation(peek())) add(word, get());
    return word;
  }
}

void FoamParser::expect(const char* wanted) {
  const std::string found = token();
  if (found == wanted) return;
  if (found.starts_with('$') || found.starts_with('#')) failValue(found, fmt::format("\"{}\"", wanted));
  fail(fmt::format("found \"{}\"; expected \"{}\"; the file is truncated or damaged", found.substr(0, 30),
                   wanted));
}

void FoamParser::failValue(const std::string& word, const std::string& wanted) const {
  if (!word.empty() && (word[0] == '$' || word[0] == '#'))
    fail(
        fmt::format("has \"{}\" in the place of {}, which only OpenFOAM can evaluate: write the values with "
                    "foamDictionary -expand FILE{}",
                    word.substr(0, 30), wanted,
                    missing_.empty() ? "" : fmt::format(" (its #include \"{}\" is not found)", missing_)));
  fail(
      fmt::format("found \"{}\"; expected {}; the file is truncated or damaged", word.substr(0, 30), wanted));
}

double FoamParser::number() {
  double value = 0;
  const std::string word = token();
  if (!parseNumber(word, value)) failValue(word, "a number");
  return value;
}

uint64_t FoamParser::label() {
  const std::string word = token();
  uint64_t value = 0;
  const auto [stop, error] = std::from_chars(word.data(), word.data() + word.size(), value);
  if (error != std::errc{} || stop != word.data() + word.size() || value > kMaxNumbers)
    failValue(word, "a number of 0 or more");
  return value;
}

bool FoamParser::atEnd() {
  const uint64_t begin = offset();
  const bool ended = token().empty();
  seek(begin);
  return ended;
}

std::vector<std::string> FoamParser::entryTokens() {
  std::vector<std::string> tokens;
  int braces = 0;
  for (std::string word = token(); !word.empty(); word = token()) {
    if (word == ";" && braces == 0) break;
    braces += word == "{" ? 1 : word == "}" ? -1 : 0;
    if (tokens.size() <= kMaxEntryTokens) tokens.push_back(word);
    if (word == "}" && braces <= 0) break;
  }
  return tokens;
}

void FoamParser::include(const std::filesystem::path& path, int depth) {
  // "$FOAM_CASE/system/values", "${FOAM_CASE}/...", "<case>/...", "<system>/..."
  std::filesystem::path included = std::filesystem::path(name_).parent_path() / path;
  const std::string begin = path.begin()->string();
  if (begin == "$FOAM_CASE" || begin == "${FOAM_CASE}" || (begin.starts_with('<') && begin.ends_with('>'))) {
    included = caseAround(name_);
    if (begin == "<system>" || begin == "<constant>") included /= begin.substr(1, begin.size() - 2);
    for (auto part = std::next(path.begin()); part != path.end(); ++part) included /= *part;
  }
  std::error_code no_folder;
  if (leadsOut(caseAround(name_), std::filesystem::absolute(included, no_folder)))
    fail(fmt::format(
        "includes \"{}\", which lies outside the case; put it into the case's folder and correct the name",
        path.string()));
  if (depth >= kMaxIncludeDepth || !isRegularFile(included)) {
    missing_ = path.string();  // what it defines is missed where it is used
    return;
  }
  if (++includes_ > kMaxIncludes) fail(fmt::format("includes more than {} files", kMaxIncludes));
  FoamParser other(included, included.string());
  other.includes_ = includes_;
  other.entries_ = std::move(entries_);
  other.findEntry("", depth + 1);
  entries_ = std::move(other.entries_);
  includes_ = other.includes_;
  if (!other.missing_.empty()) missing_ = other.missing_;
}

/// Whether `#if WORD`, `#ifeq WORD WORD` or `#ifeq (WORD WORD)` holds. Numbers are compared as such.
bool FoamParser::holds(const std::string& condition) {
  std::string first = token();
  const bool enclosed = condition == "#ifeq" && first == "(";
  if (enclosed) first = token();
  const std::string second = condition == "#ifeq" ? token() : "";
  if (enclosed) expect(")");
  for (const std::string& word : {first, second})
    if (word.starts_with('#') || word.starts_with('$')) failValue(word, "a word of " + condition);
  double number = 0, other = 0;
  if (condition == "#ifeq")
    return parseNumber(first, number) && parseNumber(second, other)
               ? number == other
               : first.substr(first.starts_with('"')) == second.substr(second.starts_with('"'));
  if (parseNumber(first, number)) return number != 0;
  const auto is_one_of = [&](std::initializer_list<const char*> words) {
    return std::find(words.begin(), words.end(), first) != words.end();
  };
  if (is_one_of({"true", "on", "yes", "y", "t"})) return true;
  if (!is_one_of({"false", "off", "no", "n", "f", "none"})) failValue(first, "true or false");
  return false;
}

/// Goes behind the #else or the #endif of a branch that is not read.
void FoamParser::skipBranch() {
  int depth = 0;
  for (std::string word = nextToken(); !word.empty(); word = nextToken()) {
    if (depth == 0 && (word == "#else" || word == "#endif")) return;
    if (depth == 0 && word == "#elif") failValue(word, "#else or #endif");
    depth += word == "#if" || word == "#ifeq" ? 1 : word == "#endif" ? -1 : 0;
  }
}

bool FoamParser::findEntry(const std::string& wanted, int depth) {
  for (std::string key = token(); !key.empty(); key = token()) {
    if (key == wanted) return true;
    if (key.starts_with("#include")) {
      const std::string path = token();
      if (path.starts_with('"') && path.size() > 1) include(path.substr(1), depth);
    } else if (key == "#inputMode" || key == "#remove") {
      token();
    } else if (key == "#if" || key == "#ifeq") {
      if (!holds(key)) skipBranch();
    } else if (key == "#elif") {
      failValue(key, "#else or #endif");
    } else if (key == "#else") {  // behind the branch that was read
      skipBranch();
    } else if (key != ";" && key != "}" && key != "#endif") {
      std::vector<std::string> tokens = entryTokens();
      if (tokens.size() <= kMaxEntryTokens) entries_[key] = std::move(tokens);
    }
  }
  return false;
}

}  // namespace curvisplat
