#include "tools/view/film_edit.h"

#include <algorithm>
#include <cmath>
#include <iterator>
#include <utility>

#include "render/surface/surface_scene.h"
#include "stream/base/error.h"

namespace curvisplat {
namespace {

constexpr const char* kName = "the film";  // in messages

/// Makes a key frame's function and cuts of those of a view.
KeyLook lookOf(const ViewState& state) {
  KeyLook look;
  if (const auto parts = state.function.parts())
    look.setFunction(*parts);
  else
    look.function = state.function.definition();
  look.clip_box = state.clip_box;
  look.clip_planes = visiblePlanes(state.clip_planes);
  look.slices = visiblePlanes(state.slices);
  return look;
}

/// Replaces the visible planes; hidden ones stay behind them as far as there is room.
void takePlanes(const std::vector<ClipPlane>& from, size_t most, std::vector<ListedPlane>& planes) {
  std::erase_if(planes, [](const ListedPlane& plane) { return plane.visible; });
  std::vector<ListedPlane> taken;
  for (const ClipPlane& plane : from) taken.push_back({plane});
  taken.insert(taken.end(), planes.begin(), planes.end());
  if (taken.size() > most) taken.erase(taken.begin() + static_cast<std::ptrdiff_t>(most), taken.end());
  planes = std::move(taken);
}

}  // namespace

std::optional<size_t> FilmEdit::selected() const {
  const auto key = std::ranges::find(keys_, time_, [](const Key& k) { return k.frame.time; });
  if (key == keys_.end()) return std::nullopt;
  return static_cast<size_t>(key - keys_.begin());
}

uint64_t FilmEdit::frames(double frames_per_s) const {
  return 1 + static_cast<uint64_t>(std::llround(frames_per_s * (end() - begin())));
}

FilmEdit::Key FilmEdit::keyOf(const ViewState& state, std::optional<double> series_time) {
  if (film_ && film_->scalar() != state.variable)
    throw Error("{} shows {}: show it again, or remove all key frames", kName, film_->scalar());
  return {{time_, state.camera, series_time}, lookOf(state), ++pictures_};
}

/// Throws without a change if these are no film.
void FilmEdit::take(std::vector<Key> keys, const std::string& scalar) {
  std::ranges::sort(keys, {}, [](const Key& key) { return key.frame.time; });
  if (!keys.empty()) {
    std::vector<KeyFrame> frames;
    std::vector<KeyLook> looks;
    for (const Key& key : keys) {
      frames.push_back(key.frame);
      looks.push_back(key.look);
    }
    film_ = std::make_shared<const Film>(CameraPath(std::move(frames), kName), std::move(looks), scalar,
                                         kName, scale_);
  } else {
    film_.reset();
  }
  keys_ = std::move(keys);
  stop();
}

void FilmEdit::follow(const glm::dvec3& scale) {
  const glm::dvec3 before = std::exchange(scale_, scale);
  if (keys_.empty() || before == scale) return;
  std::vector<Key> keys = keys_;
  for (Key& key : keys) {
    key.frame.camera = rescaled(key.frame.camera, before, scale);
    key.picture = ++pictures_;
  }
  take(std::move(keys), film_->scalar());
}

void FilmEdit::add(const ViewState& state, std::optional<double> series_time) {
  follow(state.scale);
  std::vector<Key> keys = keys_;
  Key& key = keys.emplace_back(keyOf(state, series_time));
  if (const auto behind = selected()) {
    const double from = keys_[*behind].frame.time;
    key.frame.time =
        *behind + 1 < keys_.size() ? 0.5 * (from + keys_[*behind + 1].frame.time) : from + kApart;
  }
  const double time = key.frame.time;
  take(std::move(keys), state.variable);
  time_ = time;
}

void FilmEdit::replace(const ViewState& state, std::optional<double> series_time) {
  const auto key = selected();
  if (!key) return;
  follow(state.scale);
  std::vector<Key> keys = keys_;
  keys[*key] = keyOf(state, series_time);
  take(std::move(keys), state.variable);
}

void FilmEdit::remove() {
  const auto key = selected();
  if (!key) return;
  std::vector<Key> keys = keys_;
  keys.erase(keys.begin() + static_cast<std::ptrdiff_t>(*key));
  take(std::move(keys), film_->scalar());
  goTo(keys_.empty() ? 0 : keys_[*key > 0 ? *key - 1 : 0].frame.time);
}

void FilmEdit::move(size_t key, double time) {
  if (!(time >= 0) || !std::isfinite(time)) return;
  for (size_t n = 0; n < keys_.size(); ++n)
    if (n != key && std::abs(keys_[n].frame.time - time) < kMinApart) return;
  std::vector<Key> keys = keys_;
  keys.at(key).frame.time = time;
  take(std::move(keys), film_->scalar());
  goTo(time);
}

void FilmEdit::goTo(double time) {
  stop();
  time_ = std::clamp(time, begin(), end());
}

void FilmEdit::open(const Film& opened, const ViewState& state, std::optional<double> series_time) {
  const Film film = opened.inScale(state.scale);
  scale_ = state.scale;
  std::vector<Key> keys;
  const KeyLook shown = lookOf(state);
  const Film::Stated& has = film.stated();
  const double begin = film.cameras().begin();
  for (size_t n = 0; n < film.looks().size(); ++n) {
    Key& key = keys.emplace_back(Key{film.cameras().keyFrames()[n], film.looks()[n], ++pictures_});
    key.frame.time -= begin;
    if (!series_time || !key.frame.series_time) key.frame.series_time = series_time;
    if (!has.functions) {
      key.look.function = shown.function;
      key.look.parts = shown.parts;
    }
    if (!has.clip_boxes) key.look.clip_box = shown.clip_box;
    if (!has.clip_planes) key.look.clip_planes = shown.clip_planes;
    if (!has.slices) key.look.slices = shown.slices;
  }
  take(std::move(keys), state.variable);
  goTo(0);
}

void FilmEdit::goBackTo(const FilmEdit& earlier) {
  if (earlier.film_ == film_) return;
  const uint64_t newest = std::max(pictures_, earlier.pictures_);
  *this = earlier;
  pictures_ = newest;
  stop();
}

void FilmEdit::play(double now_s) {
  if (time_ >= end()) goTo(begin());
  if (end() > begin()) began_s_ = now_s - time_;
}

bool FilmEdit::tick(double now_s) {
  if (!began_s_) return false;
  time_ = std::clamp(now_s - *began_s_, begin(), end());
  if (time_ >= end()) stop();
  return true;
}

void show(const Film& film, double time, ViewState& state) {
  state.camera = film.cameras().at(time);
  const KeyLook look = film.lookAt(time);
  if (look.parts)
    state.function = EditedFunction(*look.parts);
  else if (look.function)
    state.function = EditedFunction(*look.function, look.function->opacity_unit);
  state.clip_box = look.clip_box;
  takePlanes(look.clip_planes.value_or(std::vector<ClipPlane>{}), kMaxClipPlanes, state.clip_planes);
  takePlanes(look.slices.value_or(std::vector<ClipPlane>{}), kMaxSlices, state.slices);
}

std::optional<StepPosition> positionOf(const Film& film, double time, const Series& series,
                                       bool interpolates) {
  if (!film.cameras().hasSeriesTimes()) return std::nullopt;
  const double at = film.cameras().seriesTimeAt(time);
  return interpolates ? series.between(at) : StepPosition{series.nearest(at)};
}

}  // namespace curvisplat
