// Errors of JSON files: the file, the value's place in it, what was found and what was expected.
#include "stream/base/json_document.h"

#include <gtest/gtest.h>

#include "stream/base/error.h"

namespace curvisplat {
namespace {

constexpr const char* kText =
    R"({"list": [{"x": 1}, {"x": "two", "y": [1, 2]}], "none": null, "deep": {"er": [[0, -1]]}, "flag": true})";

template <typename Read>
std::string errorOf(const Read& read, const char* text = kText) {
  try {
    const JsonDocument document(text, "a.json", "a thing", "look again");
    read(document.root());
  } catch (const Error& error) {
    return error.what();
  }
  return "";
}

TEST(JsonDocument, NamesThePlaceOfWhatIsWrong) {
  EXPECT_EQ(errorOf([](const JsonField& root) { root.at("list")[1].at("x").number(); }),
            "a.json: list[1].x is invalid (found \"two\", expected a finite number); look again");
  EXPECT_EQ(errorOf([](const JsonField& root) { root.at("list")[1].at("z"); }),
            "a.json: list[1].z is missing; look again");
  EXPECT_EQ(errorOf([](const JsonField& root) { root.at("deep").at("er")[0][1].count(); }),
            "a.json: deep.er[0][1] is invalid (found -1, expected a whole number from 0 to "
            "18446744073709551615); look again");
  EXPECT_EQ(errorOf([](const JsonField& root) { root.at("list")[1].at("y").point(); }),
            "a.json: list[1].y is invalid (found [1,2], expected three numbers); look again");
  EXPECT_EQ(errorOf([](const JsonField& root) { root.at("list").elements(1); }),
            "a.json: list has too many entries (found 2, expected at most 1); look again");
  EXPECT_EQ(errorOf([](const JsonField& root) { root.at("flag").text(); }),
            "a.json: flag is invalid (found true, expected a string); look again");
  EXPECT_EQ(errorOf([](const JsonField& root) { root.at("list")[2]; }),
            "a.json: list is invalid (found [{\"x\":1},{\"x\":\"two\",\"y\":[1,2]}], expected a list of 3 or "
            "more); "
            "look again");
}

TEST(JsonDocument, NamesThePlaceOfASyntaxError) {
  const auto nothing = [](const JsonField&) {};
  EXPECT_EQ(errorOf(nothing, "{\n \"a\": oops}"),
            "a.json: is not JSON (found a syntax error at line 2, column 7, expected a thing); look again");
  EXPECT_EQ(errorOf(nothing, " \n"), "a.json: is not JSON (found no text, expected a thing); look again");
  EXPECT_EQ(errorOf(nothing, "[1e999]"),
            "a.json: is not JSON (found a number that is too large, expected a thing); look again");
  EXPECT_EQ(errorOf(nothing, std::string(65, '[').c_str()),
            "a.json: has brackets more than 64 deep at byte 64; the file is damaged or of another kind");
}

TEST(JsonDocument, FieldsThatAreNullAreNotThere) {
  const JsonDocument document(kText, "a.json", "a thing");
  EXPECT_FALSE(document.root().has("none"));
  EXPECT_FALSE(document.root().has("other"));
  EXPECT_TRUE(document.root().find("flag")->flag());
  EXPECT_EQ(document.root().names(), (std::vector<std::string>{"list", "none", "deep", "flag"}));
}

// What is shown of a long text ends between two characters.
TEST(JsonDocument, ShowsTheBeginningOfLongTexts) {
  std::string text = "\"";
  for (int n = 0; n < 50; ++n) text += "\xc3\xa9";
  const std::string error = errorOf([](const JsonField& root) { root.flag(); }, (text + "\"").c_str());
  EXPECT_NE(error.find("\xc3\xa9..., expected true or false"), std::string::npos) << error;
}

}  // namespace
}  // namespace curvisplat
