// Texts: white space, words and letters, and words of a shell; the name that a misspelled one is taken for;
// times in the units of other files (dates are tested with those of netCDF4:
// tests/end_to_end/model_files_test.py); and errors of JSON files, which have the file, the value's place in
// it, what was found and what was expected.
#include <gtest/gtest.h>

#include <limits>
#include <sstream>
#include <string>
#include <vector>

#include "stream/base/calendar.h"
#include "stream/base/error.h"
#include "stream/base/json_document.h"
#include "stream/base/text.h"
#include "tests/support/expect_error.h"

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

TEST(Words, AreCutBetweenCharacters) {
  EXPECT_EQ(firstBytes("abc", 3), "abc");
  EXPECT_EQ(firstBytes("abc", 2), "ab");
  EXPECT_EQ(firstBytes("a\xc3\xa4z", 2), "a");  // an a with two dots has two bytes
  EXPECT_EQ(firstBytes("a\xc3\xa4z", 3), "a\xc3\xa4");
  EXPECT_EQ(firstBytes("\xe2\x82\xac", 2), "");  // the sign of the euro has three
  EXPECT_EQ(firstBytes("", 5), "");
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

TEST(NumberText, OfNaNHasNoSign) {
  EXPECT_EQ(numberText(-0.1), "-0.1");
  EXPECT_EQ(numberText(1234567.25), "1.23457e+06");
  EXPECT_EQ(numberText(1234567.25, 9), "1234567.25");
  EXPECT_EQ(numberText(-std::numeric_limits<double>::quiet_NaN()), "NaN");
}

TEST(ByteText, HasTheUnitThatPeopleWouldTake) {
  EXPECT_EQ(byteText(0), "0 bytes");
  EXPECT_EQ(byteText(1), "1 byte");
  EXPECT_EQ(byteText(1023), "1023 bytes");
  EXPECT_EQ(byteText(1024), "1 KiB");
  EXPECT_EQ(byteText(1536), "1.5 KiB");
  EXPECT_EQ(byteText((1 << 20) - 1), "1 MiB");
  EXPECT_EQ(byteText(144 << 20), "144 MiB");
  EXPECT_EQ(byteText(1000 << 20), "1000 MiB");
  EXPECT_EQ(byteText(uint64_t{96} << 30), "96 GiB");
  EXPECT_EQ(byteText((uint64_t{96} << 30) + (uint64_t{1} << 28)), "96.25 GiB");
  EXPECT_EQ(byteText(UINT64_MAX), "16 EiB");
}

TEST(Suggestion, IsTheClosestNameOrNone) {
  const std::vector<std::string> names{"--size", "--scale", "--scalar", "--opacity-unit"};
  EXPECT_EQ(closestTo("--sise", names), "--size");
  EXPECT_EQ(closestTo("--SIZE", names), "--size");
  EXPECT_EQ(closestTo("--isze", names), "--size");  // swapped letters
  EXPECT_EQ(closestTo("--sclar", names), "--scalar");
  EXPECT_EQ(closestTo("--opacityunit", names), "--opacity-unit");
  EXPECT_EQ(closestTo("--background", names), "");
  EXPECT_EQ(closestTo("", names), "");
  EXPECT_EQ(closestTo("of", std::vector<std::string>{"on", "off"}), "off");
  EXPECT_EQ(closestTo(std::string(10'000, 'x'), names), "");
}

TEST(Suggestion, OfNamesThatBeginAlikeTheShortest) {
  const std::vector<std::string> names{"mach_number", "mach_number_of_the_frame", "iso", "--frame-rate"};
  EXPECT_EQ(closestTo("mach", names), "mach_number");
  EXPECT_EQ(closestTo("isometric", names), "iso");
  EXPECT_EQ(closestTo("--frame", names), "--frame-rate");
  EXPECT_EQ(closestTo("ma", names), "");
  EXPECT_EQ(didYouMean("mach", names), " (did you mean mach_number?)");
  EXPECT_EQ(didYouMean("density", names), "");
}

TEST(Suggestion, SharesALetter) {
  EXPECT_EQ(closestTo("T", std::vector<std::string>{"i", "j"}), "");
  EXPECT_EQ(closestTo("T", std::vector<std::string>{"i", "t"}), "t");
}

TEST(Calendar, ConvertsTimesToOtherUnits) {
  struct Case {
    double time;
    TimeUnit from, to;
    std::optional<double> expected;
  };
  const Case cases[] = {
      {0.1, {"days since 2000-01-01", ""}, {"days since 2000-1-1 00:00:00", "gregorian"}, 0.1},
      {5, {"days since 2001-01-01", ""}, {"days since 2000-01-01", ""}, 371},
      {5, {"days since 2001-01-01", "noleap"}, {"days since 2000-01-01", "365_day"}, 370},
      {5, {"days since 2001-01-01", "360_day"}, {"days since 2000-01-01", "360_day"}, 365},
      {6, {"hours since 2000-01-01", ""}, {"days since 2000-01-01", ""}, 0.25},
      {1, {"days since 2000-01-01", ""}, {"minutes since 2000-01-01 12:00", ""}, 720},
      {0, {"seconds since 2000-01-01 00:00:00 +1:00", ""}, {"hours since 2000-01-01", ""}, -1},
      {1, {"days since 1582-10-04", "standard"}, {"days since 1582-10-15", "proleptic_gregorian"}, 0},
      {90, {"s", ""}, {"minutes", ""}, 1.5},
      {1, {"months since 2000-01-01", "noleap"}, {"months since 2000-01-01", "noleap"}, 1},
      {1, {"months since 2000-01-01", ""}, {"days since 2000-01-01", ""}, std::nullopt},
      {1, {"days since 2000-01-01", "noleap"}, {"days since 2000-01-01", ""}, std::nullopt},
      {1, {"days since 2000-01-01", "martian"}, {"days since 2000-01-01", ""}, std::nullopt},
      {1, {"days", ""}, {"days since 2000-01-01", ""}, std::nullopt},
      {1, {"", ""}, {"days since 2000-01-01", ""}, std::nullopt},
  };
  for (const Case& each : cases)
    EXPECT_EQ(timeInUnit(each.time, each.from, each.to), each.expected)
        << each.from.name << " " << each.from.calendar << " to " << each.to.name << " " << each.to.calendar;
}

constexpr const char* kText =
    R"({"list": [{"x": 1}, {"x": "two", "y": [1, 2]}], "none": null, "deep": {"er": [[0, -1]]}, "flag": true})";

template <typename Read>
std::string jsonError(const Read& read, const char* text = kText) {
  return curvisplat::errorOf([&] {
    const JsonDocument document(text, "a.json", "a thing", "look again");
    read(document.root());
  });
}

TEST(JsonDocument, NamesThePlaceOfWhatIsWrong) {
  EXPECT_EQ(jsonError([](const JsonField& root) { root.at("list")[1].at("x").number(); }),
            "a.json: list[1].x is invalid (found \"two\", expected a finite number); look again");
  EXPECT_EQ(jsonError([](const JsonField& root) { root.at("list")[1].at("z"); }),
            "a.json: list[1].z is missing; look again");
  EXPECT_EQ(jsonError([](const JsonField& root) { root.at("deep").at("er")[0][1].count(); }),
            "a.json: deep.er[0][1] is invalid (found -1, expected a whole number from 0 to "
            "18446744073709551615); look again");
  EXPECT_EQ(jsonError([](const JsonField& root) { root.at("list")[1].at("y").point(); }),
            "a.json: list[1].y is invalid (found [1,2], expected three numbers); look again");
  EXPECT_EQ(jsonError([](const JsonField& root) { root.at("list").elements(1); }),
            "a.json: list has too many entries (found 2, expected at most 1); look again");
  EXPECT_EQ(jsonError([](const JsonField& root) { root.at("flag").text(); }),
            "a.json: flag is invalid (found true, expected a string); look again");
  EXPECT_EQ(jsonError([](const JsonField& root) { root.at("list")[2]; }),
            "a.json: list is invalid (found [{\"x\":1},{\"x\":\"two\",\"y\":[1,2]}], expected a list of 3 or "
            "more); "
            "look again");
}

TEST(JsonDocument, NamesThePlaceOfASyntaxError) {
  const auto nothing = [](const JsonField&) {};
  EXPECT_EQ(jsonError(nothing, "{\n \"a\": oops}"),
            "a.json: is not JSON (found a syntax error at line 2, column 7, expected a thing); look again");
  EXPECT_EQ(jsonError(nothing, " \n"), "a.json: is not JSON (found no text, expected a thing); look again");
  EXPECT_EQ(jsonError(nothing, "[1e999]"),
            "a.json: is not JSON (found a number that is too large, expected a thing); look again");
  EXPECT_EQ(jsonError(nothing, std::string(65, '[').c_str()),
            "a.json: has brackets more than 64 deep at byte 64; the file is damaged or of another kind");
}

TEST(JsonDocument, FieldsThatAreNullAreNotThere) {
  const JsonDocument document(kText, "a.json", "a thing");
  EXPECT_FALSE(document.root().has("none"));
  EXPECT_FALSE(document.root().has("other"));
  EXPECT_TRUE(document.root().find("flag")->flag());
  EXPECT_EQ(document.root().names(), (std::vector<std::string>{"list", "none", "deep", "flag"}));
}

// The part of a long text that is shown ends between two characters.
TEST(JsonDocument, ShowsTheBeginningOfLongTexts) {
  std::string text = "\"";
  for (int n = 0; n < 50; ++n) text += "\xc3\xa9";
  const std::string error = jsonError([](const JsonField& root) { root.flag(); }, (text + "\"").c_str());
  expectSays(error, "\xc3\xa9..., expected true or false");
}

}  // namespace
}  // namespace curvisplat
