#include "preprocess/addition/addition_workspace.h"

#include <system_error>

#include "preprocess/addition/addition_checks.h"
#include "preprocess/convert/shared_folder.h"
#include "stream/base/file.h"

namespace curvisplat {

AdditionWorkspace::AdditionWorkspace(const std::filesystem::path& cache,
                                     const std::filesystem::path& temporary_folder, Ranks* ranks) {
  if (!ranks || ranks->isFirst()) {
    lock_.emplace(cache);
    folder_ =
        std::make_unique<ScratchFolder>(newScratch(cache, temporary_folder), ScratchFolder::Folder::kMake);
    shared_ = own_ = folder_->path();
  }
  if (!ranks) return;
  shared_ = sharedFolder(shared_, *ranks);
  own_ = makeFolderOfRank(shared_, ranks->rank());
}

AdditionWorkspace::~AdditionWorkspace() {
  if (folder_) return;
  removeAll(own_);
  // If rank 0 has failed, it could not remove a folder in which others still wrote: the last one does.
  std::error_code not_empty;
  std::filesystem::remove(shared_, not_empty);
}

}  // namespace curvisplat
