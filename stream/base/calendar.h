// Times by the CF conventions: "days since 2001-01-01" in one of the calendars of models.
#pragma once

#include <optional>
#include <string>

namespace curvisplat {

/// A unit of time and a calendar as the CF conventions name them. Either may be empty.
struct TimeUnit {
  std::string name;      // "days since 2001-01-01", "s"
  std::string calendar;  // "noleap"; empty: standard
  bool operator==(const TimeUnit&) const = default;
};

/// "2001-02-28 06:00:00", the date of `time` in `unit` ("hours since 2001-02-28 00:00:00 +1:00"); nullopt if the
/// unit has no date, counts months or years, or the calendar is unknown, and if the date lies outside of the years
/// ±9999. Zones become UTC; fractions of seconds are rounded.
///
/// Calendars: standard (or gregorian; Julian before 15 October 1582; also where `calendar` is empty),
/// proleptic_gregorian, julian, noleap (365_day), all_leap (366_day), 360_day.
/// Source: CF conventions 1.10, section 4.4.
std::optional<std::string> dateOf(double time, const TimeUnit& unit);

/// The same moment in another unit: 5 in "days since 2001-01-01" is 370 in "days since 2000-01-01" of the calendar noleap.
/// nullopt if a unit is not one that dateOf() knows, if one has a date and the other has none, or if their calendars
/// differ. Exact where the units count from the same moment in the same length.
std::optional<double> timeInUnit(double time, const TimeUnit& from, const TimeUnit& to);

}  // namespace curvisplat
