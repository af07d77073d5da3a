// The numbers in Tecplot's text files: 1.5, 3*1.5 (three of them), 1,2,3, and comments between them.
#pragma once

#include <cstdint>
#include <memory>
#include <string_view>

#include "preprocess/formats/common/file_index.h"
#include "preprocess/formats/common/spool_file.h"
#include "preprocess/formats/common/text_reader.h"

namespace curvisplat {

/// Whether a word begins like a number; nan and inf do.
bool beginsTecplotNumber(std::string_view word);

/// Passes over the numbers at the reader's position. Throws Error if they are more than a grid can have.
FilePart countTecplotNumbers(TextReader& text);

/// Writes `count` doubles, the numbers from byte `begin`, to `sink`. Throws Error where there is no number.
void spoolTecplotNumbers(const std::shared_ptr<const PooledFile>& file, uint64_t begin, uint64_t count,
                         const SpoolFile::Sink& sink);

}  // namespace curvisplat
