#include "tests/support/run_program.h"

#include <fcntl.h>
#include <poll.h>
#include <signal.h>
#include <spawn.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <cstdlib>
#include <filesystem>
#include <system_error>

extern char** environ;

namespace curvisplat {
namespace {

void require(bool condition, int error, const char* what) {
  if (!condition) throw std::system_error(error, std::generic_category(), what);
}

struct Pipe {
  int read_end = -1, write_end = -1;

  Pipe() {
    int ends[2];
    require(pipe2(ends, O_CLOEXEC) == 0, errno, "pipe2");
    read_end = ends[0];
    write_end = ends[1];
  }
  ~Pipe() {
    closeEnd(read_end);
    closeEnd(write_end);
  }
  Pipe(const Pipe&) = delete;
  Pipe& operator=(const Pipe&) = delete;

  static void closeEnd(int& end) {
    if (end >= 0) close(end);
    end = -1;
  }
};

// Reads both pipes to their ends, whichever has something, so that the program never waits on a full one.
void drain(Pipe& out, std::string& out_text, Pipe& err, std::string& err_text) {
  std::array<Pipe*, 2> pipes{&out, &err};
  std::array<std::string*, 2> texts{&out_text, &err_text};
  while (out.read_end >= 0 || err.read_end >= 0) {
    std::array<pollfd, 2> waiting{{{out.read_end, POLLIN, 0}, {err.read_end, POLLIN, 0}}};
    if (poll(waiting.data(), waiting.size(), -1) < 0) {
      require(errno == EINTR, errno, "poll");
      continue;
    }
    for (size_t n = 0; n < 2; ++n) {
      if (waiting[n].revents == 0) continue;
      std::array<char, 4096> buffer;
      const ssize_t got = read(pipes[n]->read_end, buffer.data(), buffer.size());
      if (got > 0)
        texts[n]->append(buffer.data(), static_cast<size_t>(got));
      else if (got == 0 || errno != EINTR)
        Pipe::closeEnd(pipes[n]->read_end);
    }
  }
}

const std::string& mpirun() {
  static const std::string found = pathOf("mpirun");
  return found;
}

}  // namespace

std::string pathOf(const std::string& name) {
  const std::string path = std::getenv("PATH") ? std::getenv("PATH") : "";
  for (size_t begin = 0; begin <= path.size();) {
    const size_t end = std::min(path.find(':', begin), path.size());
    const std::string candidate = path.substr(begin, end - begin) + "/" + name;
    if (::access(candidate.c_str(), X_OK) == 0) return candidate;
    begin = end + 1;
  }
  return {};
}

struct RunningProgram::Pipes {
  Pipe out, err;
};

RunningProgram::RunningProgram(const std::vector<std::string>& arguments, const std::string& program)
    : pipes_(std::make_unique<Pipes>()) {
  std::vector<std::string> words{program};
  words.insert(words.end(), arguments.begin(), arguments.end());
  std::vector<char*> argv;
  for (std::string& word : words) argv.push_back(word.data());
  argv.push_back(nullptr);

  Pipe &out = pipes_->out, &err = pipes_->err;
  posix_spawn_file_actions_t actions;
  posix_spawn_file_actions_init(&actions);
  posix_spawn_file_actions_addopen(&actions, STDIN_FILENO, "/dev/null", O_RDONLY, 0);
  posix_spawn_file_actions_adddup2(&actions, out.write_end, STDOUT_FILENO);
  posix_spawn_file_actions_adddup2(&actions, err.write_end, STDERR_FILENO);
  // A shell's background jobs ignore SIGINT, those of nohup SIGHUP, and what they start would, too.
  posix_spawnattr_t attributes;
  posix_spawnattr_init(&attributes);
  sigset_t answered;
  sigemptyset(&answered);
  sigaddset(&answered, SIGINT);
  sigaddset(&answered, SIGHUP);
  posix_spawnattr_setsigdefault(&attributes, &answered);
  posix_spawnattr_setflags(&attributes, POSIX_SPAWN_SETSIGDEF);
  const int failed = posix_spawnp(&child_, program.c_str(), &actions, &attributes, argv.data(), environ);
  posix_spawnattr_destroy(&attributes);
  posix_spawn_file_actions_destroy(&actions);
  require(failed == 0, failed, program.c_str());
  Pipe::closeEnd(out.write_end);
  Pipe::closeEnd(err.write_end);
}

RunningProgram::~RunningProgram() {
  if (child_ < 0) return;
  kill(child_, SIGKILL);
  waitpid(child_, nullptr, 0);
}

void RunningProgram::signal(int number) const {
  require(child_ > 0, ESRCH, "kill");  // -1 would be everyone
  require(kill(child_, number) == 0, errno, "kill");
}

ProgramResult RunningProgram::wait() {
  ProgramResult result;
  drain(pipes_->out, result.out, pipes_->err, result.err);
  int status = 0;
  while (waitpid(child_, &status, 0) < 0) require(errno == EINTR, errno, "waitpid");
  child_ = -1;
  result.status = WIFEXITED(status) ? WEXITSTATUS(status) : 128 + WTERMSIG(status);
  return result;
}

ProgramResult runProgram(const std::vector<std::string>& arguments) {
  return RunningProgram(arguments, CURVISPLAT_PROGRAM_BY_FORK).wait();
}

int lineCount(const std::string& text) {
  const auto ends = std::count(text.begin(), text.end(), '\n');
  return static_cast<int>(ends) + (!text.empty() && text.back() != '\n');
}

std::string whyNoRanks() {
  if (mpirun().empty()) return "mpirun is not in PATH (Debian: openmpi-bin)";
  const auto plug_in = std::filesystem::path(CURVISPLAT_PROGRAM).parent_path() / "curvisplat-mpi.so";
  if (!std::filesystem::exists(plug_in)) return "built without MPI (CMake's option CURVISPLAT_MPI)";
  return "";
}

ProgramResult runAsRanks(unsigned count, const std::vector<std::string>& arguments,
                         const std::string& program) {
  std::vector<std::string> words{
      "--oversubscribe", "--allow-run-as-root", "-q", "-n", std::to_string(count), program};
  words.insert(words.end(), arguments.begin(), arguments.end());
  return RunningProgram(words, mpirun()).wait();
}

}  // namespace curvisplat
