#include "preprocess/formats/tecplot/tecplot_header.h"

#include <algorithm>
#include <charconv>
#include <cstring>

namespace curvisplat {
namespace {

constexpr std::string_view kRecords[] = {"TITLE",    "VARIABLES",    "ZONE",           "FILETYPE",  "TEXT",
                                         "GEOMETRY", "CUSTOMLABELS", "DATASETAUXDATA", "VARAUXDATA"};

bool isSpace(char c) {
  return c == ' ' || (c >= '\t' && c <= '\r');
}

bool isSign(char c) {
  return std::strchr("=,()[]", c) != nullptr;
}

std::string capitals(std::string_view text) {
  std::string result(text);
  for (char& c : result)
    if (c >= 'a' && c <= 'z') c = static_cast<char>(c - 'a' + 'A');
  return result;
}

/// Appends "4" or "2-5".
bool appendRange(const std::string& text, size_t variables, std::vector<size_t>& to) {
  const char* const end = text.data() + text.size();
  size_t first = 0;
  auto [at, error] = std::from_chars(text.data(), end, first);
  if (error != std::errc()) return false;
  size_t last = first;
  if (at != end && *at == '-') {
    const auto [stop, failed] = std::from_chars(at + 1, end, last);
    if (failed != std::errc()) return false;
    at = stop;
  }
  if (at != end || first < 1 || last < first || last > variables) return false;
  for (size_t n = first; n <= last; ++n) to.push_back(n - 1);
  return true;
}

}  // namespace

void tokenizeTecplot(std::string_view line, std::vector<TecplotToken>& tokens) {
  bool begins = true;
  for (size_t at = 0; at < line.size();) {
    const char c = line[at];
    if (isSpace(c)) {
      ++at;
      continue;
    }
    if (c == '#') return;
    TecplotToken token;
    token.begins_line = begins;
    begins = false;
    size_t end = at + 1;
    if (c == '"' || c == '\'') {
      while (end < line.size() && line[end] != c) ++end;
      token.kind = TecplotToken::Kind::kText;
      token.raw = line.substr(at + 1, end - at - 1);
      token.text = token.raw;
      end = std::min(end + 1, line.size());
    } else if (isSign(c)) {
      token.kind = TecplotToken::Kind::kSign;
      token.raw = token.text = std::string(1, c);
    } else {
      while (end < line.size() && !isSpace(line[end]) && !isSign(line[end]) && line[end] != '"') ++end;
      token.raw = line.substr(at, end - at);
      token.text = capitals(token.raw);
    }
    tokens.push_back(std::move(token));
    at = end;
  }
}

bool TecplotTokens::takeSign(char sign) {
  if (done() || peek().kind != TecplotToken::Kind::kSign || peek().text[0] != sign) return false;
  ++at_;
  return true;
}

bool TecplotTokens::atRecord() const {
  const TecplotToken& token = peek();
  return token.kind == TecplotToken::Kind::kWord && token.begins_line &&
         std::find(std::begin(kRecords), std::end(kRecords), token.text) != std::end(kRecords);
}

std::vector<TecplotToken> TecplotTokens::takeValue() {
  std::vector<TecplotToken> value;
  int depth = 0;
  do {
    if (done()) break;
    const TecplotToken& token = pop();
    const bool sign = token.kind == TecplotToken::Kind::kSign;
    if (sign && (token.text == "(" || token.text == "[")) ++depth;
    if (sign && (token.text == ")" || token.text == "]")) --depth;
    value.push_back(token);
  } while (depth > 0);
  if (value.size() >= 2 && value.front().text == "(" && value.back().text == ")") {
    value.erase(value.begin());
    value.pop_back();
  }
  return value;
}

std::optional<TecplotSets> tecplotSets(const std::vector<TecplotToken>& value, size_t variables) {
  constexpr size_t kOften = 4;  // a later set may correct an earlier one
  TecplotSets sets;
  TecplotTokens tokens(value);
  size_t total = 0;
  while (!tokens.done()) {
    tokens.takeSign(',');
    if (tokens.done()) break;
    std::vector<size_t> numbers;
    const bool bracketed = tokens.takeSign('[');
    do {
      if (!appendRange(tokens.pop().text, variables, numbers)) return std::nullopt;
      if (total + numbers.size() > kOften * variables) return std::nullopt;
    } while (tokens.takeSign(',') && !tokens.done());
    if (bracketed && !tokens.takeSign(']')) return std::nullopt;
    total += numbers.size();
    sets.emplace_back(std::move(numbers), "");
    if (tokens.takeSign('=')) sets.back().second = tokens.pop().text;
  }
  return sets;
}

}  // namespace curvisplat
