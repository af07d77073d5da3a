// Undo and redo: the states of a view that were at rest, the newest last.
#pragma once

#include <optional>
#include <vector>

#include "tools/viewer/view_state.h"

namespace curvisplat {

class History {
 public:
  explicit History(const ViewState& first) : states_{first} {}

  /// A state at which the user rests: after a drag, not during it. One like the newest is not kept; one after an
  /// undo takes the place of what could be redone. The oldest of more than 200 are forgotten.
  void record(const ViewState& state);
  bool canUndo() const { return at_ > 0; }
  bool canRedo() const { return at_ + 1 < states_.size(); }
  /// The state before or after; nullptr if there is none. Valid until the next record().
  const ViewState* undo() { return canUndo() ? &states_[--at_] : nullptr; }
  const ViewState* redo() { return canRedo() ? &states_[++at_] : nullptr; }

 private:
  std::vector<ViewState> states_;
  size_t at_ = 0;
};

}  // namespace curvisplat
