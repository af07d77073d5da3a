#include "tools/throughput/text_table.h"

#include <gtest/gtest.h>

namespace curvisplat {
namespace {

TEST(TextTable, AlignsColumns) {
  TextTable table({"stage", "rate", "x"});
  table.add({"a", "1.5 M", ""});
  table.add({"decode", "100 M", "2"});
  EXPECT_EQ(table.text(),
            "stage    rate  x\n"
            "a       1.5 M\n"
            "decode  100 M  2\n");
}

TEST(TextTable, CountsCharactersNotBytes) {
  TextTable table({"µ", "a"});
  table.add({"xx", "±1"});
  EXPECT_EQ(table.text(), "µ    a\nxx  ±1\n");
}

TEST(TextTable, RowsMayBeShort) {
  TextTable table({"a", "b", "c"});
  EXPECT_TRUE(table.empty());
  table.add({"1"});
  EXPECT_FALSE(table.empty());
  EXPECT_EQ(table.text(), "a  b  c\n1\n");
}

TEST(ShortNumbers, HaveThreeDigits) {
  EXPECT_EQ(shortCount(0), "0");
  EXPECT_EQ(shortCount(12), "12");
  EXPECT_EQ(shortCount(999), "999");
  EXPECT_EQ(shortCount(1234), "1.23 k");
  EXPECT_EQ(shortCount(17.26e6), "17.3 M");
  EXPECT_EQ(shortCount(512e6), "512 M");
  EXPECT_EQ(shortBytes(1.8e9), "1.80 GB");
  EXPECT_EQ(shortBytes(12), "12 B");
  EXPECT_EQ(shortSeconds(0.0123), "12.3 ms");
  EXPECT_EQ(shortSeconds(0.42), "0.42 s");
  EXPECT_EQ(shortSeconds(17.2), "17.2 s");
}

}  // namespace
}  // namespace curvisplat
