#include "tools/serve/client_requests.h"

#include <fmt/format.h>
#include <sys/stat.h>
#include <boost/asio/ip/address.hpp>
#include <nlohmann/json.hpp>

#include <algorithm>
#include <array>
#include <cctype>

#include "stream/base/error.h"
#include "stream/base/file.h"
#include "stream/base/json_document.h"
#include "stream/base/os.h"
#include "stream/base/text.h"

namespace curvisplat {
namespace {

constexpr size_t kShortestToken = 16, kLongestToken = 256;

bool isPort(std::string_view text) {
  return !text.empty() && text.size() <= 5 &&
         std::all_of(text.begin(), text.end(), [](unsigned char c) { return std::isdigit(c); });
}

/// The name in "name", "name:port", "[address]" and "[address]:port"; empty for anything else.
std::string_view hostIn(std::string_view host) {
  if (host.starts_with('[')) {
    const size_t end = host.find(']');
    if (end == std::string_view::npos) return {};
    const std::string_view rest = host.substr(end + 1);
    return rest.empty() || (rest[0] == ':' && isPort(rest.substr(1))) ? host.substr(1, end - 1)
                                                                      : std::string_view{};
  }
  const size_t colon = host.find(':');
  if (colon == std::string_view::npos) return host;
  return isPort(host.substr(colon + 1)) ? host.substr(0, colon) : std::string_view{};
}

}  // namespace

std::string newToken() {
  std::array<unsigned char, 16> bytes{};
  if (!os::fillRandom(bytes))
    throw Error("the kernel gave no random numbers for a token; give one with --token-file");
  return fmt::format("{:02x}", fmt::join(bytes, ""));
}

std::string readToken(const std::filesystem::path& path) {
  struct stat status {};
  const bool is_file = ::stat(path.c_str(), &status) == 0 && S_ISREG(status.st_mode);
  if (is_file && (status.st_mode & (S_IRWXG | S_IRWXO)) != 0)
    throw Error("{}: others may read the token (found mode {:03o}, expected 600); run chmod 600 on it",
                path.string(), status.st_mode & 0777u);
  std::string token = readTextFile(path);
  token.resize(std::min(token.size(), token.find_first_of("\r\n")));
  const bool plain = std::all_of(token.begin(), token.end(),
                                 [](unsigned char c) { return std::isalnum(c) || c == '-' || c == '_'; });
  if (!plain || token.size() < kShortestToken || token.size() > kLongestToken)
    throw Error("{}: is not a token (found {} characters, expected {} to {} letters, digits, '-' and '_')",
                path.string(), token.size(), kShortestToken, kLongestToken);
  return token;
}

bool isSameToken(std::string_view given, std::string_view expected) {
  if (expected.empty()) return false;
  // One pass over what is expected, whatever was given; a shorter text is compared with padding.
  volatile unsigned difference = given.size() == expected.size() ? 0 : 1;
  for (size_t n = 0; n < expected.size(); ++n) {
    const unsigned char c = n < given.size() ? static_cast<unsigned char>(given[n]) : 0;
    difference = difference | (c ^ static_cast<unsigned char>(expected[n]));
  }
  return difference == 0;
}

RequestTarget targetOf(std::string_view target) {
  RequestTarget result;
  const size_t query = target.find('?');
  result.path = target.substr(0, query);
  if (query == std::string_view::npos) return result;
  std::string_view rest = target.substr(query + 1);
  while (!rest.empty()) {
    const std::string_view field = rest.substr(0, rest.find('&'));
    constexpr std::string_view kToken = "token=";
    if (field.starts_with(kToken)) result.token = field.substr(kToken.size());
    rest.remove_prefix(std::min(rest.size(), field.size() + 1));
  }
  return result;
}

bool isKnownHost(std::string_view host, const std::vector<std::string>& names) {
  const std::string_view name = hostIn(host);
  if (name.empty()) return false;
  if (isSameIgnoringCase(name, "localhost")) return true;
  boost::system::error_code not_an_address;
  boost::asio::ip::make_address(std::string(name), not_an_address);
  if (!not_an_address) return true;
  return std::any_of(names.begin(), names.end(),
                     [&](const std::string& known) { return isSameIgnoringCase(name, known); });
}

bool isOwnOrigin(std::string_view origin, std::string_view host) {
  for (const std::string_view scheme : {"http://", "https://"})
    if (origin.starts_with(scheme) && isSameIgnoringCase(origin.substr(scheme.size()), host))
      return !host.empty();
  return false;
}

namespace {

constexpr uint64_t kMaxNumber = uint64_t{1} << 53;  // what JavaScript counts to
constexpr size_t kLongestName = 1000;

size_t cacheIn(const JsonField& message) {
  return message.at("cache").count(0, kMaxNumber);
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

std::string stateIn(const JsonField& message) {
  const JsonField state = message.at("state");
  if (!state.isObject()) state.fail("an object");
  // Bytes that are no UTF-8 do not get here: the parser refuses them.
  return state.json().dump();
}

ViewRequest viewIn(const JsonField& message) {
  ViewRequest view;
  view.number = message.at("number").count(0, kMaxNumber);
  view.cache = cacheIn(message);
  view.size = sizeIn(message);
  view.moving = message.at("moving").flag();
  if (const auto saves = message.find("saves")) view.saves = saves->flag();
  view.step = message.at("step").count(0, kMaxNumber);
  if (const auto next = message.find("next")) view.next = next->count(0, kMaxNumber);
  view.state = stateIn(message);
  return view;
}

FunctionRequest functionIn(const JsonField& message) {
  const auto dark = message.find("dark"), sheets = message.find("sheets");
  return {cacheIn(message), nameIn(message, "scalar"), !dark || dark->flag(), sheets && sheets->flag()};
}

HistogramRequest histogramIn(const JsonField& message) {
  HistogramRequest histogram{cacheIn(message), nameIn(message, "scalar"), message.at("low").number(),
                             message.at("high").number(), message.at("log").flag()};
  const double width = histogram.high - histogram.low;
  if (!(width > 0 && width < 1e300)) message.at("high").fail("more than low");
  if (histogram.log && !(histogram.low > 0)) message.at("low").fail("a number above zero");
  if (const auto asinh = message.find("asinh"); asinh && !histogram.log) {
    const std::vector<JsonField> both = asinh->elements(2);
    if (both.size() != 2) asinh->fail("centre and width");
    histogram.asinh = AsinhScale{both[0].number(-1e300, 1e300), both[1].number(1e-300, 1e300)};
    const double extent =
        histogram.asinh->coordinate(histogram.high) - histogram.asinh->coordinate(histogram.low);
    if (!(extent > 1e-6 && extent < 1e6)) asinh->fail("a scale that divides the range");  // NaN fails, too
  }
  return histogram;
}

}  // namespace

ClientMessage parseClientMessage(std::string_view text) {
  if (text.size() > kLongestMessage)
    throw Error("message: is too long (found {} bytes, expected at most {})", text.size(), kLongestMessage);
  const JsonDocument document(text, "message", "an object with a type");
  const JsonField message = document.root();
  const JsonField type = message.at("type");
  const std::string name = type.text();
  if (name == "open") return OpenRequest{cacheIn(message), sizeIn(message)};
  if (name == "view") return viewIn(message);
  if (name == "choose") return functionIn(message);
  if (name == "histogram") return histogramIn(message);
  if (name == "colours") {
    ColoursRequest colours{nameIn(message, "map")};
    if (const auto parts = message.find("parts")) colours.parts = functionPartsFrom(*parts);
    return colours;
  }
  if (name == "isosurface")
    return IsosurfaceRequest{cacheIn(message), message.at("step").count(0, kMaxNumber),
                             nameIn(message, "scalar"), stateIn(message)};
  if (name == "pick") {
    const auto hovers = message.find("hovers");
    return PickRequest{message.at("x").number(0, 1), message.at("y").number(0, 1), hovers && hovers->flag()};
  }
  if (name == "command")
    return CommandRequest{cacheIn(message), sizeIn(message), message.at("step").count(0, kMaxNumber),
                          stateIn(message)};
  if (name == "shown") return ShownReport{message.at("picture").count(0, kMaxNumber)};
  type.fail("open, view, choose, histogram, colours, isosurface, pick, command or shown");
}

}  // namespace curvisplat
