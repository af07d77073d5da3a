// White space, words and letters of texts, and words of a shell.
#include "stream/base/words.h"

#include <gtest/gtest.h>

#include <sstream>
#include <string>
#include <vector>

#include "stream/base/shell_word.h"

namespace curvisplat {
namespace {

std::vector<std::string> wordsOfStream(const std::string& text) {
  std::istringstream stream(text);
  std::vector<std::string> words;
  for (std::string word; stream >> word;) words.push_back(word);
  return words;
}

TEST(Words, AreTheOnesOfAStream) {
  for (const std::string text : {"", " ", "a", " a", "a ", " \t\r\n\v\f", "\va\f", "two  words",
                                 "a\tb\r\nc\vd\fe", "no\xa0 break", "\xc3\xa9t\xc3\xa9 2"}) {
    const std::vector<std::string_view> words = wordsOf(text);
    EXPECT_EQ(std::vector<std::string>(words.begin(), words.end()), wordsOfStream(text)) << text;
    EXPECT_EQ(trimmed(text).empty(), words.empty()) << text;
  }
  const std::string zero("a\0b c", 5);
  EXPECT_EQ(wordsOf(zero).size(), 2u);
}

TEST(Words, AreTrimmedAtTheEndsAlone) {
  EXPECT_EQ(trimmed(" \ttwo  words\r\n"), "two  words");
  EXPECT_EQ(trimmed("\v\f"), "");
  EXPECT_EQ(trimmed("x"), "x");
}

TEST(Words, HaveSmallLettersOfAsciiAlone) {
  EXPECT_EQ(lowerCase("AZaz@[`{09"), "azaz@[`{09");
  EXPECT_EQ(lowerCase("\xc3\x89T\xc3\x89"), "\xc3\x89t\xc3\x89");
  EXPECT_TRUE(isSameIgnoringCase("LocalHost", "localhost"));
  EXPECT_FALSE(isSameIgnoringCase("localhost", "localhost."));
  EXPECT_FALSE(isSameIgnoringCase("@", "`"));
  EXPECT_TRUE(isSameIgnoringCase("", ""));
}

TEST(Words, OfAShellHaveQuotesWhereTheyNeedThem) {
  EXPECT_EQ(shellWord("a_b-c./,:=+@%1"), "a_b-c./,:=+@%1");
  EXPECT_EQ(shellWord("Temperature [K]"), "'Temperature [K]'");
  EXPECT_EQ(shellWord("it's"), "'it'\\''s'");
  EXPECT_EQ(shellWord(""), "''");
  EXPECT_EQ(shellWord("a\nb'"), "$'a\\012b\\''");
  EXPECT_EQ(shellOption("--scalar", "T (K)"), "--scalar 'T (K)'");
  EXPECT_EQ(shellOption("--range", "-1,2"), "--range=-1,2");
}

}  // namespace
}  // namespace curvisplat
