// Messages to the user, on standard error.
#pragma once

#include <fmt/format.h>

#include <string_view>
#include <utility>

namespace curvisplat {

/// Prints `text` as one line that begins with "curvisplat: ". If standard error cannot be written (a full
/// disk, a closed pipe), the message is lost: that is no reason to fail. Any thread.
void printMessage(std::string_view text) noexcept;
/// Makes printMessage() print nothing: in processes of which another one prints what all have to say.
void muteMessages(bool mute = true) noexcept;

template <typename First, typename... Rest>
void printMessage(fmt::format_string<First, Rest...> format, First&& first, Rest&&... rest) {
  printMessage(fmt::format(format, std::forward<First>(first), std::forward<Rest>(rest)...));
}

}  // namespace curvisplat
