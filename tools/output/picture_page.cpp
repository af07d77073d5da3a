#include "tools/output/picture_page.h"

#include <fmt/format.h>

#include <algorithm>
#include <cstddef>
#include <span>
#include <string_view>

#include "render/image/image_file.h"

namespace curvisplat {
namespace {

// The page's head. Without scripts, the first picture is seen.
constexpr const char* kHead = R"(<!doctype html>
<html lang="en">
<head>
<meta charset="utf-8">
<meta name="viewport" content="width=device-width, initial-scale=1">
<title>{0}</title>
<style>
body {{ margin: 0; font: 15px system-ui, sans-serif; background: #15171c; color: #ccd; text-align: center; }}
#frames {{ display: inline-block; touch-action: pan-y; cursor: ew-resize; user-select: none; outline-offset: -2px; }}
#frames img {{ display: none; max-width: 100%; max-height: calc(100vh - 3em); margin: auto; }}
#frames img.shown {{ display: block; }}
#controls {{ display: flex; gap: 8px; align-items: center; max-width: {1}px; margin: 4px auto; padding: 0 8px; }}
#controls input {{ flex: 1; min-width: 0; }}
</style>
</head>
<body>
<div id="frames" tabindex="0" role="img" aria-label="{0}: drag, or use the arrow keys">
)";

constexpr const char* kTail = R"(</div>
<div id="controls"><button id="play">play</button><input id="frame" type="range" min="0" value="0" aria-label="picture">
<output id="number"></output></div>
<script>
"use strict";
const frames = document.getElementById("frames"), pictures = frames.children, slider = document.getElementById("frame");
const play = document.getElementById("play"), number = document.getElementById("number");
let shown = 0, timer = 0, drag = null;
function show(n) {{
  pictures[shown].className = "";
  shown = (n % pictures.length + pictures.length) % pictures.length;
  pictures[shown].className = "shown";
  slider.value = shown;
  number.value = (shown + 1) + " / " + pictures.length;
}}
function stop() {{ clearInterval(timer); timer = 0; play.textContent = "play"; }}
play.onclick = () => {{
  if (timer) return stop();
  timer = setInterval(() => show(shown + 1), 1000 / {0});
  play.textContent = "stop";
}};
slider.max = pictures.length - 1;
slider.oninput = () => {{ stop(); show(+slider.value); }};
frames.onpointerdown = e => {{ stop(); drag = {{ x: e.clientX, from: shown }}; frames.setPointerCapture(e.pointerId); e.preventDefault(); frames.focus(); }};
// All pictures along the width of one.
frames.onpointermove = e => {{ if (drag) show(drag.from + Math.round((e.clientX - drag.x) / pictures[shown].width * pictures.length)); }};
frames.onpointerup = frames.onpointercancel = () => {{ drag = null; }};
frames.onkeydown = e => {{
  const step = {{ ArrowRight: 1, ArrowLeft: -1 }}[e.key];
  if (step) {{ stop(); show(shown + step); e.preventDefault(); }}
  if (e.key === " ") {{ play.click(); e.preventDefault(); }}
}};
show(0);
</script>
</body>
</html>
)";

std::string escaped(std::string_view text) {
  std::string result;
  for (const char letter : text) {
    if (letter == '&' || letter == '<' || letter == '>' || letter == '"')
      result += fmt::format("&#{};", static_cast<int>(letter));
    else
      result += letter;
  }
  return result;
}

std::string base64(std::span<const std::byte> bytes) {
  constexpr std::string_view kLetters = "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
  std::string text;
  text.reserve((bytes.size() + 2) / 3 * 4);
  for (size_t n = 0; n < bytes.size(); n += 3) {
    const size_t count = std::min<size_t>(3, bytes.size() - n);
    uint32_t group = 0;
    for (size_t k = 0; k < 3; ++k)
      group = group << 8 | (k < count ? std::to_integer<uint32_t>(bytes[n + k]) : 0);
    for (size_t k = 0; k < 4; ++k) text += k <= count ? kLetters[group >> (18 - 6 * k) & 63] : '=';
  }
  return text;
}

}  // namespace

bool isPageName(const std::filesystem::path& path) {
  return extensionOf(path) == ".html";
}

PicturePage::PicturePage(const std::filesystem::path& path, ImageSize size, double frames_per_s)
    : name_(escaped(path.stem().string())),
      frames_per_s_(frames_per_s),
      unfinished_(writableTarget(path)),
      file_(unfinished_.path(), Caching::kPages, OutputFile::Existing::kEmpty, unfinished_.target()) {
  write(fmt::format(kHead, name_, size.width));
}

void PicturePage::write(const std::string& text) {
  file_.append(std::as_bytes(std::span(text)));
}

void PicturePage::append(const Image& image) {
  write(fmt::format("<img{} width=\"{}\" height=\"{}\" alt=\"{}, picture {}\" src=\"data:image/png;base64,",
                    pictures_ == 0 ? " class=\"shown\"" : "", image.size.width, image.size.height, name_,
                    pictures_ + 1));
  ++pictures_;
  write(base64(encodePng(image)) + "\">\n");
}

void PicturePage::finish() {
  write(fmt::format(kTail, frames_per_s_));
  file_.close();
  unfinished_.putIntoPlace();
}

}  // namespace curvisplat
