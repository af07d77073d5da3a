// Times in the units of other files. Dates are tested with those of netCDF4: tests/end_to_end/model_files_test.py.
#include "stream/base/calendar.h"

#include <gtest/gtest.h>

namespace curvisplat {
namespace {

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

}  // namespace
}  // namespace curvisplat
