// The headers of a Tecplot text file: words, texts in quotes, and signs.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

namespace curvisplat {

struct TecplotToken {
  enum class Kind { kWord, kText, kSign } kind = Kind::kWord;
  std::string text;  // of a word in capitals, without quotes
  std::string raw;   // as written
  bool begins_line = false;
};

/// Appends the tokens of a line. Comments (#) end it.
void tokenizeTecplot(std::string_view line, std::vector<TecplotToken>& tokens);

/// Reads tokens one after the other.
class TecplotTokens {
 public:
  explicit TecplotTokens(std::vector<TecplotToken> tokens) : tokens_(std::move(tokens)) {}

  bool done() const { return at_ >= tokens_.size(); }
  /// The next token; empty at the end.
  const TecplotToken& peek() const { return done() ? none_ : tokens_[at_]; }
  const TecplotToken& pop() {
    const TecplotToken& token = peek();
    ++at_;
    return token;
  }
  /// Takes the sign if it is the next token.
  bool takeSign(char sign);
  /// Whether the next token begins a record: ZONE, TITLE, ...
  bool atRecord() const;
  /// The tokens of the next value: a single one, or those between brackets.
  std::vector<TecplotToken> takeValue();

 private:
  std::vector<TecplotToken> tokens_;
  size_t at_ = 0;
  TecplotToken none_;
};

/// Numbers of variables, from 1, and what they are set to: "([4-5,7]=CELLCENTERED,[1]=NODAL)" as takeValue() gives it;
/// also without brackets around the numbers. nullopt if it is not of that form, has numbers beyond `variables`, or
/// has them many times over.
using TecplotSets = std::vector<std::pair<std::vector<size_t>, std::string>>;
std::optional<TecplotSets> tecplotSets(const std::vector<TecplotToken>& value, size_t variables);

}  // namespace curvisplat
