#include "stream/base/byte_text.h"

#include <gtest/gtest.h>

namespace curvisplat {
namespace {

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

}  // namespace
}  // namespace curvisplat
