// Movies of a view, and pictures of another size than the window's, which are drawn in the background. The film of a view: its key
// frames as the panel edits them, playing it, its file, and the small pictures of its key frames.
#include <GLFW/glfw3.h>

#include <algorithm>
#include <exception>
#include <utility>

#include "stream/base/error.h"
#include "tools/view/saved_views.h"
#include "tools/viewer/cache_view.h"

namespace curvisplat {
namespace {

constexpr ImageSize kPictureSize{144, static_cast<int>(FilmPanel::kShape * 144)};
constexpr uint64_t kPictureMemory = 128 << 20;

/// Keeps the pictures of a movie in memory.
class KeptPictures final : public MovieOutput {
 public:
  explicit KeptPictures(std::vector<Image>& images) : images_(images) {}
  void write(uint64_t, const Image& image) override { images_.push_back(image); }
  void finish() override {}

 private:
  std::vector<Image>& images_;
};

}  // namespace

/// Draws small pictures; `images` are complete once `job` is done.
struct CacheView::FilmPicturesJob {
  FilmPicturesJob(std::vector<uint64_t> drawn, MovieRequest request)
      : numbers(std::move(drawn)),
        job(
            "small pictures", "beginning",
            [this, movie = std::make_shared<MovieRequest>(std::move(request))](Progress& progress) {
              const OpenMovieOutput open = [this](const std::filesystem::path&, ImageSize, double) {
                return std::make_unique<KeptPictures>(images);
              };
              return drawMovie(*movie, open, progress);
            },
            Window::wake) {}

  const std::vector<uint64_t> numbers;
  std::vector<Image> images;
  BackgroundJob job;
};

std::optional<double> CacheView::seriesTime() const {
  if (!isSeries()) return std::nullopt;
  return cache_.series().timeAt(playback_.position());
}

void CacheView::apply(const FilmActions& actions) {
  if (actions.add) addKeyFrame(false);
  if (actions.replace) addKeyFrame(true);
  if (actions.remove) film_.remove();
  if (actions.play) film_.isPlaying() ? film_.stop() : playFilm();
  if (actions.open) dialog_.open(FileDialog::Purpose::kOpenFilm);
  if (actions.save) dialog_.open(FileDialog::Purpose::kSaveFilm, name() + "_film.json");
  if (actions.move) film_.move(actions.move->first, actions.move->second);
  if (actions.select) film_.goTo(film_.keys()[*actions.select].frame.time);
  if (actions.go_to) film_.goTo(*actions.go_to);
  if (actions.add || actions.replace || actions.remove || actions.move) rests_ = false;
  if (actions.remove || actions.select || actions.go_to) showFilm(true);
}

void CacheView::addKeyFrame(bool replaces) {
  // A movement that has not come to rest is in it.
  replaces ? film_.replace(state_, seriesTime()) : film_.add(state_, seriesTime());
}

/// The view with the film's scalar.
ViewState CacheView::stateOfFilm() const {
  const std::string& scalar = film_.film()->scalar();
  ViewState state = state_;
  if (state.variable == scalar) return state;
  if (state.opacity_by && state.opacity_by->variable == scalar) state.opacity_by.reset();
  chooseVariable(state, manifest(), scalar);
  return state;
}

/// Shows the film at its time. `whole_function`: the function may be another one than before.
void CacheView::showFilm(bool whole_function) {
  const Film* const film = film_.film().get();
  if (!film) return;
  whole_function |= state_.variable != film->scalar();
  state_ = stateOfFilm();
  chooser_.drop(FunctionChooser::For::kScalar);
  chooser_.drop(FunctionChooser::For::kSameScalar);
  chooser_.drop(FunctionChooser::For::kSameColours);
  show(*film, film_.time(), state_);
  takeBars();
  if (const auto at = positionOf(*film, film_.time(), cache_.series(), playback_.interpolates()))
    playback_.goTo(*at);
  if (whole_function) ++function_version_;
  panels_.forgetObjects();
  changed_ = true;
}

void CacheView::playFilm() {
  if (playback_.isPlaying()) playback_.toggle();
  film_.play(glfwGetTime());
  showFilm(true);
}

/// Takes a film's key frames. Shows none of them.
void CacheView::takeFilm(const Film& film) {
  ViewState state = state_;
  if (!film.scalar().empty() && film.scalar() != state.variable)
    chooseVariable(state, manifest(), film.scalar());
  film_.open(film, state, seriesTime());
}

void CacheView::openFilm(const std::filesystem::path& file) {
  takeFilm(Film::fromFile(file));
  showFilm(true);
}

/// Keeps the film for the next time, if it is another one than before.
void CacheView::rememberFilm() const {
  const auto file = rememberedFilmOf(whole());
  if (!file || film_.film() == kept_film_) return;
  try {
    if (film_.film())
      writeState(*file, film_.film()->toJson());
    else
      std::filesystem::remove(*file);
    kept_film_ = film_.film();
  } catch (const std::exception& error) {
    printMessage("warning: cannot save the film: {}", error.what());
  }
}

/// The user's last choice, or the usual one.
CacheView::MovieChoice CacheView::movieChoice(MovieKind kind) const {
  const auto chosen = movie_choices_.find(kind);
  if (chosen != movie_choices_.end()) return chosen->second;
  return {{}, kind == MovieKind::kAllSteps ? playback_.stepsPerSecond() : kFramesPerSecond};
}

void CacheView::saveMovieOf(MovieKind kind) {
  movie_kind_ = kind;
  const MovieRequest movie = newMovie(kind, movieChoice(kind));
  FileDialog::MovieOffer offer{picture_size_,      movie.size, textSize(),
                               movie.frames_per_s, {},         encodes_movies_};
  if (kind == MovieKind::kOneTurn) offer.chosen_frames = framesOf(movie);
  // The dialog may outlive this view.
  offer.frames = [film = film_, frames = framesOf(movie), kind](double rate) {
    return kind == MovieKind::kFilm ? film.frames(rate) : frames;
  };
  dialog_.openToSaveMovie(name() + (encodes_movies_ ? ".mp4" : ".html"), std::move(offer));
}

/// Saves a picture of another size than the window's. What is seen in the window is in it.
void CacheView::savePictureOf(const std::filesystem::path& file, ImageSize size) {
  wanted_movie_ = heldMovie(MovieKind::kOnePicture, {size});
  wanted_movie_->file = file;
}

/// Saves a movie of what is shown now, whatever is changed while it is drawn.
void CacheView::saveMovieTo(const FileDialog::Chosen& chosen) {
  if (movie_kind_ == MovieKind::kFilm && !film_.film()) return;  // its key frames were removed meanwhile
  MovieChoice choice{chosen.size, chosen.frames_per_s};
  if (chosen.frames > 0) choice.turn_frames = chosen.frames;
  if (same(*chosen.size, picture_size_)) choice.size.reset();
  // The speed of playback may be changed until the next one.
  if (movie_kind_ != MovieKind::kAllSteps) movie_choices_[movie_kind_] = choice;
  wanted_movie_ = heldMovie(movie_kind_, choice);
  wanted_movie_->file = chosen.files.front();
}

/// The movie of a size: what is seen in the window is in it, and in one once around the data are whole from all sides.
MovieRequest CacheView::heldMovie(MovieKind kind, const MovieChoice& choice) const {
  MovieRequest movie = newMovie(kind, choice);
  const auto aspect = [](ImageSize of) { return static_cast<double>(of.width) / of.height; };
  // Text takes the same part of the picture.
  movie.state.annotations.text_size *= static_cast<double>(movie.size.height) / picture_size_.height;
  const ImageSize data = dataSizeOf(movie.state, manifest(), movie.size);
  movie.state.camera = holding(movie.state.camera, data_size_, data);
  if (kind == MovieKind::kOneTurn) movie.state.camera = navigation_.onceAround(movie.state.camera, data);
  movie.magnification = std::min(1.0, aspect(data) / aspect(data_size_));
  return movie;
}

/// The movie that a command can draw as the window does: the one that was saved last, but for a film of a narrower size.
MovieRequest CacheView::copiedMovie(MovieKind kind) const {
  MovieChoice choice = movieChoice(kind);
  MovieRequest movie = heldMovie(kind, choice);
  if (kind != MovieKind::kFilm || movie.magnification == 1) return movie;
  choice.size.reset();
  return heldMovie(kind, choice);
}

MovieRequest CacheView::newMovie(MovieKind kind, const MovieChoice& choice) const {
  MovieRequest movie{kind, {}, cache_.at(playback_.position()), state_, choice.size.value_or(picture_size_)};
  if (kind == MovieKind::kFilm) {
    const uint64_t frames = film_.frames(choice.frames_per_s);
    std::vector<double> times;
    for (uint64_t frame = 0; frame < frames; ++frame) times.push_back(film_.film()->timeOf(frame, frames));
    movie = filmMovie(std::move(times));
    movie.size = choice.size.value_or(picture_size_);
  }
  movie.frames_per_s = choice.frames_per_s;
  movie.turn_frames = choice.turn_frames;
  movie.backend = backend_;
  movie.faces_at = faces_at_;
  movie.keep_going = !damaged_.empty();
  if (preview_) movie.keeps = preview_->folder;
  return movie;
}

MovieRequest CacheView::filmMovie(std::vector<double> times) const {
  MovieRequest movie{MovieKind::kFilm, {}, cache_.at(playback_.position()), stateOfFilm(), picture_size_};
  movie.film = film_.film();
  movie.film_times = std::move(times);
  movie.interpolates = playback_.interpolates();
  movie.backend = backend_;
  movie.faces_at = faces_at_;
  movie.keep_going = !damaged_.empty();
  if (preview_) movie.keeps = preview_->folder;
  return movie;
}

/// Takes the small pictures that have been drawn, and begins to draw those that are missing.
void CacheView::drawFilmPictures() {
  if (film_job_ && !film_job_->job.isDone()) return;
  if (const auto done = std::exchange(film_job_, nullptr)) {
    for (size_t n = 0; n < done->images.size(); ++n) {
      const Image& image = done->images[n];
      film_pictures_.at(done->numbers[n]).set(bytesOf(image), image.size);
    }
    window_.redraw();
    done->job.get();  // throws; what failed stays empty
  }
  std::erase_if(film_pictures_, [&](const auto& entry) {
    return std::ranges::none_of(film_.keys(),
                                [&](const FilmEdit::Key& key) { return key.picture == entry.first; });
  });
  std::vector<uint64_t> missing;
  std::vector<double> times;
  for (const FilmEdit::Key& key : film_.keys()) {
    // One that cannot be drawn stays empty: it is not tried again.
    if (!film_pictures_.try_emplace(key.picture, window_.gl()).second) continue;
    missing.push_back(key.picture);
    times.push_back(key.frame.time);
  }
  if (missing.empty()) return;
  MovieRequest movie = filmMovie(std::move(times));
  movie.size = kPictureSize;
  // They show the width of the picture in the window, or its height.
  movie.magnification = std::max(1.0, data_size_.height / FilmPanel::kShape / std::max(1, data_size_.width));
  movie.state.annotations = {};
  movie.state.memory_bytes = std::min(movie.state.memory_bytes, kPictureMemory);
  film_job_ = std::make_shared<FilmPicturesJob>(std::move(missing), std::move(movie));
}

}  // namespace curvisplat
