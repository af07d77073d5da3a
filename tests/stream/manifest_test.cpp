// The manifest is strict: a field that is missing, of another type or out of range is an error that names it.
#include "stream/cache/manifest.h"

#include <gtest/gtest.h>

#include <functional>
#include <nlohmann/json.hpp>

#include "stream/base/error.h"
#include "tests/support/expect_error.h"

namespace curvisplat {
namespace {

using Json = nlohmann::ordered_json;

Manifest example() {
  Manifest m;
  m.title = "blunt fin";
  m.program = "curvisplat 0.1.0";
  m.sources = {"bluntfinxyz.bin", "bluntfinq.bin"};
  m.reader = "PLOT3D";
  m.root = {{-1, 0.1, 2}, 3.5};
  m.lower = {-1, 0.1, 2};
  m.upper = {2, 3, 5};
  m.blocks = {{"block 1", 40, 32, 32}, {"block 2", uint64_t{1} << 40, 1, 1}};
  m.nodes = (uint64_t{1} << 40) + 40960;
  m.blanked_nodes = 7;
  m.splats = 40953;
  m.bricks = 3;
  m.levels = 2;
  m.volume = 1.0 / 3;
  m.variables = {{0, "density", "kg/m3", 0.19, 4.98}, {3, "mach", "", -1e-300, 2.95}};
  m.steps = {{0.25, "geometry.bin", {0, 3}}};
  m.files = {{"bricks.bin", 456, 0x0123456789abcdef}, {"geometry.bin", uint64_t{1} << 50, ~uint64_t{0}}};
  return m;
}

/// To be changed.
Json withoutChecksum(const Manifest& manifest) {
  Json json = Json::parse(manifest.toJson());
  EXPECT_EQ(json.erase("checksum"), 1u);
  return json;
}

TEST(Manifest, RoundTrips) {
  const Manifest m = example();
  const Manifest back = Manifest::fromJson(m.toJson(), "manifest.json");
  EXPECT_EQ(back.toJson(), m.toJson());
  EXPECT_EQ(back.volume, m.volume);
  EXPECT_EQ(back.root.min, m.root.min);
  EXPECT_EQ(back.variables[1].min, -1e-300);
  EXPECT_EQ(back.variables[1].number, 3u);
  EXPECT_EQ(back.files[1].size, uint64_t{1} << 50);
  EXPECT_EQ(back.files[1].checksum, ~uint64_t{0});
  EXPECT_EQ(back.blocks[1].ni, uint64_t{1} << 40);
  EXPECT_EQ(back.steps[0].variables, m.steps[0].variables);
  EXPECT_FALSE(back.globe) << "of a manifest that does not say";
  for (const auto shape : {Globe::Shape::kSphere, Globe::Shape::kFlat, Globe::Shape::kLengths}) {
    Manifest on_globe = m;
    on_globe.globe = Globe{shape, 6371.25, 50, -30};
    EXPECT_EQ(Manifest::fromJson(on_globe.toJson(), "manifest.json").globe, on_globe.globe);
  }
  EXPECT_FALSE(back.refinement.cutsCells()) << "of a manifest that does not say";
  Manifest refined = m;
  refined.refinement = Refinement(4);
  EXPECT_EQ(Manifest::fromJson(refined.toJson(), "manifest.json").refinement, Refinement(4));
  refined.refinement = Refinement({kWholeCells, {4, 1, 2}});
  const Json by_need = Json::parse(refined.toJson());
  EXPECT_FALSE(by_need.contains("refined"));
  EXPECT_FALSE(by_need["blocks"][0].contains("refined"));
  EXPECT_EQ(Manifest::fromJson(refined.toJson(), "manifest.json").refinement, refined.refinement);
}

TEST(Manifest, IsReadWithoutItsChecksumAndInAnyLayout) {
  const Manifest m = example();
  EXPECT_EQ(Manifest::fromJson(withoutChecksum(m).dump(), "m").toJson(), m.toJson());
  const auto ordered = nlohmann::ordered_json::parse(m.toJson());
  EXPECT_EQ(Manifest::fromJson(ordered.dump(7), "m").toJson(), m.toJson());
}

TEST(Manifest, NoBitOfItChangesUnnoticed) {
  const std::string good = example().toJson();
  for (size_t bit = 0; bit < 8 * good.size(); ++bit) {
    std::string bad = good;
    bad[bit / 8] = static_cast<char>(bad[bit / 8] ^ 1 << bit % 8);
    try {
      // White space, or the checksum's own name.
      EXPECT_EQ(Manifest::fromJson(bad, "m").toJson(), good) << bad.substr(bit / 8 - bit / 8 % 20, 40);
    } catch (const Error&) {
    }
  }
}

TEST(Manifest, RecordsCellCentring) {
  Manifest m = example();
  EXPECT_FALSE(Manifest::fromJson(m.toJson(), "m").cells);
  m.cells = true;
  EXPECT_TRUE(Manifest::fromJson(m.toJson(), "m").cells);
  Json json = withoutChecksum(m);
  json["centring"] = "edge";
  EXPECT_THROW(Manifest::fromJson(json.dump(), "m"), Error);
}

TEST(Manifest, IsOfVersionTwoWhereItRequiresSomething) {
  Manifest m = example();
  EXPECT_EQ(Json::parse(m.toJson())["version"], 1);
  EXPECT_FALSE(Json::parse(m.toJson()).contains("requires"));
  m.requirements = {kBorderFaces};
  EXPECT_EQ(Json::parse(m.toJson())["version"], 2);
  EXPECT_EQ(Manifest::fromJson(m.toJson(), "m").requirements, m.requirements);
  m.requirements.push_back("colours");
  try {
    Manifest::fromJson(m.toJson(), "m.json");
    ADD_FAILURE() << "read what it does not know";
  } catch (const OtherVersion& error) {
    for (const char* part : {"m.json", "'colours'", "newer program"}) expectSays(error.what(), part);
  }
}

TEST(Manifest, KeepsNamesThatAreNotUtf8Readable) {
  Manifest m = example();
  m.sources = {"gr\xfcn.xyz"};  // Latin-1
  EXPECT_EQ(Manifest::fromJson(m.toJson(), "m").sources.size(), 1u);
}

/// Applies `call` to every value in the JSON tree, innermost included, with its path.
void everywhere(Json& json, const std::string& path,
                const std::function<void(Json&, const std::string&)>& call) {
  for (auto it = json.begin(); it != json.end(); ++it) {
    const std::string here =
        json.is_object() ? path + "/" + it.key() : path + "/" + std::to_string(it - json.begin());
    call(*it, here);
    if (it->is_structured()) everywhere(*it, here, call);
  }
}

TEST(Manifest, RefusesAnyOtherType) {
  Json json = withoutChecksum(example());
  everywhere(json, "", [&](Json& value, const std::string& path) {
    const Json kept = value;
    for (const Json& other :
         {Json(nullptr), Json("x"), Json(true), Json::object(), Json::array({Json::array()})}) {
      if (other.type() == kept.type() && !kept.is_structured() && path != "/format" &&
          path.find("checksum") == std::string::npos)
        continue;  // another text is a text
      value = other;
      if (kept.is_object() && other.is_object() && !kept.empty()) value = Json::object();
      EXPECT_THROW(Manifest::fromJson(json.dump(), "m"), Error) << path << " as " << other;
      value = kept;
    }
  });
}

TEST(Manifest, RefusesMissingFields) {
  Json json = withoutChecksum(example());
  const auto removeEach = [&](Json& object) {
    const Json kept = object;
    for (auto it = kept.begin(); it != kept.end(); ++it) {
      object.erase(it.key());
      SCOPED_TRACE(it.key());
      expectError([&] { Manifest::fromJson(json.dump(), "m.json"); }, {it.key(), "m.json"});
      object = kept;
    }
  };
  removeEach(json);
  removeEach(json["root"]);
  for (const char* list : {"blocks", "variables", "steps", "files"}) removeEach(json[list][0]);
}

TEST(Manifest, RefusesWhatIsOutOfRange) {
  const auto refused = [](const std::function<void(Json&)>& change) {
    Json json = withoutChecksum(example());
    change(json);
    EXPECT_THROW(Manifest::fromJson(json.dump(), "m"), Error) << json.dump();
  };
  refused([](Json& j) { j["version"] = 0; });
  refused([](Json& j) { j["version"] = 2; });  // without saying what it requires
  refused([](Json& j) { j["version"] = 3; });
  refused([](Json& j) { j["root"]["size"] = 0; });
  refused([](Json& j) { j["root"]["size"] = -1; });
  refused([](Json& j) { j["root"]["min"] = {1, 2}; });
  refused([](Json& j) { j["lower"][1] = 1e9; });
  refused([](Json& j) { j["lower"][1] = -1e150; });
  refused([](Json& j) { j["root"]["size"] = 1e150; });
  refused([](Json& j) { j["root"]["min"][2] = 1e308; });
  refused([](Json& j) { j["variables"][0]["number"] = 0xffffffff; });  // the next one is 0 again
  refused([](Json& j) { j["blocks"][0]["ni"] = 0; });
  refused([](Json& j) { j["blocks"][0]["ni"] = -5; });
  refused([](Json& j) { j["nodes"] = 1.5; });
  refused([](Json& j) { j["blanked_nodes"] = j["nodes"].get<uint64_t>() + 1; });
  refused([](Json& j) { j["refined"] = 0; });
  refused([](Json& j) { j["blocks"][0]["refined"] = {1, 0, 2}; });
  refused([](Json& j) { j["blocks"][0]["refined"] = {1, 2}; });
  refused([](Json& j) { j["blocks"][0]["refined"] = 2; });
  refused([](Json& j) { j["splats"] = 0; });
  refused([](Json& j) { j["bricks"] = uint64_t{1} << 32; });
  refused([](Json& j) { j["levels"] = 26; });
  refused([](Json& j) { j["levels"] = 0; });
  refused([](Json& j) { j["volume"] = -1; });
  refused([](Json& j) { j["variables"][1]["number"] = 0; });
  refused([](Json& j) { j["variables"][1]["name"] = "density"; });
  refused([](Json& j) { j["steps"] = Json::array(); });
  refused([](Json& j) { j["steps"][0]["variables"] = {1}; });
  refused([](Json& j) { j["files"][1]["name"] = "bricks.bin"; });
  refused([](Json& j) { j["files"][0]["checksum"] = "0123"; });
  refused([](Json& j) { j["files"][0]["checksum"] = "0123456789abcdeg"; });
  for (const char* name : {"", ".", "..", "../secret", "/etc/passwd", "a/b"}) {
    refused([&](Json& j) { j["files"][0]["name"] = name; });
    refused([&](Json& j) { j["steps"][0]["geometry"] = name; });
  }
}

TEST(Manifest, RefusesBracketsWithoutEnd) {
  for (const char* bracket : {"[", "{\"a\":"}) {
    std::string text;
    for (int n = 0; n < 100'000; ++n) text += bracket;
    EXPECT_THROW(Manifest::fromJson(text, "m"), Error);
  }
  Json json = withoutChecksum(example());
  json["title"] = std::string(1000, '[');  // in a text they are letters
  EXPECT_EQ(Manifest::fromJson(json.dump(), "m").title.size(), 1000u);
  json["title"] = "\"" + std::string(1000, '[');
  EXPECT_EQ(Manifest::fromJson(json.dump(), "m").title.size(), 1001u);
}

TEST(Manifest, TextsAreOneLineWithoutControlCharacters) {
  Json json = withoutChecksum(example());
  json["title"] = "a\nb\x1b[2Jc\x7f";
  json["variables"][0]["name"] = "p\r\ncurvisplat: done";
  json["sources"] = {"a\tb"};
  const Manifest manifest = Manifest::fromJson(json.dump(), "m");
  EXPECT_EQ(manifest.title, "a b [2Jc ");
  EXPECT_EQ(manifest.variables[0].name, "p  curvisplat: done");
  EXPECT_EQ(manifest.sources[0], "a b");
}

TEST(Manifest, RefusesTextThatIsNotJson) {
  const std::string text = example().toJson();
  for (size_t length = 0; length + 2 < text.size(); length += 7)
    EXPECT_THROW(Manifest::fromJson(text.substr(0, length), "m"), Error);
  EXPECT_THROW(Manifest::fromJson(std::string(100000, '['), "m"), Error);
  EXPECT_THROW(Manifest::fromJson("[]", "m"), Error);
  EXPECT_THROW(Manifest::fromJson("{\"version\": 1e999}", "m"), Error);
}

}  // namespace
}  // namespace curvisplat
