// Chooses what is shown before the user chooses anything: the function and the view that `render` chooses
// from the data. Choosing a function reads a coarse level of the cache, for 0.1 to 0.3 s: FunctionChooser
// does so on another thread, and the other functions on the caller's. They keep no state: any thread may call
// them. A FunctionChooser is for the window's thread.
#pragma once

#include <array>
#include <future>
#include <optional>
#include <string>
#include <vector>

#include "stream/cache/cache_reader.h"
#include "tools/view/edited_function.h"
#include "tools/view/view_state.h"

namespace curvisplat {

/// The initial state of a window with a picture of this size. `scalar`: a name, or empty for the first that
/// varies. Throws UsageError if there is no such scalar, and Error as reading does.
ViewState firstViewOf(const CacheReader& cache, const std::string& scalar, ImageSize picture);

/// The function that is chosen from the data for a scalar. `with_sheets`: as FirstChoice::function() has it.
EditedFunction automaticFunction(const CacheReader& cache, const std::string& scalar, bool with_sheets);

/// The scalar that divides what a function shows into halves, or has a `share` of it below: of the volume, each part times its
/// opacity. Where all is transparent it divides the volume, and without any volume the range. `histogram`: as of histogramOf().
double middleOfSeen(const std::vector<double>& histogram, const EditedFunction& function, double share = 0.5);

/// The value at which an isosurface of a scalar begins: middleOfSeen() of the opacities that the state has for it, or of its
/// volume; where the state has an isosurface there, with another share. Reads the scalar's histogram at the cache's step. Throws
/// UsageError if there is no such scalar, and Error as reading does.
double firstIsovalue(const CacheReader& cache, const ViewState& state, const std::string& scalar);

/// The function of another scalar, after `before`: the automatic one, with its opacities and their unit, which those of the
/// scalar before do not suit. A colour map that the user has chosen stays.
EditedFunction chosenAnew(const EditedFunction& before, EditedFunction automatic);

/// Selects another scalar, whose function is chosen anew. Throws UsageError that lists the scalars if there is none of this
/// name.
void chooseVariable(ViewState& state, const CacheReader& cache, const std::string& name);

/// Finds automatic functions on another thread. A question for one purpose replaces the one before for the
/// same purpose; questions for different purposes are all answered.
class FunctionChooser {
 public:
  /// Calls `wake` when an answer has come. `cache` must outlive it.
  FunctionChooser(const CacheReader& cache, void (*wake)()) : cache_(cache), wake_(wake) {}

  /// kSameColours: for the scalar that is shown; a colour map that the user has chosen stays.
  enum class For { kScalar, kOpacities, kSameScalar, kSameColours, kFaces };
  static constexpr size_t kPurposes = 5;
  struct Question {
    For what = For::kScalar;
    std::string scalar;
    bool with_sheets = false;  // FirstChoice::function()'s
    bool operator==(const Question&) const = default;
  };
  struct Answer {
    Question question;
    EditedFunction function;
  };

  void ask(const Question& question);
  /// Takes over the questions that `other` has not answered yet; its cache may be another one of the same
  /// grid.
  void takeQuestionsOf(FunctionChooser& other);
  /// Drops all questions, or the one for this purpose.
  void drop();
  void drop(For what) { wanted(what).reset(); }
  /// Each answer, once. Throws what reading throws, which ends this question only. Call it often: it also
  /// begins the next question.
  std::optional<Answer> poll();
  bool busy() const;

 private:
  std::optional<Question>& wanted(For what) { return wanted_[static_cast<size_t>(what)]; }
  void beginNext();

  const CacheReader& cache_;
  void (*const wake_)();
  std::array<std::optional<Question>, kPurposes> wanted_;  // for each purpose, whose answer is to come
  Question question_;                                      // that is being answered
  std::future<EditedFunction> answering_;
};

}  // namespace curvisplat
