#include "tools/serve/client_message.h"

#include <nlohmann/json.hpp>

#include "stream/base/error.h"
#include "stream/base/json_document.h"

namespace curvisplat {
namespace {

constexpr uint64_t kMaxNumber = uint64_t{1} << 53;  // what JavaScript counts to
constexpr size_t kLongestName = 1000;

size_t cacheIn(const JsonField& message, size_t caches) {
  return message.at("cache").count(0, caches - 1);
}

ImageSize sizeIn(const JsonField& message) {
  const JsonField size = message.at("size");
  if (!size.isArray() || size.size() != 2) size.fail("a width and a height in pixels");
  const ImageSize pixels{static_cast<int>(size[0].count(1, kLargestSide)),
                         static_cast<int>(size[1].count(1, kLargestSide))};
  if (static_cast<uint64_t>(pixels.width) * static_cast<uint64_t>(pixels.height) > kMaxPixels)
    size.fail("at most 8.3 million pixels");
  return pixels;
}

std::string nameIn(const JsonField& message, const char* field) {
  const JsonField name = message.at(field);
  std::string text = name.text();
  if (text.size() > kLongestName) name.fail("a shorter name");
  return text;
}

ViewRequest viewIn(const JsonField& message, size_t caches) {
  ViewRequest view;
  view.number = message.at("number").count(0, kMaxNumber);
  view.cache = cacheIn(message, caches);
  view.size = sizeIn(message);
  view.moving = message.at("moving").flag();
  view.step = message.at("step").count(0, kMaxNumber);
  if (const auto next = message.find("next")) view.next = next->count(0, kMaxNumber);
  const JsonField state = message.at("state");
  if (!state.isObject()) state.fail("an object");
  // Bytes that are no UTF-8 do not get here: the parser refuses them.
  view.state = state.json().dump();
  return view;
}

HistogramRequest histogramIn(const JsonField& message, size_t caches) {
  HistogramRequest histogram{cacheIn(message, caches), nameIn(message, "scalar"), message.at("low").number(),
                             message.at("high").number(), message.at("log").flag()};
  const double width = histogram.high - histogram.low;
  if (!(width > 0 && width < 1e300)) message.at("high").fail("more than low");
  if (histogram.log && !(histogram.low > 0)) message.at("low").fail("a number above zero");
  return histogram;
}

}  // namespace

ClientMessage parseClientMessage(std::string_view text, size_t caches) {
  if (text.size() > kLongestMessage)
    throw Error("message: is too long (found {} bytes, expected at most {})", text.size(), kLongestMessage);
  const JsonDocument document(text, "message", "an object with a type");
  const JsonField message = document.root();
  const JsonField type = message.at("type");
  const std::string name = type.text();
  if (name == "open") return OpenRequest{cacheIn(message, caches), sizeIn(message)};
  if (name == "view") return viewIn(message, caches);
  if (name == "choose") return FunctionRequest{cacheIn(message, caches), nameIn(message, "scalar")};
  if (name == "histogram") return histogramIn(message, caches);
  if (name == "colours") return ColoursRequest{nameIn(message, "map")};
  if (name == "pick") return PickRequest{message.at("x").number(0, 1), message.at("y").number(0, 1)};
  if (name == "shown") return ShownReport{message.at("picture").count(0, kMaxNumber)};
  type.fail("open, view, choose, histogram, colours, pick or shown");
}

}  // namespace curvisplat
