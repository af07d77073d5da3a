#!/usr/bin/env python3
"""Checks that Linux's own calls stay in the files that a portable build leaves out (CURVISPLAT_PORTABLE=ON).

    check_portable.py [ROOT]    prints one line for each fault; exit status 1 if there is one

  call   sources of stream/, preprocess/, render/ and tools/ name nothing that Linux or glibc alone has
  twin   each file that may has NAME_left_out.cpp, and CMakeLists.txt leaves it out
"""
import pathlib
import re
import sys

FOLDERS = ("stream", "preprocess", "render", "tools")
TWINS = ("stream/base/os", "stream/paging/uring_reads", "tools/commands/folder_events", "tools/early_start")
HEADERS = (r"liburing\.h|linux/.*|malloc\.h|link\.h|elf\.h|features\.h|error\.h|execinfo\.h|byteswap\.h|endian\.h|sched\.h|sys/(?:auxv|epoll|eventfd|fanotify|"
           r"inotify|prctl|random|sendfile|signalfd|statfs|syscall|sysinfo|sysmacros|timerfd|vfs|xattr)\.h")
NAMES = (r"O_(?:DIRECT|TMPFILE|NOATIME|PATH)|io_uring_\w+|fallocate|posix_fallocate|posix_fadvise|POSIX_FADV_\w+|renameat2|RENAME_\w+|memfd_create|MFD_\w+|"
         r"MADV_\w+|madvise|mincore|mremap|MAP_(?:POPULATE|HUGETLB|FIXED_NOREPLACE)|mallopt|mallinfo2?|malloc_trim|malloc_usable_size|prctl|PR_SET_\w+|gettid|"
         r"syscall|pthread_\w+_np|sched_[gs]etaffinity|CPU_SET|getrandom|statx|statfs|sync_file_range|syncfs|copy_file_range|splice|sendfile|"
         r"inotify_\w+|epoll_\w+|eventfd|signalfd|timerfd_\w+|SOCK_(?:CLOEXEC|NONBLOCK)|MSG_NOSIGNAL|accept4|pipe2|dup3|RTLD_DEEPBIND|dlmopen|"
         r"CLOCK_(?:BOOTTIME|MONOTONIC_RAW|MONOTONIC_COARSE)|setpriority|program_invocation_\w+|secure_getenv|execvpe|get_nprocs|sysinfo|preinit_array|"
         r"fopencookie|open_memstream|qsort_r|strchrnul|mempcpy|strerrorname_np|canonicalize_file_name")
INCLUDE = re.compile(rf"^\s*#\s*include\s*<({HEADERS})>")
NAME = re.compile(rf"(?<![\w.>])({NAMES})\b")
PROC = re.compile(r'"[^"]*(/proc/|/sys/)')
COMMENT = re.compile(r'//[^\n]*|/\*.*?\*/', re.S)
STRING = re.compile(r'R"(\w*)\(.*?\)\1"|"(?:\\.|[^"\\\n])*"', re.S)


def blank(match):
    return re.sub(r"[^\n]", " ", match.group())


def faults_in(text):
    """Pairs of a line's number and what it names."""
    text = COMMENT.sub(blank, text)
    for number, (line, code) in enumerate(zip(text.split("\n"), STRING.sub(blank, text).split("\n")), 1):
        found = INCLUDE.search(line) or PROC.search(line) or NAME.search(code)
        if found:
            yield number, found.group(1)


def faults(root):
    allowed = {f"{twin}{end}" for twin in TWINS for end in (".cpp", "_left_out.cpp")}
    for folder in FOLDERS:
        for file in sorted((root / folder).rglob("*")):
            path = file.relative_to(root).as_posix()
            if file.suffix in (".h", ".cpp") and path not in allowed:
                for number, name in faults_in(file.read_text()):
                    yield f"{path}:{number}: {name} is Linux's alone; ask stream/base/os.h for it"
    left_out = re.search(r"set\(curvisplat_linux_alone ([^)]*)\)", (root / "CMakeLists.txt").read_text())
    names = set(left_out.group(1).split()) if left_out else set()
    for twin in TWINS:
        if not (root / f"{twin}_left_out.cpp").is_file():
            yield f"{twin}.cpp has no twin {twin}_left_out.cpp"
        if pathlib.PurePath(twin).name not in names:
            yield f"CMakeLists.txt does not leave out {twin}.cpp"
    for twin in TWINS:
        for number, name in faults_in((root / f"{twin}_left_out.cpp").read_text()) if (root / f"{twin}_left_out.cpp").is_file() else ():
            if name != "MSG_NOSIGNAL":  # POSIX, but macOS has its own way
                yield f"{twin}_left_out.cpp:{number}: {name} is Linux's alone"


def main():
    root = pathlib.Path(sys.argv[1]) if len(sys.argv) > 1 else pathlib.Path(__file__).resolve().parents[2]
    found = list(faults(root))
    print(*found, f"{len(found)} faults", sep="\n")
    return 1 if found else 0


if __name__ == "__main__":
    sys.exit(main())
