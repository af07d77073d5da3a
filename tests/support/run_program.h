// Runs the real curvisplat program, as a person at a terminal would, and keeps what it printed: to its end,
// on its way, or as several ranks that mpirun starts.
#pragma once

#include <sys/types.h>

#include <memory>
#include <string>
#include <vector>

namespace curvisplat {

struct ProgramResult {
  int status = -1;  // the exit status; 128 + the signal's number if one ended it, as in a shell
  std::string out, err;
};

/// Runs CURVISPLAT_PROGRAM with `arguments` (no shell in between) and waits for its end. Its standard input
/// is empty and its output and error are pipes, so that it draws no progress bar. It is a fork of a process that has the program's
/// libraries (programs/run_by_fork.cpp), which takes a third of the time, unless CURVISPLAT_START is in the environment.
ProgramResult runProgram(const std::vector<std::string>& arguments);

/// The file of a program that the shell would find by this name, on the path; "" if there is none.
std::string pathOf(const std::string& name);

/// A program on its way, found on the path unless its name has a slash; one that no one waited for is killed.
class RunningProgram {
 public:
  explicit RunningProgram(const std::vector<std::string>& arguments,
                          const std::string& program = CURVISPLAT_PROGRAM);
  ~RunningProgram();
  RunningProgram(const RunningProgram&) = delete;
  RunningProgram& operator=(const RunningProgram&) = delete;

  void signal(int number) const;
  pid_t process() const { return child_; }
  /// Waits for the end of the program and returns what it said. Call it once.
  ProgramResult wait();

 private:
  struct Pipes;
  std::unique_ptr<Pipes> pipes_;
  pid_t child_ = -1;
};

/// The number of lines in `text`; an unfinished last line counts.
int lineCount(const std::string& text);

/// "", or why the program cannot be started as several ranks here: tests skip with it.
std::string whyNoRanks();

/// Runs CURVISPLAT_PROGRAM as `count` ranks and waits for them. mpirun's own explanations are left out.
ProgramResult runAsRanks(unsigned count, const std::vector<std::string>& arguments,
                         const std::string& program = CURVISPLAT_PROGRAM);

}  // namespace curvisplat
