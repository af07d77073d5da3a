// One cache in the window: its picture, the panels beside it, and what they change.
#pragma once

#include <algorithm>
#include <array>
#include <cstdint>
#include <deque>
#include <functional>
#include <future>
#include <glm/vec2.hpp>
#include <map>
#include <memory>
#include <optional>
#include <set>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "render/image/too_little_memory.h"
#include "stream/base/error.h"
#include "stream/cache/cache_reader.h"
#include "tools/panels/panels.h"
#include "tools/panels/picture_signs.h"
#include "tools/view/background_jobs.h"
#include "tools/view/film_edit.h"
#include "tools/view/first_view.h"
#include "tools/view/frame_loop.h"
#include "tools/view/history.h"
#include "tools/view/picture_layout.h"
#include "tools/view/playback.h"
#include "tools/view/saved_views.h"
#include "tools/view/view_state.h"
#include "tools/viewer/movie.h"
#include "tools/viewer/navigation.h"
#include "tools/viewer/prepared_view.h"
#include "tools/window/file_dialog.h"
#include "tools/window/reports.h"
#include "tools/window/window.h"
#include "tools/window/window_commands.h"

namespace curvisplat {

inline bool same(ImageSize a, ImageSize b) {
  return a.width == b.width && a.height == b.height;
}

/// The places of things in the window.
struct WindowLayout {
  Rectangle panels, picture, time, status;  // `time`: of a series
  bool shows_panels = true;
};

/// The state that one view of a grid hands to the next: from a preview to the whole, or when a scalar was
/// added.
struct CarriedView {
  ViewState state;
  std::optional<History> history;  // none where the scalars are others
};

class CacheView {
 public:
  /// `prepared` is for `options`. Draws nothing before `after` is ready, if that is valid. Throws Error as opening the
  /// cache does.
  CacheView(const PreparedView& prepared, const ViewerOptions& options, Window& window, Reports& reports,
            FileDialog& dialog, std::shared_future<void> after = {});

  /// Shows the picture of the view that this one replaces until its own first one comes.
  void takePictureOf(CacheView& before);
  /// Does what the view before has not got to: saves the picture, copies the command, chooses and adds scalars.
  void takeRequestsOf(CacheView& before);
  /// Gives up what is OpenGL's, and says what will not be saved or copied. Then nothing but the destructor may be called,
  /// and that on any thread: it waits for what is being read and drawn.
  void releasePictures();
  /// Draws one frame with the effects of all input so far.
  void draw(const WindowLayout& layout);
  /// Whether a picture of a moving camera or of playback is being drawn, which takes no longer than options.target_s.
  bool expectsMovingPicture() const { return was_moving_ && !frames_failed_ && !isShown(); }
  /// Applies a command that is not the window's own.
  void run(Command command);
  void choose(const MenuChoice& choice);
  /// Shows another scalar, as soon as its function has been chosen from the data.
  void chooseScalar(const std::string& name);
  void showScalar(const std::string& name);
  /// An empty name: the opacities are of the same scalar.
  void chooseOpacityScalar(const std::string& name);
  /// Takes a scalar that was added for the opacities, faces or an isosurface; says if the cache that is shown does not have it.
  void useScalar(const WantedScalar& wanted);
  void use(const FileDialog::Chosen& chosen);
  void addTo(MenuFacts& facts);
  bool isEnabled(Command command) const;
  bool isChecked(Command command) const;
  /// Whether it has time steps, and so a bar for them.
  bool isSeries() const { return playback_.steps() > 1; }

  /// Seconds until the next frame is due without input.
  double wait() const;
  /// Saves the state and the film for the next time; those of a preview only if the user has changed them.
  void remember() const;

  /// The settings of this view that another view of the same grid takes over: all but those that name scalars which the
  /// other's cache does not have. nullptr if this is a preview that the user has left as it was.
  std::shared_ptr<const CarriedView> carriedTo(const PreparedView& next) const;
  bool isDark() const { return state_.dark; }
  const std::optional<Preview>& preview() const { return preview_; }
  const std::vector<std::filesystem::path>& gridFiles() const { return grid_files_; }
  /// A scalar that the cache lacks, once: one that hasElsewhere(), or one of the sources, to be added. `is_busy`: something is being
  /// opened or added; then it waits.
  std::optional<WantedScalar> takeWantedScalar(bool is_busy);
  /// The name of the scalar that is shown.
  const std::string& scalar() const { return state_.variable; }
  /// A movie that is to be drawn, once.
  std::optional<MovieRequest> takeWantedMovie() { return std::exchange(wanted_movie_, std::nullopt); }
  const std::vector<std::filesystem::path>& sources() const { return further_.files(); }
  const std::filesystem::path& wholePath() const { return cache_.wholePath(); }
  /// Begins the names of what is saved: as the solution of the grid that was opened, or as the cache.
  std::string name() const;
  /// Whether the whole cache has the scalar, with values at other samples than those of the shown cache.
  bool hasElsewhere(const std::string& scalar) const {
    return std::ranges::find(elsewhere_, scalar) != elsewhere_.end();
  }
  /// Whether its state can be that of a view of this cache: it shows the same one.
  bool isOf(const CacheReader& cache) const;

 private:
  static std::span<const CommandAction<CacheView>> actions();
  void toggle(bool& value);
  void goToStep(const std::function<bool(Playback&)>& move);
  void addPlaneTo(std::vector<ListedPlane>& planes);
  void saveMovieOf(MovieKind kind);
  void copyLater(MovieKind what) { copy_requested_ = what; }
  void moveCamera(Command command);
  Camera firstCamera() const;
  void lookAsAtFirst();
  void chooseForSheets();

  ViewState firstState(const PreparedView& prepared, const ViewerOptions& options) const;
  void setBounds();
  void takeFrame();
  void takeFunction();
  void reportDamage();
  /// A picture, once it is final; the empty name: the next number.
  void saveTo(const std::filesystem::path& file);
  void savePictureOf(const std::filesystem::path& file, ImageSize size);
  void addFaces(const std::string& name);
  void readSurface(const std::filesystem::path& file);
  void takeSurface();
  void colourFaces(const std::string& scalar);
  void findIsosurface(const std::string& scalar, std::optional<uint64_t> replaced = {});
  void takeIsosurfaces();
  void saveMovieTo(const FileDialog::Chosen& chosen);
  /// The user's choice for movies of a kind.
  struct MovieChoice {
    std::optional<ImageSize> size = std::nullopt;  // none: as shown
    double frames_per_s = kFramesPerSecond;
    uint64_t turn_frames = kTurnFrames;
  };
  MovieRequest newMovie(MovieKind kind, const MovieChoice& choice) const;
  MovieRequest heldMovie(MovieKind kind, const MovieChoice& choice) const;
  MovieRequest copiedMovie(MovieKind kind) const;
  MovieChoice movieChoice(MovieKind kind) const;
  void apply(const FilmActions& actions);
  void addKeyFrame(bool replaces);
  ViewState stateOfFilm() const;
  void showFilm(bool whole_function);
  void playFilm();
  void takeFilm(const Film& film);
  void openFilm(const std::filesystem::path& file);
  void rememberFilm() const;
  void drawFilmPictures();
  MovieRequest filmMovie(std::vector<double> times) const;
  std::optional<double> seriesTime() const;
  bool giveUpTint();
  bool raiseMemory(const TooLittleMemory& error);
  void giveUpSaving();
  void giveUpRequest();
  void startFrames(std::shared_future<void> after = {});
  void restartFrames();
  /// The window's picture has this size, in pixels.
  void fitTo(ImageSize size);
  double zoomForBars() const;
  void takeBars();
  double textSize() const;
  void react(const WindowLayout& layout);
  PanelActions drawPanels(const WindowLayout& layout);
  void apply(const PanelActions& actions);
  void ask(bool moving, bool only_final = false);
  void annotate();
  void showPicture(const WindowLayout& layout);
  void showPlanesAndMarkers(const WindowLayout& layout);
  void lookAlongPressedAxis(const WindowLayout& layout);
  void probe(const WindowLayout& layout);
  struct Click;
  bool isSeenAt(const Click& click) const;
  void drawStatus(const WindowLayout& layout);
  void keepHistory();
  void restore(const ViewState& state);
  void restore(const History::Entry* entry);
  void savePictureIfFinal();
  std::string timeOption(bool of_film) const;
  void copyCommand(MovieKind what);
  void saveView(const std::string& name);
  void loadView(const std::string& name);
  std::vector<std::string> otherScalars() const;
  FurtherScalars furtherScalars();
  /// The cache that is shown, or the one that it is a preview of: what states and views are kept for.
  const std::filesystem::path& whole() const { return preview_ ? preview_->whole : cache_.cachePath(); }
  bool isUntouchedPreview() const { return preview_ && toJson(state_) == first_state_; }
  std::optional<glm::dvec2> placeOf(const glm::dvec3& point, const WindowLayout& layout) const;
  bool isShown() const { return shown_ && shown_->request == request_; }
  /// Whether better pictures will follow. There is one picture of a moving camera, and the loop may have yet
  /// to notice that it has drawn it.
  bool isRefining() const { return frames_->busy() && !(was_moving_ && isShown()); }
  bool isFinal() const { return isShown() && shown_->is_final && !chooser_.busy(); }
  void say(const std::string& text, About about = About::kNothing) { reports_.say(text, about); }
  /// Describes what the picture that is shown lacks, for a sentence: ", without 3 damaged bricks"; empty if
  /// nothing.
  std::string lacks() const;
  const Manifest& manifest() const { return cache_.manifest(); }

  const CacheReader cache_;
  const double target_s_;
  const bool may_raise_memory_;  // nobody has limited it
  const FacesAtStep faces_at_;
  const std::vector<std::string> face_names_;  // that the list of surfaces offers
  const std::vector<std::string> elsewhere_;   // scalars that the whole cache has besides
  const std::optional<Preview> preview_;
  const std::vector<std::filesystem::path> grid_files_;  // that were opened, if the cache is kept for them
  Window& window_;
  Reports& reports_;
  FileDialog& dialog_;
  ViewState state_;
  const EditedFunction first_function_;
  const Camera first_camera_;  // PreparedView's
  const ImageSize first_size_;
  Camera
      left_camera_;  // the first view as the picture's size has it, by which one that nobody turned is known
  const std::string first_state_;  // as JSON; empty if it was another view's, which somebody had changed
  History history_;
  Panels panels_;
  PlaneHandles handles_;
  bool shows_frames_ = true;          // of clip planes, slices and the clip box
  std::set<std::string> not_tinted_;  // faces with which the picture could not be drawn
  std::string pointed_faces_;  // that are tinted, since the mouse points at them in a list; empty: none
  Playback playback_;
  Navigation navigation_;
  const Backend backend_;
  std::optional<FrameLoop> frames_;
  bool frames_failed_ = false;                       // the loop has ended
  std::set<std::pair<uint64_t, uint32_t>> damaged_;  // steps' bricks, of which the user has been told
  PictureTexture picture_, overlay_;
  std::vector<std::string> views_;
  FurtherScalarList further_;
  bool adds_scalar_ = false;  // one is being added
  std::optional<WantedScalar> wanted_scalar_;
  const bool encodes_movies_;
  MovieKind movie_kind_ = MovieKind::kOneTurn;      // for which a file is being chosen
  std::map<MovieKind, MovieChoice> movie_choices_;  // the last ones; the copied command is of the same movie
  std::optional<MovieRequest> wanted_movie_;

  FilmEdit film_;
  mutable std::shared_ptr<const Film> kept_film_;     // as its file has it
  std::map<uint64_t, PictureTexture> film_pictures_;  // by FilmEdit::Key::picture
  struct FilmPicturesJob;
  std::shared_ptr<FilmPicturesJob> film_job_;  // draws those that are missing

  bool changed_ = true;  // since the newest request
  uint64_t function_version_ = 1, request_ = 0;
  ImageSize picture_size_{0, 0}, data_size_{0, 0};  // of the newest request
  double fitted_width_ = 0;  // of the data's part of the picture, when the view was fitted to it
  std::optional<ShownFrame> shown_;
  std::optional<std::array<glm::dvec2, 3>> axis_names_;  // where they stand in that picture, in pixels
  double shown_strip_ = 0;                               // part of the picture that the scalar bars take
  uint64_t read_bytes_ = 0;                              // of OpenGL's pictures, all so far: for tests
  double shown_width_ = 1;  // part of the texture's width that is shown, in its middle
  bool was_moving_ = false, dragging_ = false, rests_ = false;
  std::optional<std::filesystem::path> save_to_;  // once the picture is final; empty: the next number
  std::optional<MovieKind> copy_requested_;       // the command for one of these

  std::optional<ShownValues> values_;
  PointProbe probe_;
  GlobeGrid globe_grid_;
  FunctionChooser chooser_;
  std::future<SurfaceFile> reading_surface_;  // that is to be added
  std::filesystem::path reading_file_;
  struct FoundIsosurface {
    Isosurface surface;
    std::optional<uint64_t> replaced;  // the id of the one that takes scalar and value; none: it is added
  };
  std::deque<std::future<FoundIsosurface>> finding_isosurfaces_;
  uint64_t values_asked_for_ = 0;  // request
  bool values_failed_ = false;     // of the newest request
  double pointed_since_s_ = 0;
  glm::dvec2 pointed_{-1.0};
  struct Click {
    glm::dvec2 pixel{0.0};  // of the picture; a marker is to come there
    Camera camera;          // that it was seen with
    ImageSize size;
    StepPosition at;
  };
  std::optional<Click> clicked_;
  std::optional<PointProbe::Question> marker_question_;
  std::string probed_;
};

}  // namespace curvisplat
