#include "tools/viewer/function_chooser.h"

#include <algorithm>
#include <chrono>
#include <utility>

#include "stream/base/thread_name.h"
#include "tools/viewer/first_view.h"

namespace curvisplat {

void FunctionChooser::ask(const Question& question) {
  wanted(question.what) = question.scalar;
  if (!answering_.valid()) beginNext();
}

void FunctionChooser::takeQuestionsOf(FunctionChooser& other) {
  for (size_t what = 0; what < wanted_.size(); ++what)
    if (const auto scalar = std::exchange(other.wanted_[what], std::nullopt))
      ask({static_cast<For>(what), *scalar});
}

void FunctionChooser::drop() {
  wanted_ = {};
}

bool FunctionChooser::busy() const {
  return std::ranges::any_of(wanted_, [](const auto& scalar) { return scalar.has_value(); });
}

void FunctionChooser::beginNext() {
  const auto next = std::ranges::find_if(wanted_, [](const auto& scalar) { return scalar.has_value(); });
  if (next == wanted_.end()) return;
  question_ = {static_cast<For>(next - wanted_.begin()), **next};
  try {
    answering_ = std::async(std::launch::async, [&cache = cache_, wake = wake_, scalar = question_.scalar] {
      nameThisThread("function");
      struct Wake {
        void (*call)();
        ~Wake() { call(); }
      } const at_the_end{wake};
      return automaticFunction(cache, scalar);
    });
  } catch (...) {  // there is no thread to be had
    next->reset();
    throw;
  }
}

std::optional<FunctionChooser::Answer> FunctionChooser::take() {
  if (answering_.valid() ? answering_.wait_for(std::chrono::seconds(0)) != std::future_status::ready
                         : !busy())
    return std::nullopt;
  std::future<EditedFunction> answered = std::move(answering_);
  const Question question = question_;
  const bool is_wanted = answered.valid() && isWanted(question);
  if (is_wanted) drop(question.what);
  beginNext();
  if (!is_wanted) return std::nullopt;
  return Answer{question, answered.get()};
}

}  // namespace curvisplat
