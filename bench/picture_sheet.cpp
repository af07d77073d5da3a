#include "bench/picture_sheet.h"

#include <algorithm>
#include <cctype>
#include <cstdint>
#include <string_view>

namespace curvisplat {
namespace {

constexpr int kGap = 4;          // pixels between pictures
constexpr int kLetterScale = 2;  // pixels of the sheet for one of a letter
constexpr int kLabelHeight = 5 * kLetterScale + 6;

struct Letter {
  char letter;
  std::string_view rows;  // five, from the top; an octal digit has three pixels
};
constexpr Letter kLetters[] = {
    {'0', "75557"}, {'1', "26227"}, {'2', "71747"}, {'3', "71717"}, {'4', "55711"}, {'5', "74717"},
    {'6', "74757"}, {'7', "71122"}, {'8', "75757"}, {'9', "75717"}, {'a', "25755"}, {'b', "65656"},
    {'c', "34443"}, {'d', "65556"}, {'e', "74647"}, {'f', "74644"}, {'g', "34553"}, {'h', "55755"},
    {'i', "72227"}, {'j', "11152"}, {'k', "55655"}, {'l', "44447"}, {'m', "57755"}, {'n', "65555"},
    {'o', "25552"}, {'p', "65644"}, {'q', "25563"}, {'r', "65655"}, {'s', "34216"}, {'t', "72222"},
    {'u', "55557"}, {'v', "55552"}, {'w', "55775"}, {'x', "55255"}, {'y', "55222"}, {'z', "71247"},
    {'+', "02720"}, {'-', "00700"}, {'.', "00002"}, {'_', "00007"}, {'/', "11244"}, {'%', "51245"}};

void blacken(Image& image, int x, int y) {
  if (x >= 0 && y >= 0 && x < image.size.width && y < image.size.height)
    std::fill_n(image.pixel(x, y), 3, 0.0f);
}

void drawText(Image& image, int left, int top, const std::string& text) {
  for (const char c : text) {
    const char small = static_cast<char>(std::tolower(static_cast<unsigned char>(c)));
    for (const Letter& each : kLetters)
      for (int y = 0; each.letter == small && y < 5 * kLetterScale; ++y)
        for (int x = 0; x < 3 * kLetterScale; ++x)
          if ((each.rows[static_cast<size_t>(y / kLetterScale)] - '0') >> (2 - x / kLetterScale) & 1)
            blacken(image, left + x, top + y);
    left += 4 * kLetterScale;
  }
}

Image white(ImageSize size) {
  Image image(size);
  std::fill(image.rgba.begin(), image.rgba.end(), 1.0f);
  return image;
}

}  // namespace

PictureSheet::PictureSheet(ImageSize picture, int shrink)
    : tile_{picture.width / shrink, picture.height / shrink}, shrink_(shrink) {}

void PictureSheet::addRow(const std::string& label, const std::vector<Image>& pictures) {
  columns_ = std::max(columns_, pictures.size());
  Image row =
      white({static_cast<int>(pictures.size()) * (tile_.width + kGap), kLabelHeight + tile_.height + kGap});
  drawText(row, 2, 3, label);
  for (size_t n = 0; n < pictures.size(); ++n) {
    if (pictures[n].size.pixels() == 0) continue;
    const Image tile = shrunk(pictures[n], shrink_);
    for (int y = 0; y < tile_.height; ++y)
      for (int x = 0; x < tile_.width; ++x)
        std::copy_n(tile.pixel(x, y), 3,
                    row.pixel(static_cast<int>(n) * (tile_.width + kGap) + x, kLabelHeight + y));
  }
  rows_.push_back(std::move(row));
}

Image PictureSheet::image() const {
  const int height = kLabelHeight + tile_.height + kGap;
  Image sheet = white({static_cast<int>(columns_) * (tile_.width + kGap),
                       std::max(1, static_cast<int>(rows_.size()) * height)});
  for (size_t n = 0; n < rows_.size(); ++n)
    for (int y = 0; y < height; ++y)
      std::copy_n(rows_[n].pixel(0, y), 4 * rows_[n].size.width,
                  sheet.pixel(0, static_cast<int>(n) * height + y));
  return sheet;
}

Image shrunk(const Image& picture, int factor) {
  Image small({picture.size.width / factor, picture.size.height / factor});
  for (int y = 0; y < small.size.height; ++y)
    for (int x = 0; x < small.size.width; ++x)
      for (int channel = 0; channel < 4; ++channel) {
        float sum = 0;
        for (int v = 0; v < factor; ++v)
          for (int u = 0; u < factor; ++u)
            sum += std::clamp(picture.pixel(x * factor + u, y * factor + v)[channel], 0.0f, 1.0f);
        small.pixel(x, y)[channel] = sum / static_cast<float>(factor * factor);
      }
  return small;
}

Image signedDifference(const Image& a, const Image& b, float gain) {
  Image out(a.size);
  for (size_t n = 0; n < out.rgba.size(); ++n)
    out.rgba[n] = n % 4 == 3 ? 1.0f : std::clamp(0.5f + gain * (a.rgba[n] - b.rgba[n]), 0.0f, 1.0f);
  return out;
}

}  // namespace curvisplat
