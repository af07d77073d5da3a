// One cache in the window: its picture, the panels beside it, and what they change.
#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "stream/base/error.h"
#include "stream/cache/cache_reader.h"
#include "tools/viewer/file_dialog.h"
#include "tools/viewer/frame_loop.h"
#include "tools/viewer/further_scalar_list.h"
#include "tools/viewer/history.h"
#include "tools/viewer/menus.h"
#include "tools/viewer/navigation.h"
#include "tools/viewer/panels.h"
#include "tools/viewer/picture_texture.h"
#include "tools/viewer/plane_handles.h"
#include "tools/viewer/playback.h"
#include "tools/viewer/point_probe.h"
#include "tools/viewer/toasts.h"
#include "tools/viewer/viewer_options.h"
#include "tools/viewer/window.h"

namespace curvisplat {

/// Where things are in the window.
struct WindowLayout {
  Rectangle panels, picture, status;
  bool shows_panels = true;
};

/// What one view of a grid hands to the next: from a preview to the whole, or when a scalar was added.
struct CarriedView {
  ViewState state;
  History history;
};

class CacheView {
 public:
  /// `options.state`, `scalar` and `scene` are of this cache. Throws Error as reading the cache or the state does.
  CacheView(CacheReader cache, const ViewerOptions& options, Window& window, Toasts& toasts,
            FileDialog& dialog, const WindowLayout& layout);

  /// Draws one frame with the effects of all input so far.
  void draw(const WindowLayout& layout);
  /// Applies a command that is not the window's own.
  void run(Command command);
  void choose(const MenuChoice& choice);
  void take(const FileDialog::Chosen& chosen);
  void addTo(MenuFacts& facts);
  bool isEnabled(Command command) const;
  bool isChecked(Command command) const;

  /// Seconds until the next frame is due without input.
  double wait() const;
  /// Saves the state for the next time; that of a preview only if the user has changed it.
  void remember() const;

  /// For another view of the same grid. nullptr if this is a preview that the user has left as it was.
  std::shared_ptr<const CarriedView> carried() const;
  const std::optional<Preview>& preview() const { return preview_; }
  const std::vector<std::filesystem::path>& gridFiles() const { return grid_files_; }
  /// A scalar of the sources that is to be added to the cache, once. `is_busy`: one is being added.
  std::optional<std::string> takeWantedScalar(bool is_busy);
  const std::vector<std::filesystem::path>& sources() const { return further_.files(); }
  const std::filesystem::path& cachePath() const { return cache_.cachePath(); }

 private:
  ViewState openingState(const ViewerOptions& options, ImageSize picture);
  void takeScene(const SurfaceScene& scene, const ViewerOptions& options, ViewState& state) const;
  void takeFrame();
  void reportFrame(const Error& error);
  void restartFrames();
  void react(const WindowLayout& layout);
  void drawPanels(const WindowLayout& layout);
  void ask(bool moving);
  void annotate();
  void showPicture(const WindowLayout& layout);
  void showPlanesAndMarkers(const WindowLayout& layout);
  void probe(const WindowLayout& layout);
  void drawStatus(const WindowLayout& layout);
  void keepHistory();
  void restore(const ViewState* state);
  void savePictureIfFinal();
  void copyCommand(bool turns);
  void saveFunction(const std::filesystem::path& file);
  void saveView(const std::string& name);
  void loadView(const std::string& name);
  std::vector<std::string> otherScalars() const;
  /// The cache that is shown, or the one that it is a preview of: what states and views are kept for.
  const std::filesystem::path& whole() const { return preview_ ? preview_->whole : cache_.cachePath(); }
  bool isUntouchedPreview() const { return preview_ && toJson(state_) == first_state_; }
  std::optional<glm::dvec2> placeOf(const glm::dvec3& point, const WindowLayout& layout) const;
  bool isShown() const { return shown_ && shown_->request == request_; }
  bool isFinal() const { return isShown() && shown_->is_final; }
  void say(const std::string& text, bool is_error = false);
  const Manifest& manifest() const { return cache_.manifest(); }

  const CacheReader cache_;
  const std::optional<double> target_s_;
  const FacesAtStep faces_at_;
  const std::optional<Preview> preview_;
  const std::vector<std::filesystem::path> grid_files_;  // that were opened, if the cache is kept for them
  Window& window_;
  Toasts& toasts_;
  FileDialog& dialog_;
  ViewState state_;
  const EditedFunction first_function_;
  const std::string first_state_;
  History history_;
  Panels panels_;
  PlaneHandles handles_;
  Playback playback_;
  Navigation navigation_;
  const Backend backend_;
  std::optional<FrameLoop> frames_;
  bool frames_failed_ = false;  // the loop has ended
  std::string frame_error_;     // the last that was said, until a picture comes
  PictureTexture picture_, overlay_;
  std::vector<std::string> views_;
  FurtherScalarList further_;
  bool adds_scalar_ = false;  // one is being added
  std::optional<std::string> wanted_scalar_;

  bool changed_ = true;  // since the newest request
  uint64_t function_version_ = 1, request_ = 0;
  ImageSize picture_size_{0, 0}, data_size_{0, 0};  // of the newest request
  std::optional<ShownFrame> shown_;
  double shown_strip_ = 0;  // part of the picture that the scalar bars take
  bool was_moving_ = false, dragging_ = false, rests_ = false;
  std::optional<std::filesystem::path> save_to_;  // once the picture is final; empty: the next number
  bool copy_requested_ = false, copies_movie_ = false;

  std::optional<ShownValues> values_;
  PointProbe probe_;
  uint64_t values_asked_for_ = 0;  // request
  double pointed_since_s_ = 0;
  glm::dvec2 pointed_{-1.0};
  std::optional<glm::dvec2> clicked_;  // in pixels of the picture; a marker is to come there
  std::optional<PointProbe::Question> marker_question_;
  std::string probed_;
};

}  // namespace curvisplat
