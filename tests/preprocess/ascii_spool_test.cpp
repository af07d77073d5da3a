#include "preprocess/formats/common/ascii_spool.h"

#include <gtest/gtest.h>

#include <cerrno>
#include <cmath>
#include <random>

#include "stream/base/disk_full.h"
#include "stream/base/error.h"
#include "tests/preprocess/plot3d_bytes.h"
#include "tests/support/fault_sweep.h"

namespace curvisplat {
namespace {

using namespace test;

std::vector<double> spooled(const TestFolder& folder, const std::string& text) {
  const AsciiSpool spool = spoolAscii(InputFile(folder.write("text", text)), folder.path());
  std::vector<double> values(spool.count);
  spool.doubles->readAt(0, std::span(values));
  return values;
}

std::string errorOf(const TestFolder& folder, const std::string& text) {
  try {
    spooled(folder, text);
  } catch (const Error& error) {
    return error.what();
  }
  return "";
}

size_t files(const TestFolder& folder) {
  return static_cast<size_t>(std::distance(std::filesystem::directory_iterator(folder.path()), {}));
}

TEST(AsciiSpool, ReadsNumbersAsFortranWritesThem) {
  const TestFolder folder("spool");
  EXPECT_EQ(spooled(folder, " 1\t-2.5, +3 ,4E2\r\n0.E+0 1.5D+01 2d-1 .5 -.25 1.5-101 7.25+3 6."),
            (std::vector<double>{1, -2.5, 3, 400, 0, 15, 0.2, 0.5, -0.25, 1.5e-101, 7250, 6}));
  EXPECT_EQ(spooled(folder, "3*1.5, 1*2 2*-4E-1"), (std::vector<double>{1.5, 1.5, 1.5, 2, -0.4, -0.4}));
  EXPECT_EQ(spooled(folder, ""), std::vector<double>{});
  EXPECT_EQ(spooled(folder, "\n \n"), std::vector<double>{});
}

TEST(AsciiSpool, ReadsNonFiniteNumbers) {
  const TestFolder folder("spool-nan");
  const std::vector<double> values = spooled(folder, "NaN -Infinity inf 1E400 1E-400");
  ASSERT_EQ(values.size(), 5u);
  EXPECT_TRUE(std::isnan(values[0]));
  EXPECT_EQ(values[1], -INFINITY);
  EXPECT_EQ(values[2], INFINITY);
  EXPECT_EQ(values[3], INFINITY);
  EXPECT_EQ(values[4], 0);
}

TEST(AsciiSpool, NamesTheLineThatIsNotANumber) {
  const TestFolder folder("spool-errors");
  for (const char* bad :
       {"x", "1.5x", "0x10", "*5", "2*", "0*3", "-1*3", "1.5*2", "2*3*4", "1e", "--1", "1..2", "**"}) {
    const std::string error = errorOf(folder, std::string("1 2\n3 4\n 5 ") + bad + " 6\n");
    EXPECT_NE(error.find(std::string("line 3 has \"") + bad + "\""), std::string::npos)
        << bad << ": " << error;
  }
  EXPECT_NE(errorOf(folder, "1,\n,2").find("line 2 has no value between two commas"), std::string::npos);
  EXPECT_NE(errorOf(folder, "1 999999999999999*2").find("repeats a number 999999999999999 times"),
            std::string::npos);
  EXPECT_EQ(files(folder), 1u);
}

TEST(AsciiSpool, NumbersAcrossChunksAreWhole) {
  const TestFolder folder("spool-long");
  std::mt19937_64 random(4);
  std::string text;
  std::vector<double> expected;
  while (text.size() < (3u << 20)) {
    const double value =
        std::ldexp(static_cast<double>(random() >> 11), static_cast<int>(random() % 60) - 60);
    const size_t repeats = random() % 4 == 0 ? 1 + random() % 5 : 1;
    if (repeats > 1) text += fmt::format("{}*", repeats);
    text += fmt::format("{}{}", value, random() % 6 == 0 ? "\n" : "   ");
    expected.insert(expected.end(), repeats, value);
  }
  EXPECT_EQ(spooled(folder, text), expected);
  EXPECT_EQ(files(folder), 1u);  // the text alone
  EXPECT_NE(errorOf(folder, text + " what?")
                .find(fmt::format("line {} has", std::count(text.begin(), text.end(), '\n') + 1)),
            std::string::npos);
  EXPECT_NE(errorOf(folder, std::string(3 << 20, '1')).find("without a space"), std::string::npos);
}

TEST(AsciiSpool, CountsTheDigitsThatWereWritten) {
  const TestFolder folder("spool-digits");
  const auto digits = [&](const std::string& text) {
    return spoolAscii(InputFile(folder.write("text", text)), folder.path()).significant_digits;
  };
  EXPECT_EQ(digits("0.001234567 1.5E+10"), 7);
  EXPECT_EQ(digits("12 -0.12345678901234567D-100"), 17);
}

/// A disk that is full after some bytes.
class FullDisk : public SystemCalls {
 public:
  explicit FullDisk(ssize_t bytes) : left_(bytes) {}
  ssize_t pwrite(int fd, const void* from, size_t count, int64_t offset) override {
    if (left_ == 0) {
      errno = ENOSPC;
      return -1;
    }
    const ssize_t put = SystemCalls::pwrite(fd, from, std::min(count, static_cast<size_t>(left_)), offset);
    left_ -= put;
    return put;
  }

 private:
  ssize_t left_;
};

TEST(AsciiSpool, AFullDiskIsAnErrorAndLeavesNothing) {
  const TestFolder folder("spool-full");
  const auto path = folder.write("text", std::string("400000*1.5"));
  FullDisk disk(1'000'000);
  const ScopedSystemCalls scope(disk);
  try {
    spoolAscii(InputFile(path), folder.path());
    ADD_FAILURE() << "it had room";
  } catch (const DiskFull& full) {
    const std::string message = full.what();
    EXPECT_TRUE(message.starts_with(folder.path().string() + ": no room for ")) << message;
    EXPECT_FALSE(faults::namesTemporaryFile(message)) << message;
  }
  EXPECT_EQ(files(folder), 1u);
}

}  // namespace
}  // namespace curvisplat
