// The film that is made in the window, without a window: key frames of views, playing, and views of the film.
#include "tools/view/film_edit.h"

#include <gtest/gtest.h>

#include "tests/support/expect_error.h"
#include "tools/view/saved_views.h"

namespace curvisplat {
namespace {

ViewState view(double x = 3) {
  Manifest made;
  made.upper = {2, 1, 1};
  made.variables = {{0, "density", "kg/m3", 0.5, 3}, {1, "u", "", -1, 1}};
  ViewState state = firstViewOf(made, {300, 200});
  state.camera = {{x, 0, 2}, {1, 0.5, 0.5}, {0, 0, 1}, Projection::kOrthographic, 0.7, 30};
  return state;
}

std::vector<double> timesOf(const FilmEdit& film) {
  std::vector<double> times;
  for (const FilmEdit::Key& key : film.keys()) times.push_back(key.frame.time);
  return times;
}

using Times = std::vector<double>;

TEST(FilmEdit, KeyFramesAreAddedMovedAndRemoved) {
  FilmEdit film;
  EXPECT_EQ(film.film(), nullptr);
  film.add(view(3), {});
  film.add(view(4), {});
  film.add(view(5), {});
  EXPECT_EQ(timesOf(film), (Times{0, 2, 4}));
  EXPECT_EQ(film.selected(), 2u);
  EXPECT_EQ(film.frames(), 101u);
  film.goTo(0);
  film.add(view(6), {});  // half way to the next
  EXPECT_EQ(timesOf(film), (Times{0, 1, 2, 4}));
  EXPECT_EQ(film.selected(), 1u);
  film.goTo(3.5);
  EXPECT_FALSE(film.selected());
  film.add(view(7), {});  // where the film is
  EXPECT_EQ(timesOf(film), (Times{0, 1, 2, 3.5, 4}));
  film.move(1, 6);  // past others
  EXPECT_EQ(timesOf(film), (Times{0, 2, 3.5, 4, 6}));
  EXPECT_EQ(film.keys()[4].frame.camera.position.x, 6);
  EXPECT_EQ(film.selected(), 4u);
  film.move(4, 2.01);  // upon another one
  film.move(4, -1);
  EXPECT_EQ(timesOf(film), (Times{0, 2, 3.5, 4, 6}));
  film.remove();
  EXPECT_EQ(timesOf(film), (Times{0, 2, 3.5, 4}));
  EXPECT_EQ(film.selected(), 3u);
  const uint64_t picture = film.keys()[3].picture;
  film.replace(view(8), {});
  EXPECT_EQ(film.keys()[3].frame.camera.position.x, 8);
  EXPECT_NE(film.keys()[3].picture, picture);
  film.goTo(0);
  film.remove();
  EXPECT_EQ(timesOf(film), (Times{2, 3.5, 4}));
  EXPECT_EQ(film.frames(), 51u) << "from the first key frame on, in the window and in movies";
  film.goTo(4);
  film.play(100);
  EXPECT_EQ(film.time(), 2);
  film.stop();
  for (int n = 0; n < 3; ++n) film.remove();
  EXPECT_EQ(film.film(), nullptr);
  film.remove();
  EXPECT_EQ(film.time(), 0);
}

TEST(FilmEdit, AViewThatDoesNotSuitIsRefused) {
  FilmEdit film;
  film.add(view(), 1.5);
  ViewState other = view();
  other.camera.projection = Projection::kPerspective;
  expectError([&] { film.add(other, 1.5); }, {"the film: key frame 1", "perspective"});
  expectError([&] { film.add(view(), {}); }, {"series_time"});
  other = view();
  other.variable = "u";
  expectError([&] { film.add(other, 1.5); }, {"the film shows density"});
  EXPECT_EQ(film.keys().size(), 1u);
  EXPECT_EQ(film.film()->looks().size(), 1u);
}

TEST(FilmEdit, ViewsComeBackAndPlay) {
  ViewState first = view(3), last = view(5);
  first.function.setRange(1, 2);
  first.clip_planes = {{ClipPlane{{0, 0, 0}, {1, 0, 0}}}, {ClipPlane{{0, 0, 0}, {0, 1, 0}}, false}};
  last.function.setRange(2, 4);
  last.function.thinColours();
  last.function.setColour(1, {1, 0, 0});
  last.clip_planes = {{ClipPlane{{1, 0, 0}, {1, 0, 0}}}};
  last.clip_box = WorldBox{{0, 0, 0}, {1, 1, 1}};
  FilmEdit film;
  film.add(first, 0.5);
  film.add(last, 2.5);
  ViewState shown = first;
  show(*film.film(), 0, shown);
  EXPECT_EQ(toJson(shown), toJson(first));
  EXPECT_EQ(shown.function.map(), first.function.map());
  show(*film.film(), 1, shown);
  EXPECT_NEAR(shown.camera.position.x, 4, 1e-12);
  EXPECT_NEAR(shown.function.range().first, 1.5, 1e-12);
  EXPECT_NEAR(shown.function.range().second, 3, 1e-12);
  ASSERT_EQ(shown.clip_planes.size(), 2u);  // the hidden one stays
  EXPECT_EQ(shown.clip_planes[0].point.x, 0.5);
  EXPECT_FALSE(shown.clip_planes[1].visible);
  show(*film.film(), 2, shown);
  EXPECT_TRUE(shown.clip_box);

  Series series;
  for (const double time : {0.0, 1.0, 2.0, 3.0}) series.steps.push_back({time, 0, 0, 0, {}});
  EXPECT_EQ(positionOf(*film.film(), 1.2, series, true)->step, 1u);
  EXPECT_NEAR(positionOf(*film.film(), 1.2, series, true)->part, 0.7, 1e-12);
  EXPECT_EQ(positionOf(*film.film(), 1.2, series, false), StepPosition{2});

  EXPECT_FALSE(film.tick(10));
  film.play(10);  // at the end: from the beginning
  EXPECT_TRUE(film.tick(10.5));
  EXPECT_EQ(film.time(), 0.5);
  EXPECT_TRUE(film.tick(13));
  EXPECT_EQ(film.time(), 2);
  EXPECT_FALSE(film.isPlaying());
}

TEST(FilmEdit, OpensAPathOfCamerasWithTheViewThatIsShown) {
  Camera camera = view().camera;
  ViewState state = view();
  state.slices = {{ClipPlane{{0, 0, 0}, {1, 0, 0}}}};
  const Film path(CameraPath({{5, camera}, {8, camera}}, "a.json"), {{}, {}}, "", "a.json");
  FilmEdit film;
  film.open(path, state, 0.5);
  EXPECT_EQ(timesOf(film), (Times{0, 3}));
  EXPECT_EQ(film.keys()[1].frame.series_time, 0.5);
  EXPECT_EQ(film.keys()[1].look.slices->size(), 1u);
  EXPECT_EQ(film.keys()[0].look.parts->map, state.function.map());
  film.open(path, state, {});
  EXPECT_FALSE(film.keys()[0].frame.series_time);
}

/// The key frames move as ViewState::setVerticalScale() moves the camera that is shown.
TEST(FilmEdit, CamerasFollowTheVerticalScale) {
  FilmEdit film;
  film.add(view(3), {});
  film.add(view(5), {});
  const uint64_t picture = film.keys()[1].picture;
  ViewState state = view(5);
  state.setVerticalScale(20, std::nullopt);
  film.follow(state.scale);
  EXPECT_EQ(film.keys()[1].frame.camera.position, state.camera.position);
  EXPECT_EQ(film.film()->cameras().at(0).focal_point, glm::dvec3(1, 0.5, 10));
  EXPECT_EQ(film.film()->cameras().at(0).position, glm::dvec3(3, 0, 11.5));
  EXPECT_EQ(film.film()->scale(), glm::dvec3(1, 1, 20));
  EXPECT_NE(film.keys()[1].picture, picture);
  const auto same = film.film();
  film.follow(state.scale);
  EXPECT_EQ(film.film(), same);
  // A view of another scale moves the others, and so does the window that opens a film.
  film.goTo(1);
  film.add(view(7), {});
  EXPECT_EQ(film.keys()[0].frame.camera.position, glm::dvec3(3, 0, 2));
  FilmEdit opened;
  opened.open(*same, view(), {});
  EXPECT_EQ(opened.keys()[1].frame.camera.position, glm::dvec3(5, 0, 2));
  opened.follow(state.scale);
  EXPECT_EQ(opened.keys()[1].frame.camera.position, state.camera.position);
}

TEST(RenderCommand, OfAFilmLeavesOutWhatTheFilmStates) {
  ViewState state = view();
  state.clip_box = WorldBox{{0, 0, 0}, {1, 1, 1}};
  state.clip_planes = state.slices = {{ClipPlane{{0, 0, 0}, {1, 0, 0}}}};
  state.annotations = {};
  state.opacity_by = OpacityScalar{"u", EditedFunction("magma", 0, 1, 0.1)};
  CommandOptions options{"a.splats", {301, 200}, {}, {}};
  options.film = "a_film.json";
  options.film_frames = 51;
  EXPECT_EQ(renderCommand(state, options),
            "curvisplat render a.splats -o movie.mp4 --size 300x200 --scalar density --opacity-by u "
            "--opacity-range 0,1 --opacity-unit 0.1 --path a_film.json --frames 51");
  state.opacity_by.reset();
  EXPECT_EQ(renderCommand(state, options),
            "curvisplat render a.splats -o movie.mp4 --size 300x200 --scalar density --path a_film.json "
            "--frames 51");
}

}  // namespace
}  // namespace curvisplat
