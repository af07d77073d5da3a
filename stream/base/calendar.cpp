#include "stream/base/calendar.h"

#include <fmt/format.h>

#include <array>
#include <cmath>
#include <cstdint>
#include <cstdio>

namespace curvisplat {
namespace {

constexpr double kSecondsPerDay = 86400;
constexpr int64_t kMaxYear = 9999;

struct Date {
  int64_t year = 0, month = 1, day = 1;
};

enum class Calendar { kStandard, kGregorian, kJulian, kNoLeap, kAllLeap, k360 };

std::optional<Calendar> calendarNamed(const std::string& name) {
  if (name.empty() || name == "standard" || name == "gregorian") return Calendar::kStandard;
  if (name == "proleptic_gregorian") return Calendar::kGregorian;
  if (name == "julian") return Calendar::kJulian;
  if (name == "noleap" || name == "365_day") return Calendar::kNoLeap;
  if (name == "all_leap" || name == "366_day") return Calendar::kAllLeap;
  if (name == "360_day") return Calendar::k360;
  return std::nullopt;
}

int64_t floorDivided(int64_t a, int64_t b) {
  return a / b - (a % b != 0 && (a < 0) != (b < 0));
}

/// Days from 1 March of year 0 to 1 March of `year`.
int64_t daysBeforeMarch(int64_t year, Calendar calendar) {
  switch (calendar) {
    case Calendar::kNoLeap:
      return 365 * year;
    case Calendar::kAllLeap:
      return 366 * year;
    case Calendar::k360:
      return 360 * year;
    case Calendar::kJulian:
      return 365 * year + floorDivided(year, 4);
    default:
      return 365 * year + floorDivided(year, 4) - floorDivided(year, 100) + floorDivided(year, 400);
  }
}

/// Days since 1 March of year 0 of the calendar itself. Years begin with March, so that a leap day is their last.
int64_t daysOf(const Date& date, Calendar calendar) {
  const int64_t month = (date.month + 9) % 12, year = date.year - (date.month <= 2);
  const int64_t before = calendar == Calendar::k360 ? 30 * month : (153 * month + 2) / 5;
  return daysBeforeMarch(year, calendar) + before + date.day - 1;
}

Date dateOfDays(int64_t days, Calendar calendar) {
  int64_t year = floorDivided(days, 366) - 1;
  while (daysBeforeMarch(year + 1, calendar) <= days) ++year;
  const int64_t left = days - daysBeforeMarch(year, calendar);
  const int64_t month = calendar == Calendar::k360 ? left / 30 : (5 * left + 2) / 153;
  const int64_t before = calendar == Calendar::k360 ? 30 * month : (153 * month + 2) / 5;
  const int64_t number = month < 10 ? month + 3 : month - 9;
  return {year + (number <= 2), number, left - before + 1};
}

// The days of the standard calendar are the Gregorian one's. On 1 March of year 0 the Julian calendar was two
// days ahead of it.
constexpr int64_t kJulianAhead = 2;

int64_t standardDays(const Date& date) {
  const bool julian = std::array{date.year, date.month, date.day} < std::array<int64_t, 3>{1582, 10, 15};
  return julian ? daysOf(date, Calendar::kJulian) - kJulianAhead : daysOf(date, Calendar::kGregorian);
}

Date standardDate(int64_t days) {
  static const int64_t reform = daysOf({1582, 10, 15}, Calendar::kGregorian);
  return days < reform ? dateOfDays(days + kJulianAhead, Calendar::kJulian)
                       : dateOfDays(days, Calendar::kGregorian);
}

std::optional<double> secondsOf(const std::string& unit) {
  for (const auto& [name, seconds] : {std::pair{"day", kSecondsPerDay},
                                      {"d", kSecondsPerDay},
                                      {"hour", 3600.0},
                                      {"hr", 3600.0},
                                      {"h", 3600.0},
                                      {"minute", 60.0},
                                      {"min", 60.0},
                                      {"second", 1.0},
                                      {"sec", 1.0},
                                      {"s", 1.0},
                                      {"millisecond", 1e-3},
                                      {"msec", 1e-3},
                                      {"ms", 1e-3}})
    if (unit == name || unit == fmt::format("{}s", name)) return seconds;
  return std::nullopt;
}

struct Moment {
  Date date;
  double seconds = 0;  // of the day, less the zone
};

/// "Y-M-D[T h:m:s][Z|+h:m]"
std::optional<Moment> momentIn(const std::string& text) {
  long long year = 0, month = 0, day = 0;
  int used = 0;
  if (std::sscanf(text.c_str(), "%lld-%lld-%lld%n", &year, &month, &day, &used) != 3) return std::nullopt;
  if (std::abs(year) > kMaxYear || month < 1 || month > 12 || day < 1 || day > 31) return std::nullopt;
  Moment moment{{year, month, day}, 0};
  std::string rest = text.substr(static_cast<size_t>(used));
  int hour = 0, minute = 0;
  double second = 0;
  char between = 0;
  if (std::sscanf(rest.c_str(), "%c%d:%d%n", &between, &hour, &minute, &used) == 3) {
    rest.erase(0, static_cast<size_t>(used));
    if (std::sscanf(rest.c_str(), ":%lf%n", &second, &used) == 1) rest.erase(0, static_cast<size_t>(used));
    if (hour < 0 || hour > 24 || minute < 0 || minute > 60 || !(second >= 0 && second <= 61))
      return std::nullopt;
    moment.seconds = 3600.0 * hour + 60.0 * minute + second;
    char sign = 0;
    int zone_hour = 0, zone_minute = 0;
    if (std::sscanf(rest.c_str(), " %c%d:%d", &sign, &zone_hour, &zone_minute) >= 2 &&
        (sign == '+' || sign == '-') && zone_hour >= 0 && zone_hour <= 24 && zone_minute >= 0 &&
        zone_minute < 60)
      moment.seconds -= (sign == '-' ? -1 : 1) * (3600.0 * zone_hour + 60.0 * zone_minute);
  }
  return moment;
}

/// A clock: the calendar, the length of a unit, and the date from which it counts.
struct Clock {
  Calendar calendar;
  double seconds = 1;           // of the unit
  std::optional<double> begin;  // seconds from the calendar's begin; none: the unit has no date
};

bool isStandard(Calendar calendar) {
  return calendar == Calendar::kStandard;
}

std::optional<Clock> clockOf(const TimeUnit& unit) {
  const auto calendar = calendarNamed(unit.calendar);
  const size_t since = unit.name.find(" since ");
  const auto seconds = secondsOf(unit.name.substr(0, since));
  if (!calendar || !seconds) return std::nullopt;
  if (since == std::string::npos) return Clock{*calendar, *seconds, std::nullopt};
  const auto from = momentIn(unit.name.substr(unit.name.find_first_not_of(' ', since + 7)));
  if (!from) return std::nullopt;
  const int64_t days = isStandard(*calendar) ? standardDays(from->date) : daysOf(from->date, *calendar);
  return Clock{*calendar, *seconds, std::fma(kSecondsPerDay, static_cast<double>(days), from->seconds)};
}

/// Both count the days of the Gregorian calendar, or they are the same calendar.
bool countTheSameDays(Calendar a, Calendar b) {
  const auto days = [](Calendar calendar) { return isStandard(calendar) ? Calendar::kGregorian : calendar; };
  return days(a) == days(b);
}

}  // namespace

std::optional<std::string> dateOf(double time, const TimeUnit& unit) {
  const auto clock = clockOf(unit);
  if (!clock || !clock->begin) return std::nullopt;
  const double moment = std::round(*clock->begin + time * clock->seconds);
  if (!(std::abs(moment) < kSecondsPerDay * 366 * kMaxYear)) return std::nullopt;
  const auto days = static_cast<int64_t>(std::floor(moment / kSecondsPerDay));
  const auto left = static_cast<int64_t>(moment - kSecondsPerDay * static_cast<double>(days));
  const Date date = isStandard(clock->calendar) ? standardDate(days) : dateOfDays(days, clock->calendar);
  return fmt::format("{:04}-{:02}-{:02} {:02}:{:02}:{:02}", date.year, date.month, date.day, left / 3600,
                     left / 60 % 60, left % 60);
}

std::optional<double> timeInUnit(double time, const TimeUnit& from, const TimeUnit& to) {
  if (from == to) return time;
  const auto clock = clockOf(from), other = clockOf(to);
  if (!clock || !other || clock->begin.has_value() != other->begin.has_value()) return std::nullopt;
  if (clock->begin && !countTheSameDays(clock->calendar, other->calendar)) return std::nullopt;
  const double later = clock->begin ? *clock->begin - *other->begin : 0;
  if (clock->seconds == other->seconds) return time + later / clock->seconds;
  return (time * clock->seconds + later) / other->seconds;
}

}  // namespace curvisplat
