// The ranks that mpirun or srun has started this program as.
//
//   alone     no launcher, or one process: MPI is neither loaded nor started
//   of many   the plug-in curvisplat-mpi.so beside the program, or in lib/curvisplat, starts MPI
//
// A rank that fails prints one line and ends the others. Ranks that fail of the same cause, a wrong option for
// example, leave the line to the first of them.
#pragma once

#include <string>

#include "stream/base/progress.h"
#include "stream/base/ranks.h"

namespace CLI {
class App;
}

namespace curvisplat {

/// Starts them at the first call. Only for commands that share their work; the others are run by each process.
/// Throws Error if there are several and this build has no MPI.
Ranks& launchedRanks();

/// Throws UsageError at a rank that was started with another command, other options or other environment variables of
/// this program than rank 0, or that is another version of it: together they would make what none of them was asked
/// for. Options for one machine may differ: names of files that are read, --tmp, --threads, --stats and --trace.
void requireSameOptions(const CLI::App& command);

/// Throws Error at a rank that finds another number of time steps in its files than rank 0. All ranks call it.
void requireSameSteps(uint64_t steps);

/// Makes calls of the ranks throw Interrupted after progress.stop(), until the end of the scope.
class StopRanksWith {
 public:
  StopRanksWith(Ranks& ranks, const Progress& progress);
  ~StopRanksWith();
  StopRanksWith(const StopRanksWith&) = delete;
  StopRanksWith& operator=(const StopRanksWith&) = delete;

 private:
  Ranks& ranks_;
};

/// Prints the line of a command that has failed with `status` where several ranks were started, unless
/// another rank does, and ends all ranks. Returns if there is one rank, or none was started; then the caller
/// prints.
void endRanksAfter(const std::string& line, int status);

/// Prints what concerns this rank alone, whichever it is: with its number where there are several.
void printMessageOfRank(const std::string& text);

/// Ends the ranks in good order, if some were started.
void finishRanks();

}  // namespace curvisplat
