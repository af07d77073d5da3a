#include "preprocess/formats/tecplot/tecplot_numbers.h"

#include <algorithm>
#include <charconv>
#include <cstring>
#include <span>
#include <vector>

#include "stream/base/error.h"
#include "stream/base/text.h"

namespace curvisplat {
namespace {

constexpr uint64_t kMaxNumbers = uint64_t{1} << 40;

/// Numbers that a word stands for: "1.5", "3*1.5", "1,2,3". Calls add(value, times). False if it is none.
template <typename Add>
bool forEachNumberOfWord(std::string_view word, const Add& add) {
  while (!word.empty()) {
    const size_t comma = std::min(word.find(','), word.size());
    std::string_view number = word.substr(0, comma);
    word.remove_prefix(std::min(comma + 1, word.size()));
    if (number.empty()) continue;
    uint64_t times = 1;
    if (const size_t star = number.find('*'); star != std::string_view::npos) {
      const auto [end, error] = std::from_chars(number.data(), number.data() + star, times);
      if (error != std::errc() || end != number.data() + star) return false;
      number.remove_prefix(star + 1);
    }
    if (!add(number, times)) return false;
  }
  return true;
}

}  // namespace

bool beginsTecplotNumber(std::string_view word) {
  if (word.empty()) return false;
  if (std::strchr("+-.0123456789", word[0])) return true;
  double value = 0;
  return parseNumber(word.substr(0, word.find(',')), value);  // nan, inf
}

FilePart countTecplotNumbers(TextReader& text) {
  FilePart numbers;
  numbers.begin = text.offset();
  uint64_t& count = numbers.count;
  size_t sampled = 0;
  for (;;) {
    const std::string_view word = text.peekWord();
    if (word.starts_with('#')) {
      text.line();
      continue;
    }
    if (!beginsTecplotNumber(word)) {
      numbers.end = text.offset();
      return numbers;
    }
    const uint64_t before = count;
    forEachNumberOfWord(word, [&](std::string_view number, uint64_t times) {
      count += std::min(times, kMaxNumbers);
      if (sampled++ < kDigitSamples) numbers.digits = std::max(numbers.digits, significantDigits(number));
      return true;
    });
    if (count < before || count > kMaxNumbers)
      throw Error("{}: byte {}: more numbers than a grid can have; the file is damaged", text.file().name(),
                  text.offset());
    text.word();
  }
}

void spoolTecplotNumbers(const std::shared_ptr<const PooledFile>& file, uint64_t begin, uint64_t count,
                         const SpoolFile::Sink& sink) {
  constexpr size_t kPending = 65536;
  TextReader text(file, begin, file->size());
  std::vector<double> pending;
  const auto flush = [&] {
    sink(std::as_bytes(std::span(pending)));
    pending.clear();
  };
  for (uint64_t left = count; left > 0;) {
    const std::string_view word = text.peekWord();
    if (word.starts_with('#')) {
      text.line();
      continue;
    }
    const bool numbers =
        !word.empty() && forEachNumberOfWord(word, [&](std::string_view number, uint64_t times) {
          double value = 0;
          if (!parseNumber(number, value)) return false;
          for (uint64_t n = 0; n < times && left > 0; ++n, --left) {
            pending.push_back(value);
            if (pending.size() == kPending) flush();
          }
          return true;
        });
    if (!numbers)
      throw Error("{}: byte {}: found \"{}\"; expected a number", file->name(), text.offset(),
                  printable(text.peekWord().substr(0, 30)));
    text.word();
  }
  if (!pending.empty()) flush();
}

}  // namespace curvisplat
