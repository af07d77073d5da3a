// The page that shows a cache in a browser: page.html, as a constant.
#pragma once

#include <string_view>

namespace curvisplat {

/// HTML with its scripts and styles. "@NONCE@" stands where the response's nonce goes.
extern const std::string_view kPage;

}  // namespace curvisplat
