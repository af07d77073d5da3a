// The function that the data suggest for a scalar, found on another thread, since it reads for 0.1 to 0.3 s. What is asked
// for one purpose takes the place of what was asked for it before; questions for different purposes are all answered. For
// the window's thread.
#pragma once

#include <array>
#include <future>
#include <optional>
#include <string>

#include "stream/cache/cache_reader.h"
#include "tools/viewer/edited_function.h"

namespace curvisplat {

class FunctionChooser {
 public:
  /// Calls `wake` when an answer has come. `cache` must outlive it.
  FunctionChooser(const CacheReader& cache, void (*wake)()) : cache_(cache), wake_(wake) {}

  enum class For { kScalar, kOpacities, kSameScalar, kFaces };
  struct Question {
    For what = For::kScalar;
    std::string scalar;
    bool operator==(const Question&) const = default;
  };
  struct Answer {
    Question question;
    EditedFunction function;
  };

  void ask(const Question& question);
  /// Asks what another has not answered yet, of a cache that may be another one of the same grid. It is dropped there.
  void takeQuestionsOf(FunctionChooser& other);
  /// What was asked is not wanted any more: all of it, or what was asked for this.
  void drop();
  void drop(For what) { wanted(what).reset(); }
  /// An answer, once. Throws what reading throws, which ends this question only. Call it often.
  std::optional<Answer> take();
  bool busy() const;

 private:
  std::optional<std::string>& wanted(For what) { return wanted_[static_cast<size_t>(what)]; }
  bool isWanted(const Question& question) { return wanted(question.what) == question.scalar; }
  void beginNext();

  const CacheReader& cache_;
  void (*const wake_)();
  std::array<std::optional<std::string>, 4>
      wanted_;         // for each purpose, the scalar of the answer that is to come
  Question question_;  // that is being answered
  std::future<EditedFunction> answering_;
};

}  // namespace curvisplat
