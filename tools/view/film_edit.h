// The film that is made in the window: its key frames, the time of it that is shown, and playing it there. A value type; knows no
// window.
//
// A view becomes a key frame by keyOf(): camera, function of the colours, clip box, visible clip planes and slices, and the time
// of a series. show() is the way back, at any time of the film. Other things of a view, such as lighting and isosurfaces, are
// the same in the whole film.
#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "render/film/film.h"
#include "stream/cache/series.h"
#include "tools/view/view_state.h"

namespace curvisplat {

class FilmEdit {
 public:
  static constexpr double kApart = 2;        // seconds between a key frame and one that is added behind it
  static constexpr double kMinApart = 0.04;  // key frames are not moved closer than that

  struct Key {
    KeyFrame frame;
    KeyLook look;
    uint64_t picture = 0;  // another one for each view: of what a small picture is
  };
  const std::vector<Key>& keys() const { return keys_; }
  double time() const { return time_; }
  /// The film is from the first key frame to the last.
  double begin() const { return keys_.empty() ? 0 : keys_.front().frame.time; }
  double end() const { return keys_.empty() ? 0 : keys_.back().frame.time; }
  /// The key frame at time().
  std::optional<size_t> selected() const;
  /// The film. Null without key frames.
  const std::shared_ptr<const Film>& film() const { return film_; }
  /// The frames of a movie of it.
  uint64_t frames(double frames_per_s = kFramesPerSecond) const;

  /// Adds the view at time(), or behind the selected key frame: half way to the next, or kApart after the last. Goes there.
  /// `series_time`: of a series. Throws Error if it does not suit the others, as a view of another projection or scalar.
  void add(const ViewState& state, std::optional<double> series_time);
  /// Gives the selected key frame another view.
  void replace(const ViewState& state, std::optional<double> series_time);
  /// Removes the selected key frame, and selects the one before.
  void remove();
  /// Moves a key frame in time, perhaps past others; time() goes with it. Does nothing where it would lie on another one.
  void move(size_t key, double time);
  void goTo(double time);
  /// Moves the cameras as the data's scale in the window changes: each keeps the place that it looks at.
  void follow(const glm::dvec3& scale);
  /// Takes the place of the film with another one, of which each key frame gets what it does not state from the view.
  /// Times begin at 0.
  void open(const Film& opened, const ViewState& state, std::optional<double> series_time);
  /// Takes the key frames of an earlier state of itself, if they are others. Small pictures keep their numbers.
  void goBackTo(const FilmEdit& earlier);

  bool isPlaying() const { return began_s_.has_value(); }
  /// Plays on from time(), from the beginning at the end.
  void play(double now_s);
  void stop() { began_s_.reset(); }
  /// Goes on while it plays; stops at the end. Returns whether it went on.
  bool tick(double now_s);

 private:
  Key keyOf(const ViewState& state, std::optional<double> series_time);
  void take(std::vector<Key> keys, const std::string& scalar);

  std::vector<Key> keys_;
  std::shared_ptr<const Film> film_;
  glm::dvec3 scale_{1.0};  // of the views that the cameras are from
  uint64_t pictures_ = 0;  // the newest Key::picture
  double time_ = 0;
  std::optional<double> began_s_;  // when time 0 was, by the caller's clock
};

/// Puts what a film of FilmEdit shows at a time into the view: its functions and all cuts. Scalar and hidden planes stay.
void show(const Film& film, double time, ViewState& state);

/// The place in the series at that time of the film; nullopt if the film has no such times. `interpolates`: between steps, too.
std::optional<StepPosition> positionOf(const Film& film, double time, const Series& series,
                                       bool interpolates);

}  // namespace curvisplat
