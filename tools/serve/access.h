// Who may talk to the server: the secret in the address, and the names under which a browser may have reached it.
//
// The token keeps other users of the machine out. Host and Origin keep other pages in the same browser out: a page of
// another site may send requests here, also under a name of its own that it makes resolve to this machine.
// Pure functions, for any thread.
#pragma once

#include <filesystem>
#include <string>
#include <string_view>
#include <vector>

namespace curvisplat {

/// 128 random bits from the kernel, as 32 hexadecimal digits. Throws Error.
std::string newToken();
/// The first line of a file that only its owner may read. Throws Error for any other file, and for a token that is
/// shorter than 16 characters, longer than 256, or has others than letters, digits, '-' and '_'.
std::string readToken(const std::filesystem::path& path);

/// Takes the same time wherever the two differ.
bool isSameToken(std::string_view given, std::string_view expected);

/// What a request asks for: "/socket?token=abc" is path "/socket" and token "abc".
struct RequestTarget {
  std::string_view path, token;  // the token is empty if there is none
};
RequestTarget targetOf(std::string_view target);

/// Whether a Host header names this machine: localhost, an address in digits (which no one can make resolve to
/// somewhere else), or one of `names`. Ports are not compared: tunnels have their own.
bool isKnownHost(std::string_view host, const std::vector<std::string>& names);

/// Whether an Origin header is that of our own page, which `host` has sent.
bool isOwnOrigin(std::string_view origin, std::string_view host);

}  // namespace curvisplat
