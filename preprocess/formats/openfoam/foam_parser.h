// The text of a file of OpenFOAM as tokens: words, numbers, quoted text, and punctuation, one character each.
// Comments are left out. Entries of the dictionaries that have been read stand for "$name". For one thread.
#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <deque>
#include <filesystem>
#include <map>
#include <string>
#include <vector>

#include "stream/base/file.h"

namespace curvisplat {

class FoamParser {
 public:
  /// `shown`: the name of the file in errors, which all members throw at bytes that are not what is expected.
  FoamParser(const std::filesystem::path& path, std::string shown);

  const InputFile& file() const { return file_; }
  const std::string& name() const { return name_; }
  /// The end of the text: that of the file, or of a processor's part of it.
  uint64_t end() const { return end_; }
  void setEnd(uint64_t end) { end_ = end; }
  uint64_t offset() const { return buffer_offset_ + at_; }
  void seek(uint64_t offset);
  [[noreturn]] void fail(const std::string& what) const;

  /// The next character; -1 at the end of the text.
  int peek();
  int get();
  void skipSpace();
  /// The next token; empty at the end. "$name", "${name}", "$:name" and "$dictionary.name" are replaced by the tokens of the entry
  /// that they name.
  std::string token();
  bool atEnd();
  void expect(const char* wanted);
  /// Throws an Error about a value that is not `wanted`.
  [[noreturn]] void failValue(const std::string& word, const std::string& wanted) const;
  double number();
  /// A number of 0 or more.
  uint64_t label();

  /// Goes to the next part of a collated file, `// Processor3 NEWLINE bytes NEWLINE ( ... )`. Returns its end.
  uint64_t enterPart();
  /// Reads entries of a dictionary up to the one called `wanted`, or to the end of the text. Returns whether it was
  /// found. Those before it are kept, since values may refer to them; so are those of files that are included.
  bool findEntry(const std::string& wanted, int depth = 0);
  /// The tokens of an entry, up to its semicolon or the end of its dictionary.
  std::vector<std::string> entryTokens();

 private:
  std::string nextToken();
  std::vector<std::string> entryNamed(const std::string& key) const;
  void add(std::string& word, int c) const;
  void include(const std::filesystem::path& path, int depth);
  bool holds(const std::string& condition);
  void skipBranch();

  InputFile file_;
  std::string name_;
  uint64_t end_;
  std::vector<char> buffer_;
  uint64_t buffer_offset_ = 0;
  size_t at_ = 0, filled_ = 0, refill_;  // bytes to read next: few, in case it goes on elsewhere
  std::map<std::string, std::vector<std::string>> entries_;  // what "$name" stands for
  std::deque<std::string> expanded_;                         // tokens of such entries, which come next
  int expansions_ = 0, includes_ = 0;
  std::string missing_;  // a file that is included and was not found
};

}  // namespace curvisplat
