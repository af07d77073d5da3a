#!/usr/bin/env python3
"""Checks who includes whom, in the sources alone: nothing is built.

    check_includes.py [ROOT]    prints one line for each fault; exit status 1 if there is one

  file    every #include "..." is a path from the root that exists; <...> names no file of ours
  cycle   there is none between components (a component is NAME.h and NAME.cpp), and none between rooms,
          in what they include and in what they link
  folder  tools -> {preprocess, render} -> stream; only tests/ and bench/ include tests/, nothing includes bench/
  room    a room includes what its curvisplat_room() links: a header what is PUBLIC, a source also what is PRIVATE
  table   the README of a folder of rooms lists each, after those that it includes
"""
import dataclasses
import pathlib
import re
import sys

# What the files of a folder may include, beside the folder itself.
FOLDERS = {
    "stream": set(),
    "preprocess": {"stream"},
    "render": {"stream"},
    "tools": {"stream", "preprocess", "render"},
    "tests": {"stream", "preprocess", "render", "tools"},
    "bench": {"stream", "preprocess", "render", "tools", "tests"},
}
# Parts of one program, which CMake does not keep apart: what each may include of the others.
PROGRAM_ROOMS = {
    "tools/output": set(),
    "tools/mpi": set(),
    "tools/vdb": set(),
    "tools/options": {"tools/output"},
    "tools/commands": {"tools/output", "tools/options", "tools/serve", "tools/throughput", "tools/view", "tools/viewer",
                       "tools/window"},
    "tools/python": {"tools/output", "tools/options", "tools/view"},
    "tools": {"tools/output", "tools/options", "tools/commands"},
}

INCLUDE = re.compile(r'^\s*#\s*include\s*(?:"([^"]+)"|<([^>]+)>)')
ROOM = re.compile(r"curvisplat_room\(\s*(\w+)([^)]*)\)")


@dataclasses.dataclass
class Include:
    file: str  # by its path from the root, as all of them
    line: int
    included: str


@dataclasses.dataclass
class Room:
    folder: str
    public: list  # the names of the rooms that it links
    private: list


def folder_of(path):
    return path.rpartition("/")[0]


def component_of(path):
    return re.sub(r"(-inl)?\.(h|cpp)$", "", path)


def read_rooms(root):
    """All rooms by name, from the CMakeLists.txt in their folders."""
    rooms = {}
    for top in FOLDERS:
        for lists in sorted((root / top).rglob("CMakeLists.txt")):
            for name, links in ROOM.findall(re.sub(r"#.*", "", lists.read_text())):
                kinds = {"PUBLIC": [], "PRIVATE": []}
                kind = None
                for word in links.split():
                    if word in kinds:
                        kind = kinds[word]
                    elif word.startswith("curvisplat::"):
                        kind.append(word.removeprefix("curvisplat::"))
                rooms[name] = Room(lists.parent.relative_to(root).as_posix(), **{k.lower(): v for k, v in kinds.items()})
    # curvisplat::stream and its like are all rooms in the folder.
    for folder in ("stream", "preprocess", "render"):
        inside = [name for name, room in rooms.items() if room.folder.startswith(folder + "/")]
        rooms[folder] = Room(folder, inside, [])
    return rooms


def read_includes(root):
    """The includes of project files, and the faults in how they are written."""
    includes, faults = [], []
    for top in FOLDERS:
        for path in sorted((root / top).rglob("*")):
            if path.suffix not in (".h", ".cpp"):
                continue
            file = path.relative_to(root).as_posix()
            for number, line in enumerate(path.read_text().splitlines(), 1):
                match = INCLUDE.match(line)
                if not match:
                    continue
                quoted, bracketed = match.groups()
                if bracketed and (root / bracketed).is_file():
                    faults.append(f'{file}:{number}: <{bracketed}> is a file of ours; include it as "{bracketed}"')
                elif quoted and (".." in quoted.split("/") or not (root / quoted).is_file()):
                    faults.append(f'{file}:{number}: "{quoted}" is not the path of a file from the root')
                elif quoted:
                    includes.append(Include(file, number, quoted))
    return includes, faults


def strongly_connected(graph):
    """The cycles of a graph (node -> nodes): its strongly connected components of more than one node. Tarjan's
    algorithm, without recursion."""
    index, low, stack, on_stack, cycles = {}, {}, [], set(), []
    for start in sorted(graph):
        if start in index:
            continue
        work = [(start, iter(sorted(graph.get(start, ()))))]
        index[start] = low[start] = len(index)
        stack.append(start)
        on_stack.add(start)
        while work:
            node, following = work[-1]
            for other in following:
                if other not in index:
                    index[other] = low[other] = len(index)
                    stack.append(other)
                    on_stack.add(other)
                    work.append((other, iter(sorted(graph.get(other, ())))))
                    break
                if other in on_stack:
                    low[node] = min(low[node], index[other])
            else:
                work.pop()
                if work:
                    low[work[-1][0]] = min(low[work[-1][0]], low[node])
                if low[node] == index[node]:
                    cycle = []
                    while not cycle or cycle[-1] != node:
                        cycle.append(stack.pop())
                        on_stack.discard(cycle[-1])
                    if len(cycle) > 1:
                        cycles.append(sorted(cycle))
    return cycles


def cycle_faults(includes, unit_of, what):
    graph, edges = {}, {}
    for include in includes:
        a, b = unit_of(include.file), unit_of(include.included)
        if a != b:
            graph.setdefault(a, set()).add(b)
            edges.setdefault((a, b), include)
    faults = []
    for cycle in strongly_connected(graph):
        lines = [f"cycle of {what}: {', '.join(cycle)}"]
        for (a, b), include in sorted(edges.items()):
            if a in cycle and b in cycle:
                lines.append(f"    {include.file}:{include.line}: {include.included}")
        faults.append("\n".join(lines))
    return faults


def folder_faults(includes):
    faults = []
    for include in includes:
        a, b = include.file.split("/")[0], include.included.split("/")[0]
        if a != b and b not in FOLDERS[a]:
            allowed = ", ".join(sorted(FOLDERS[a])) or "nothing else"
            faults.append(f"{include.file}:{include.line}: {a}/ may include {allowed}, but not {include.included}")
    return faults


def reach_of(rooms, names):
    """The folders of these rooms and of all that comes with them: what they link as PUBLIC."""
    seen, waiting = set(), list(names)
    while waiting:
        name = waiting.pop()
        if name not in seen and name in rooms:
            seen.add(name)
            waiting += rooms[name].public
    return {rooms[name].folder for name in seen}


def room_faults(includes, rooms):
    public, private = {}, {}
    for room in rooms.values():
        public[room.folder] = reach_of(rooms, room.public)
        private[room.folder] = public[room.folder] | reach_of(rooms, room.private)
    faults, homeless = [], set()
    for include in includes:
        a, b = folder_of(include.file), folder_of(include.included)
        if a == b or a.split("/")[0] in ("tests", "bench"):
            continue
        if a in PROGRAM_ROOMS:
            if b.split("/")[0] == "tools" and b not in PROGRAM_ROOMS[a]:
                faults.append(f"{include.file}:{include.line}: {a}/ may not include {include.included}")
        elif a not in public:
            homeless.add(a)
        elif b not in private[a]:
            faults.append(f"{include.file}:{include.line}: {a}/CMakeLists.txt does not link {include.included}")
        elif include.file.endswith(".h") and b not in public[a]:
            faults.append(f"{include.file}:{include.line}: a header includes {include.included}, "
                          f"but {a}/CMakeLists.txt links that room as PRIVATE")
    return faults + [f"{folder}/CMakeLists.txt has no curvisplat_room()" for folder in sorted(homeless)]


def table_faults(includes, root):
    """What the tables of rooms say of the order."""
    faults = []
    for top in ("stream", "preprocess", "render"):
        table = root / top / "README.md"
        if not table.exists():
            continue
        order = re.findall(r"^\| \[`?(\w+)`?\]\(", table.read_text(), re.M)
        inside = [(include, include.file.split("/"), include.included.split("/"))
                  for include in includes if include.file.startswith(top + "/")]
        for room in sorted({a[1] for _, a, _ in inside if len(a) > 2} - set(order)):
            faults.append(f"{top}/README.md: its table has no row for {room}/")
        for include, a, b in inside:
            if b[0] == top and a[1] in order and b[1] in order and order.index(b[1]) > order.index(a[1]):
                faults.append(f"{include.file}:{include.line}: includes {include.included}, "
                              f"but {top}/README.md lists {b[1]} below {a[1]}")
    return faults


def check(root):
    includes, faults = read_includes(root)
    rooms = read_rooms(root)
    faults += cycle_faults(includes, component_of, "files")
    # Tests are parts of programs, not rooms.
    ours = [include for include in includes if include.file.split("/")[0] not in ("tests", "bench")]
    faults += cycle_faults(ours, folder_of, "rooms")
    for cycle in strongly_connected({name: set(room.public + room.private) for name, room in rooms.items()}):
        faults.append(f"cycle of links: {', '.join(cycle)}")
    faults += folder_faults(includes)
    faults += room_faults(includes, rooms)
    faults += table_faults(includes, root)
    return includes, faults


def main():
    root = pathlib.Path(sys.argv[1]) if len(sys.argv) > 1 else pathlib.Path(__file__).resolve().parents[2]
    includes, faults = check(root)
    for fault in faults:
        print(fault)
    if not includes:
        print(f"{root}: there are no sources")
        return 1
    print(f"{len(includes)} includes of project files, {len(faults)} faults")
    return 1 if faults else 0


if __name__ == "__main__":
    sys.exit(main())
