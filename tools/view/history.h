// Undo and redo: the states of a view that were at rest, each with the film that was made of it, the newest last. A value type:
// one thread at a time may use an object.
#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <vector>

#include "tools/view/film_edit.h"
#include "tools/view/view_state.h"

namespace curvisplat {

class History {
 public:
  struct Entry {
    ViewState state;
    std::shared_ptr<const FilmEdit>
        film;  // never null; that of the entry before, if it has the same key frames
  };

  History(const ViewState& first, const FilmEdit& film);

  /// Keeps a state at which the user rests: after a drag, not during it. What is equal to the newest is not
  /// kept; a state after an undo replaces what could be redone. The oldest of more than 200 are forgotten.
  void record(const ViewState& state, const FilmEdit& film);
  /// Raises the memory of all states, since a limit that was raised for a picture is no step of the user's.
  void raiseMemory(uint64_t bytes);
  bool canUndo() const { return at_ > 0; }
  bool canRedo() const { return at_ + 1 < entries_.size(); }
  /// The entry before or after; nullptr if there is none. Valid until the next record().
  const Entry* undo() { return canUndo() ? &entries_[--at_] : nullptr; }
  const Entry* redo() { return canRedo() ? &entries_[++at_] : nullptr; }

 private:
  std::vector<Entry> entries_;
  size_t at_ = 0;
};

}  // namespace curvisplat
