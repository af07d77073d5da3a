#!/usr/bin/env python3
"""Says what threads did in a trace, and what more of them would gain.

For each stage (a pass of a conversion, a frame): how long it took, how many threads worked at a time, how long one worked
alone or none did, and what only one thread can do. From these the time with N threads is estimated as

    T(N) = max(idle + alone + (work - alone) / N, the most that one thread does which no other ever does)

and the efficiency as T(1) / (N T(N)), T(1) = idle + work. All are processor times, except that `idle` and `alone` are times
of the clock, so other programs must not run meanwhile. The estimate knows nothing of memory bandwidth, and takes all shared
work as divisible.

    curvisplat convert GRID -o OUT.splats --trace trace.json
    bench/threads.py trace.json [--threads 1,2,4,8,16,64]
"""
import argparse
import bisect
import collections
import json


class Scope:
    def __init__(self, event):
        self.name, self.kind, self.thread = event["name"], event["cat"], event["tid"]
        self.begin = 1e-6 * event["ts"]
        self.end = self.begin + 1e-6 * event["dur"]
        self.processor = 1e-6 * event["tdur"]
        self.numbers = event.get("args", {})


def read(path):
    """The scopes, by their beginning, and the names of threads."""
    with open(path) as file:
        text = file.read().rstrip()
    # A run that was killed has not closed the array.
    events = json.loads(text if text.endswith("]") else text.rstrip(",") + "]")
    scopes = sorted((Scope(event) for event in events if event["ph"] == "X"), key=lambda scope: (scope.begin, -scope.end))
    names = {event["tid"]: event["args"]["name"] for event in events if event["name"] == "thread_name"}
    return scopes, names


def outermost(scopes):
    """Those of one thread that lie in no other, given by their beginning."""
    found = []
    for scope in scopes:
        if not found or scope.end > found[-1].end:
            found.append(scope)
    return found


def intervals_at_work(scopes):
    """[begin, end] in which a thread works: its work without the waits in it."""
    at_work = []
    waits = outermost([scope for scope in scopes if scope.kind == "wait"])
    for scope in outermost([scope for scope in scopes if scope.kind == "work"]):
        begin = scope.begin
        for wait in waits[bisect.bisect_left([wait.begin for wait in waits], scope.begin):]:
            if wait.begin >= scope.end:
                break
            at_work.append((begin, wait.begin))
            begin = wait.end
        at_work.append((begin, max(begin, scope.end)))
    return at_work


def own_processor_times(scopes):
    """{name: seconds} of one thread's work, without what is traced by itself within it."""
    own = collections.defaultdict(float)
    within = []
    for scope in scopes:
        while within and within[-1].end <= scope.begin:
            within.pop()
        own[scope.name] += scope.processor
        if within:
            own[within[-1].name] -= scope.processor
        within.append(scope)
    return own


class Stage:
    """One stage, or several of the same name together."""

    def __init__(self, name):
        self.name = name
        self.count = 0
        self.wall = self.idle = self.alone = self.work = 0.0
        self.by_thread = collections.defaultdict(lambda: collections.defaultdict(float))  # [thread][name]

    def add(self, stage, scopes):
        self.count += 1
        self.wall += stage.end - stage.begin
        by_thread = collections.defaultdict(list)
        for scope in scopes:
            by_thread[scope.thread].append(scope)
        changes = []
        for thread, own in by_thread.items():
            for begin, end in intervals_at_work(own):
                changes += [(max(begin, stage.begin), 1), (min(end, stage.end), -1)]
            for name, seconds in own_processor_times([scope for scope in own if scope.kind == "work"]).items():
                self.by_thread[thread][name] += seconds
        self.work = sum(sum(names.values()) for names in self.by_thread.values())
        threads, last = 0, stage.begin
        for time, change in sorted(changes) + [(stage.end, 0)]:
            if threads == 0:
                self.idle += time - last
            elif threads == 1:
                self.alone += time - last
            threads, last = threads + change, time

    def only_of(self):
        """(seconds, thread, names): the most that one thread did which no other did."""
        most = (0.0, None, [])
        for thread, names in self.by_thread.items():
            own = {name: seconds for name, seconds in names.items()
                   if all(other == thread or name not in theirs for other, theirs in self.by_thread.items())}
            most = max(most, (sum(own.values()), thread, sorted(own, key=own.get, reverse=True)), key=lambda item: item[0])
        return most

    def time(self, threads):
        alone = min(self.alone, self.work)
        return max(self.idle + alone + (self.work - alone) / threads, self.only_of()[0])


def stages_of(scopes):
    """The outermost stages of the trace, those of one name together."""
    stages = {}
    for stage in outermost([scope for scope in scopes if scope.kind == "stage"]):
        within = [scope for scope in scopes if scope.kind != "stage" and scope.begin < stage.end and scope.end > stage.begin]
        stages.setdefault(stage.name, Stage(stage.name)).add(stage, within)
    return list(stages.values())


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("trace", help="written by --trace")
    parser.add_argument("--threads", default="1,2,4,8,16,64", help="numbers of threads to estimate for")
    arguments = parser.parse_args()
    numbers = [int(number) for number in arguments.threads.split(",")]
    scopes, names = read(arguments.trace)
    stages = stages_of(scopes)
    if not stages:
        raise SystemExit(f"{arguments.trace}: has no stages; was it written by --trace?")

    print(f"{'stage':<14} {'times':>5} {'wall s':>8} {'work s':>8} {'threads':>7} {'alone s':>8} {'idle s':>8}  "
          "only one thread does")
    for stage in stages:
        seconds, thread, what = stage.only_of()
        by_one = f"{seconds:.3f} s {names.get(thread, thread)}: {', '.join(what[:3])}" if thread else ""
        print(f"{stage.name:<14} {stage.count:5} {stage.wall:8.3f} {stage.work:8.3f} {stage.work / stage.wall:7.2f} "
              f"{stage.alone:8.3f} {stage.idle:8.3f}  {by_one}")
    print()
    print("estimate       " + " ".join(f"{f'{number} threads':>12}" for number in numbers))
    for stage in stages:
        print(f"{stage.name:<14} " + " ".join(f"{stage.time(number):10.3f} s" for number in numbers))
    total = [sum(stage.time(number) for stage in stages) for number in numbers]
    one = sum(stage.time(1) for stage in stages)
    print(f"{'all':<14} " + " ".join(f"{seconds:10.3f} s" for seconds in total))
    print(f"{'efficiency':<14} " + " ".join(f"{one / (number * seconds):12.2f}" for number, seconds in zip(numbers, total)))


if __name__ == "__main__":
    main()
