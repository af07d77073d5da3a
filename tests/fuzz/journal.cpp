// The journal of an unfinished conversion; its checksum is made right here.
#include "preprocess/convert/conversion_journal.h"
#include "stream/base/check.h"

#include "stream/base/checksum.h"
#include "tests/fuzz/fuzz_target.h"

namespace curvisplat {
namespace {

void fuzzJournal(std::span<const std::byte> bytes) {
  std::string text(textOf(bytes));
  std::erase(text, '\n');
  text += "\n";
  text += fmt::format("{:016x}\n", checksumOf(std::as_bytes(std::span(text))));
  fuzzFile(kJournalName, std::as_bytes(std::span(text)));
  const std::optional<ConversionJournal> journal = readJournal(fuzzFolder());
  if (!journal || !journal->splats) return;
  const BucketTree& tree = journal->splats->tree;
  for (const uint32_t leaf : tree.leavesBelow(0)) CURVISPLAT_CHECK_OP(tree.nodeOf(tree[leaf].cell), ==, leaf);
  for (const uint64_t at : {uint64_t{0}, uint64_t{1} << 47, (uint64_t{1} << 48) - 1})
    CURVISPLAT_CHECK_OP(tree.leafOf({{at, at / 2, at / 3}}), <, tree.size());
}

const RegisteredFuzzTarget journal_target("journal", fuzzJournal);

}  // namespace
}  // namespace curvisplat
