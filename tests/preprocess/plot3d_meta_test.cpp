// .p3d descriptions and OVERFLOW solutions: what they say, and what becomes of damaged ones.
#include "preprocess/formats/plot3d/plot3d_source.h"

#include <gtest/gtest.h>

#include <random>

#include "preprocess/formats/open/open_grid.h"
#include "stream/base/error.h"
#include "tests/preprocess/plot3d_bytes.h"
#include "tests/support/expect_error.h"

namespace curvisplat {
namespace {

using namespace test;

class Plot3dMeta : public testing::Test {
 protected:
  Plot3dMeta() {
    const Plot3dLayout grid{Plot3dKind::kGrid, false, ByteOrder::kBig, RecordMarkers::kNone, 4, false, false};
    Plot3dLayout q = grid, function = grid;
    q.kind = Plot3dKind::kQ;
    function.kind = Plot3dKind::kFunction;
    folder_.write("a.xyz", plot3dBytes(grid, {testBlock(5, 4, 3, 0)}));
    folder_.write("b.xyz", plot3dBytes(grid, {testBlock(3, 4, 3, 0)}));
    folder_.write("a.q", plot3dBytes(q, {testBlock(5, 4, 3, 5)}));
    folder_.write("b.q", plot3dBytes(q, {testBlock(3, 4, 3, 5)}));
    folder_.write("a.f", plot3dBytes(function, {testBlock(5, 4, 3, 2)}));
  }

  std::unique_ptr<GridSource> open(const std::string& text, std::optional<uint32_t> step = {}) const {
    OpenGridOptions options;
    options.grid = folder_.write("m.p3d", text);
    options.time_step = step;
    return openGrid(options);
  }
  std::string errorOf(const std::string& text) const {
    return curvisplat::errorOf([&] { open(text); });
  }

  const TestFolder folder_{"meta"};
  const std::string whole_ = R"({"byte-order": "big", "language": "C", "precision": 32, "multi-grid": false,
    "blanking": false, "format": "binary", "2D": false, "R": 8.5, "gamma": 1.3, "functions": [110, 200],
    "function-names": ["swirl", "depth"],
    "filenames": [{"time": 3.5, "xyz": "a.xyz", "q": "a.q", "function": "a.f"},
                  {"time": 4.5, "xyz": "b.xyz", "q": "b.q"}]})";
};

TEST_F(Plot3dMeta, NamesFilesAndTheirLayout) {
  const auto first = open(whole_);
  const GridDescription& description = first->description();
  EXPECT_EQ(description.blocks[0].ni, 5u);
  EXPECT_EQ(description.times, (std::vector{3.5, 4.5}));
  EXPECT_EQ(description.time_step, 0u);
  EXPECT_EQ(description.gas.gamma, 1.3);
  EXPECT_EQ(description.gas.constant, 8.5);
  ASSERT_EQ(description.scalars.size(), 7u);
  EXPECT_EQ(description.scalars[6].name, "depth");
  EXPECT_EQ(description.scalars[6].number, 2u);
  EXPECT_TRUE(description.warnings.empty());
  EXPECT_EQ(open(whole_, 1)->description().blocks[0].ni, 3u);
  EXPECT_THROW(open(whole_, 2), Error);
}

TEST_F(Plot3dMeta, RefusesWhatIsWrongByItsKey) {
  const auto with = [](const std::string& entry) {
    return "{" + entry + R"(, "filenames": [{"xyz": "a.xyz"}]})";
  };
  EXPECT_EQ(errorOf(with(R"("gamma": 1.4)")), "");
  for (const auto& [entry, wanted] :
       std::vector<std::pair<std::string, std::string>>{{R"("2D": true)", "only 3-D"},
                                                        {R"("byte-order": "middle")", "byte-order is"},
                                                        {R"("byte-order": 3)", "byte-order is"},
                                                        {R"("precision": 16)", "32 or 64"},
                                                        {R"("gamma": "x")", "expected a finite number"},
                                                        {R"("multi-grid": 1)", "true or false"},
                                                        {R"("function-names": "u")", "function-names is"},
                                                        {R"("byte-order": "little")", "a.xyz"}}) {
    const std::string error = errorOf(with(entry));
    EXPECT_NE(error.find(wanted), std::string::npos) << entry << ": " << error;
  }
  for (const char* text : {"{}", R"({"filenames": []})", R"({"filenames": [1]})", R"({"filenames": [{}]})",
                           R"({"filenames": [{"xyz": ""}]})", "{", "{]", R"({"filenames": [{"xyz": 7}]})"})
    EXPECT_NE(errorOf(text), "") << text;
  expectSays(errorOf(R"({"filenames": [{"xyz": "none.xyz"}]})"), "which does not exist");
}

TEST_F(Plot3dMeta, OfAnyDamageIsAnErrorOrReadsTheSameNodes) {
  const auto expectSane = [&](const std::string& text) {
    try {
      const auto source = open(text);
      const GridBlock& block = source->description().blocks.at(0);
      NodeArrays nodes;
      source->read(0, {0, block.nj, 0, block.nk}, {}, nodes);
      EXPECT_EQ(nodes.x.size(), block.nodes());
    } catch (const Error&) {
    }
  };
  for (size_t n = 0; n < 100; ++n) expectSane(whole_.substr(0, n * whole_.size() / 100));
  std::mt19937 random(5);
  for (int n = 0; n < 1000; ++n) {
    std::string text = whole_;
    text[random() % text.size()] = static_cast<char>(random() % 256);
    expectSane(text);
  }
  expectSane(std::string(100'000, '{'));
  expectSane("{\"a\":" + std::string(100'000, '['));
}

/// Blocks as OVERFLOW writes them: nq quantities, nqc of them species.
Bytes overflowBytes(const Plot3dLayout& layout, const std::vector<TestBlock>& blocks, int32_t nqc) {
  Bytes file, record;
  const auto integer = [&](int64_t value) {
    appendNumber(record, static_cast<int32_t>(value), layout.byte_order);
  };
  const auto real = [&](double value) {
    if (layout.precision_bytes == 8)
      appendNumber(record, value, layout.byte_order);
    else
      appendNumber(record, static_cast<float>(value), layout.byte_order);
  };
  const auto finish = [&] {
    appendRecord(file, record, layout);
    record.clear();
  };
  if (layout.multi_block) {
    integer(static_cast<int64_t>(blocks.size()));
    finish();
  }
  for (const TestBlock& block : blocks)
    for (const uint64_t count : {block.ni, block.nj, block.nk}) integer(static_cast<int64_t>(count));
  integer(static_cast<int64_t>(blocks[0].components.size()));
  integer(nqc);
  finish();
  for (const TestBlock& block : blocks) {
    for (const double value : {0.5, 2.0, 1e5, 7.0, 1.375, 0.0, 500.0}) real(value);
    integer(3);
    for (int n = 0; n < 3 + std::max(2, nqc); ++n) real(100 + n);
    for (const double value : {0.75, 0.125, 0.25}) real(value);
    finish();
    for (const auto& component : block.components)
      for (const double value : component) real(value);
    finish();
  }
  return file;
}

TEST(Plot3dOverflow, IsReadInEveryLayout) {
  const TestFolder folder("overflow");
  for (const ByteOrder order : {ByteOrder::kLittle, ByteOrder::kBig})
    for (const RecordMarkers records : {RecordMarkers::kBytes4, RecordMarkers::kBytes8})
      for (const int precision : {4, 8})
        for (const bool multi : {false, true})
          for (const int nqc : {0, 3}) {
            const Plot3dLayout layout{Plot3dKind::kGrid, false, order, records, precision, multi, false};
            const uint32_t components = nqc ? 11 : 5;
            std::vector<TestBlock> blocks{testBlock(5, 4, 3, components)};
            if (multi) blocks.push_back(testBlock(3, 2, 4, components, 1));
            OpenGridOptions options;
            options.grid = folder.write("a.xyz", plot3dBytes(layout, blocks));
            options.solutions = {folder.write("a.q", overflowBytes(layout, blocks, nqc))};
            const auto source = openGrid(options);
            const GridDescription& description = source->description();
            ASSERT_EQ(description.scalars.size(), components);
            EXPECT_EQ(description.gas.gamma, 1.375);
            EXPECT_EQ(description.flow.back().mach, 0.75);
            EXPECT_EQ(description.flow.back().time, 7);
            if (nqc) {
              EXPECT_EQ(description.scalars[5].name, "gamma");
              EXPECT_EQ(description.scalars[8].name, "species_3");
              EXPECT_EQ(description.scalars[10].name, "turbulence_2");
            }
            const auto last = static_cast<uint32_t>(blocks.size() - 1);
            const std::vector<uint32_t> scalars{components - 1, 0};
            NodeArrays nodes;
            source->read(last, {0, blocks[last].nj, 0, blocks[last].nk}, scalars, nodes);
            for (size_t n = 0; n < nodes.x.size(); ++n) {
              ASSERT_EQ(nodes.scalars[0][n], static_cast<float>(blocks[last].components.back()[n]));
              ASSERT_EQ(nodes.scalars[1][n], static_cast<float>(blocks[last].components[0][n]));
            }
          }
}

TEST(Plot3dOverflow, OfAnyDamageIsAnErrorOrReads) {
  const TestFolder folder("overflow-damage");
  const Plot3dLayout layout{
      Plot3dKind::kGrid, false, ByteOrder::kLittle, RecordMarkers::kBytes4, 8, true, false};
  const std::vector<TestBlock> blocks{testBlock(5, 4, 3, 8), testBlock(3, 2, 4, 8, 1)};
  OpenGridOptions options;
  options.grid = folder.write("a.xyz", plot3dBytes(layout, blocks));
  const Bytes whole = overflowBytes(layout, blocks, 1);
  const auto reads = [&](const Bytes& bytes) {
    options.solutions = {folder.write("a.q", bytes)};
    try {
      const auto source = openGrid(options);
      std::vector<uint32_t> scalars(source->description().scalars.size());
      for (uint32_t n = 0; n < scalars.size(); ++n) scalars[n] = n;
      NodeArrays nodes;
      for (uint32_t b = 0; b < 2; ++b) source->read(b, {0, blocks[b].nj, 0, blocks[b].nk}, scalars, nodes);
      return true;
    } catch (const Error&) {
      return false;
    }
  };
  EXPECT_TRUE(reads(whole));
  for (size_t n = 0; n < 100; ++n)
    EXPECT_FALSE(reads({whole.begin(), whole.begin() + static_cast<ptrdiff_t>(n * whole.size() / 100)})) << n;
  std::mt19937 random(11);
  int read = 0;
  for (int n = 0; n < 1000; ++n) {
    Bytes bytes = whole;
    // A third of them in the headers, which are a small part of the file.
    const size_t range = n % 3 == 0 ? 200 : bytes.size();
    bytes[random() % range] = static_cast<std::byte>(random() % 256);
    read += reads(bytes);
  }
  EXPECT_GT(read, 500);   // most of the bytes are values
  EXPECT_LT(read, 1000);  // headers and markers are not
}

}  // namespace
}  // namespace curvisplat
