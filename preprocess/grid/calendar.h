// Times by the CF conventions: "days since 2001-01-01" in one of the calendars of models.
#pragma once

#include <optional>
#include <string>

namespace curvisplat {

/// "2001-02-28 06:00:00", the date of `time` in `unit` ("hours since 2001-02-28 00:00:00 +1:00"); nullopt if the
/// unit has no date, counts months or years, or the calendar is unknown, and if the date lies outside of the years
/// ±9999. Zones become UTC; fractions of seconds are rounded.
///
/// Calendars: standard (or gregorian; Julian before 15 October 1582; also where `calendar` is empty),
/// proleptic_gregorian, julian, noleap (365_day), all_leap (366_day), 360_day.
/// Source: CF conventions 1.10, section 4.4.
std::optional<std::string> dateOf(double time, const std::string& unit, const std::string& calendar);

/// Seconds from the first of two dates, "YYYY-MM-DD hh:mm:ss" with any character between the parts, to the
/// second, in the proleptic Gregorian calendar; nullopt if either is not a date.
std::optional<double> secondsBetween(const std::string& from, const std::string& to);

}  // namespace curvisplat
