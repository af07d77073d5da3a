// The film that is made in the window: small pictures of its key frames, a time line on which these are moved, and buttons. It
// writes what the user does into PanelActions::film. For the window's thread, within a frame.
#pragma once

#include <cstdint>
#include <functional>
#include <optional>

#include "tools/panels/labels.h"
#include "tools/view/film_edit.h"
#include "tools/window/widgets.h"

namespace curvisplat {

/// The texture of a small picture (FilmEdit::Key::picture) for Dear ImGui; null until it has been drawn.
using FilmPictures = std::function<void*(uint64_t picture)>;

class FilmPanel {
 public:
  /// The part of a small picture's height of its width.
  static constexpr double kShape = 2.0 / 3;

  void draw(const FilmEdit& film, const FilmPictures& pictures, PanelActions& actions);

 private:
  struct TimeScale;

  static void drawPictures(const FilmEdit& film, const FilmPictures& pictures, FilmActions& actions);
  void drawTimeLine(const FilmEdit& film, PanelActions& actions);
  /// The mark of key frame `n`; whether it is being dragged.
  bool drawMark(const FilmEdit& film, size_t n, const TimeScale& scale, FilmActions& actions);
  void drawTime(const FilmEdit& film, FilmActions& actions);

  TypedNumbers typed_;
  std::optional<double> extent_s_;  // of the time line, while something on it is dragged
  float pressed_x_ = 0;             // where the mouse took a mark
  bool moves_ = false;              // it has moved far enough since to move the mark
};

}  // namespace curvisplat
