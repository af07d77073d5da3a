// Words of commands that a user copies into a shell.
#pragma once

#include <string>

namespace curvisplat {

/// `word` as bash, zsh and POSIX of 2024 read it back: as it is where it needs no quotes, otherwise between them, with
/// escapes in place of what a terminal obeys.
std::string shellWord(const std::string& word);

/// "--option word"; "--option=word" where the parser would take the word, which begins with a minus sign, for an
/// option of its own.
std::string shellOption(const std::string& option, const std::string& word);

}  // namespace curvisplat
