#include "tools/window/reports.h"

#include <algorithm>
#include <cstddef>
#include <new>
#include <string_view>

#include <fmt/format.h>

#include "render/image/too_little_memory.h"
#include "stream/base/error.h"
#include "stream/base/progress.h"
#include "stream/base/text.h"

namespace curvisplat {
namespace {

constexpr double kShortestSeconds = 4, kPerLetterSeconds = 0.06, kErrorSeconds = 60;
constexpr size_t kMaxShown = 3, kMaxLog = 100;

/// Describes the error in the window's words: its own text names options.
std::string textOf(const TooLittleMemory& error) {
  constexpr const char* kWhere = "raise \"memory\" under View, Detail and memory";
  if (error.least_bytes > 0)
    return fmt::format("this picture needs {} of memory: {}", byteText(error.least_bytes), kWhere);
  return fmt::format("this picture needs more memory: {}, or \"error, pixels\"", kWhere);
}

/// Whether an option such as --blank stands at a place of a text.
bool isOptionAt(const std::string& text, size_t at) {
  const bool begins = at == 0 || text[at - 1] == ' ' || text[at - 1] == '(';
  return begins && at + 2 < text.size() && text.compare(at, 2, "--") == 0 && text[at + 2] >= 'a' &&
         text[at + 2] <= 'z';
}

}  // namespace

std::string inWindowsWords(const std::string& message) {
  constexpr std::string_view kSize = "--size";  // a field of the dialog
  std::string text = message;
  if (const size_t at = text.find(kSize); at != text.npos) text.replace(at, kSize.size(), "size");
  for (size_t at = text.find("--"); at != text.npos; at = text.find("--", at + 2)) {
    if (!isOptionAt(text, at)) continue;
    const auto is = [&](std::string_view option) { return text.compare(at, option.size(), option) == 0; };
    if (is("--surface") || is("--iso")) continue;  // which the window has, by other names
    const bool of_conversion = std::string_view(text).substr(0, at).ends_with("with ");
    if (is("--scalar") && !of_conversion) continue;  // the window draws all that a cache has
    const bool of_drawing = is("--backend") || is("--card");
    return text +
           (of_drawing
                ? " (an option of \"curvisplat view\" in a terminal)"
                : " (an option of \"curvisplat convert\" in a terminal; open the cache that it writes)");
  }
  return text;
}

bool Toasts::add(const std::string& text, double now_s, bool is_error, About about) {
  const double ends_s =
      now_s +
      (is_error ? kErrorSeconds : kShortestSeconds + kPerLetterSeconds * static_cast<double>(text.size()));
  shown(now_s);
  const auto same =
      std::find_if(shown_.begin(), shown_.end(), [&](const Toast& toast) { return toast.text == text; });
  if (same != shown_.end()) {
    same->ends_s = ends_s;
    return false;
  }
  if (!is_error && about != About::kNothing)
    std::erase_if(shown_, [about](const Toast& toast) { return !toast.is_error && toast.about == about; });
  shown_.push_back({text, is_error, ends_s, about});
  if (shown_.size() > kMaxShown) shown_.pop_front();
  log_.push_back(text);
  if (log_.size() > kMaxLog) log_.pop_front();
  return true;
}

const std::deque<Toast>& Toasts::shown(double now_s) {
  std::erase_if(shown_, [now_s](const Toast& toast) { return toast.ends_s <= now_s; });
  return shown_;
}

void Toasts::settle(About about) {
  if (about == About::kNothing) return;
  std::erase_if(shown_, [about](const Toast& toast) { return toast.is_error && toast.about == about; });
}

void Toasts::remove(size_t n) {
  if (n < shown_.size()) shown_.erase(shown_.begin() + static_cast<ptrdiff_t>(n));
}

bool Reports::attempt(const std::function<void()>& act, About about) {
  try {
    act();
    return true;
  } catch (const Interrupted&) {
    throw;
  } catch (const std::exception& error) {
    report(error, about);
    return false;
  }
}

void Reports::report(const std::exception& error, About about) {
  if (dynamic_cast<const std::bad_alloc*>(&error))
    return report(std::string("out of memory; lower \"memory\" under View, Detail and memory, or close other "
                              "programs"),
                  about);
  if (const auto* const too_little = dynamic_cast<const TooLittleMemory*>(&error))
    return report(textOf(*too_little), about);
  report(inWindowsWords(oneLine(error.what())), about);
}

void Reports::report(const std::string& text, About about) {
  if (toasts_.add(text, clock_s_(), true, about)) printMessage("warning: {}", text);
}

}  // namespace curvisplat
