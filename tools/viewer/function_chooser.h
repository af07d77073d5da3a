// The function that the data suggest for a scalar, found on another thread, since it reads for 0.1 to 0.3 s: the newest
// question is answered, older ones are dropped. For the window's thread.
#pragma once

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

  enum class For { kScalar, kOpacities, kSameScalar };
  struct Question {
    For what = For::kScalar;
    std::string scalar;
  };
  struct Answer {
    Question question;
    EditedFunction function;
  };

  void ask(Question question);
  /// What was asked is not wanted any more.
  void drop();
  /// The answer, once. Throws what reading throws. Call it often.
  std::optional<Answer> take();
  bool busy() const { return wanted_; }

 private:
  void begin();

  const CacheReader& cache_;
  void (*const wake_)();
  bool wanted_ = false;           // an answer is to come
  std::optional<Question> next_;  // in place of the one that is being answered
  std::future<Answer> answering_;
};

}  // namespace curvisplat
