#!/usr/bin/env python3
"""Replays the trace of a frame as if there were a core for each of its threads.

A trace of `--threads N` has the tasks of N threads, on however few cores they ran: bricks, batches of sorted splats, ranges of
tiles. Here N cores do them, each in its own processor time and after what it waits for in the code:

    worker    a batch, if there is one:  sort -> its space in the ring, in order -> copy
              else a brick:              decode, project, sort -> its turn, in order -> enter -> fill
    batch     is there when all parts before the traced turn have entered
    painter   batch by batch: passes of bins, then ranges of tiles; each pass begins when the last has ended
    permits   N; workers first, painting threads give way to them between two ranges

Not in the model: reading, memory bandwidth, clock rates, cores that share units, and a sweep that has no space. `--wake-us` is what
a thread takes to go on when what it waits for has come. Efficiencies are T(1) / (N T(N)), with T(1) of the first trace of one
thread, else with the work of the trace itself.

    curvisplat render CACHE -o a.png --size 1920x1080 --memory 1G --threads 16 --trace t16.json
    bench/replay_frame.py t1.json t2.json t16.json
"""
import argparse
import bisect
import collections
import heapq

import threads

PAINTING = {"clear tiles", "sort bins", "divide tiles", "paint tiles", "finish tiles"}  # ranges, by any thread
ALONE = {"bin splats", "sum bins", "list tiles", "make image"}  # by the frame's thread between them
PREPARING = {"read brick", "verify brick", "decode brick", "project brick"}
WHAT_IFS = {"longest-first": "the ranges of a batch that take longest are painted first",
            "split-tiles": "each range of tiles is divided into four that take the same time",
            "large-ring": "the ring holds eight times as many splats",
            "bins-ahead": "the bins of the next batch are sorted by threads that find no range of this one"}


class Brick:
    def __init__(self):
        self.prepare = self.enter = self.fill = 0.0


class Batch:
    def __init__(self, scope, cut):
        self.turn, self.splats = scope.numbers["number"], scope.numbers["splats"]
        self.sort, self.copy = cut + scope.processor, 0.0


class Slab:
    """What the workers do until all of them wait for the painter."""

    def __init__(self, start):
        self.start = start.processor
        self.ring_splats = start.numbers["splats"]
        self.bricks = collections.defaultdict(Brick)  # by their turn; those missing were passed over
        self.batches = {}  # by their number in the frame

    def turns(self):
        return max([turn + 1 for turn in self.bricks] + [batch.turn for batch in self.batches.values()], default=0)


class Step:
    """Of the painter: ranges by any thread, or one by the frame's."""

    def __init__(self, name, seconds):
        self.name, self.seconds, self.is_shared = name, [seconds], name in PAINTING


class Frame:
    """The tasks of a frame that the processor's painter drew."""

    def __init__(self, scopes, frame):
        within = [scope for scope in scopes if frame.begin <= scope.begin and scope.end <= frame.end]
        named = collections.defaultdict(list)
        for scope in within:
            named[scope.name].append(scope)
        for name in "start frame", "start slab", "begin picture", "sum bins", "draw batch", "finish picture":
            if not named[name]:
                raise SystemExit(f"the trace has no '{name}': frames of the processor's painter with splats can be replayed")
        self.wall = frame.end - frame.begin
        self.waits_for_space = len(named["wait for space"])
        self.begin = sum(scope.processor for scope in named["plan"] + named["start frame"])

        steps = [scope for scope in within if scope.name in PAINTING | ALONE]
        last = named["sum bins"][-1]
        self.threads = sum(scope.name == "sort bins" and scope.begin >= last.begin for scope in steps)  # pieces of a pass
        begins = [scope.begin for scope in named["draw batch"]] + [named["finish picture"][0].begin, frame.end]
        first = named["begin picture"][0]
        self.clear = self.steps([scope for scope in steps if scope.begin < begins[0]])
        rest = first.processor - sum(scope.processor for scope in steps
                                     if scope.thread == frame.thread and scope.begin < first.end)
        self.clear.insert(0, Step("begin picture", max(0.0, rest)))
        step_begins = [scope.begin for scope in steps]
        places = [bisect.bisect_left(step_begins, begin) for begin in begins]
        self.paintings = [self.steps(steps[begin:end]) for begin, end in zip(places, places[1:])]
        self.finish = self.paintings.pop()

        self.slabs = [Slab(scope) for scope in named["start slab"]]
        slab_begins = [scope.begin for scope in named["start slab"]]
        by_thread = collections.defaultdict(list)
        for scope in within:
            if scope.kind == "work" and scope.thread != frame.thread:
                by_thread[scope.thread].append(scope)
        self.workers = 0
        for own in by_thread.values():
            own = threads.outermost(own)
            self.workers += any(scope.name in PREPARING or scope.name == "sort batch" for scope in own)
            self.prepared(own, slab_begins)
        self.preparing = sum(brick.prepare + brick.enter + brick.fill for slab in self.slabs for brick in slab.bricks.values())
        self.preparing += sum(batch.sort + batch.copy for slab in self.slabs for batch in slab.batches.values())
        painter = [step for painting in [self.clear, *self.paintings, self.finish] for step in painting]
        self.painting = sum(sum(step.seconds) for step in painter if step.is_shared)
        self.alone = self.begin + sum(slab.start for slab in self.slabs)
        self.alone += sum(sum(step.seconds) for step in painter if not step.is_shared)
        self.work = self.preparing + self.painting + self.alone
        # Of the frame's thread and not replayed: TBB, permits, what is not traced
        self.nameless = frame.processor - sum(slab.start for slab in self.slabs) - sum(self.clear[0].seconds) - sum(scope.processor for scope in threads.outermost(
            [scope for scope in within if scope.thread == frame.thread and scope.kind == "work"]))

    def steps(self, scopes):
        steps = []
        for scope in scopes:
            last = steps[-1] if steps else None
            full = self.threads if scope.name == "sort bins" else len(scopes)
            if last and last.name == scope.name and scope.name in PAINTING and len(last.seconds) < full:
                last.seconds.append(scope.processor)
            else:
                steps.append(Step(scope.name, scope.processor))
        return steps

    def prepared(self, scopes, slab_begins):
        """Adds what one worker did, from its scopes in order."""
        before = cut = 0.0
        brick = batch = None
        for scope in scopes:
            slab = self.slabs[bisect.bisect_right(slab_begins, scope.begin) - 1]
            if scope.name in PREPARING:
                before += scope.processor
            elif scope.name == "sort brick":
                brick = slab.bricks[scope.numbers["number"]]
                brick.prepare, before = before + scope.processor, 0.0
            elif scope.name == "enter sweep":
                brick.enter += scope.processor
            elif scope.name == "fill sweep":
                brick.fill = scope.processor
            elif scope.name == "cut batch":
                cut += scope.processor
            elif scope.name == "sort batch":
                batch, cut = Batch(scope, cut), 0.0
            elif scope.name == "copy batch":
                batch.copy = scope.processor
                slab.batches[scope.numbers["number"]] = batch

    def change(self, what_if):
        if what_if == "longest-first":
            for painting in self.paintings:
                for step in painting:
                    step.seconds.sort(reverse=step.name == "paint tiles")
        if what_if == "split-tiles":
            for painting in self.paintings:
                for step in painting:
                    if step.name == "paint tiles":
                        step.seconds = [seconds / 4 for seconds in step.seconds for _ in range(4)]
        if what_if == "large-ring":
            for slab in self.slabs:
                slab.ring_splats *= 8
        if what_if == "bins-ahead":
            for this, following in zip(self.paintings, self.paintings[1:]):
                bins = [step for step in following if step.name != "paint tiles"]
                if this and this[-1].name == "paint tiles" and len(bins) < len(following):
                    this[-1].seconds += [second for step in bins for second in step.seconds]
                    following[:] = following[len(bins):]


class Loop:
    def __init__(self, step, members):
        self.name, self.ranges = step.name, collections.deque(step.seconds)
        self.left, self.running, self.members = len(step.seconds), 0, members


class Replay:
    """Threads are generators that yield ("work", seconds), ("permit", urgent) or ("until", condition)."""

    def __init__(self, frame, cores, wake_s=0.0):
        self.frame, self.cores, self.wake_s = frame, cores, wake_s
        self.now, self.events, self.count = 0.0, [], 0
        self.free, self.urgent, self.others, self.waiting = cores, collections.deque(), collections.deque(), []
        self.loop, self.state = None, "begin"
        self.idle = collections.Counter()  # {state: seconds of a core}
        self.spent = collections.Counter()  # {state: seconds}
        self.acquired, self.released, self.committed, self.segments, self.end = 0, 0, set(), collections.deque(), 0
        self.go_on(self.paint())
        while self.events:
            time, _, event = heapq.heappop(self.events)
            self.idle[self.at()] += self.free * (time - self.now)
            self.spent[self.at()] += time - self.now
            self.now = time
            event()
        if self.waiting or self.urgent or self.others or self.loop:
            raise RuntimeError("the replay has come to a stop")

    def at(self):
        if not self.loop:
            return self.state
        return f"{self.loop.name}" + ("" if self.loop.ranges else ", last ranges")

    def after(self, seconds, event):
        self.count += 1
        heapq.heappush(self.events, (self.now + seconds, self.count, event))

    def go_on(self, thread):
        while (request := next(thread, None)) is not None:
            what, of = request
            if what == "work":
                return self.after(of, lambda: self.go_on(thread))
            if what == "permit" and self.free > (0 if of else len(self.urgent)):
                self.free -= 1
            elif what == "permit":
                (self.urgent if of else self.others).append(thread)
                return self.share()
            elif not of():
                return self.waiting.append((of, thread))

    def changed(self):
        ready = [thread for condition, thread in self.waiting if condition()]
        self.waiting = [(condition, thread) for condition, thread in self.waiting if thread not in ready]
        for thread in ready:
            self.after(self.wake_s, lambda thread=thread: self.go_on(thread))

    def give_back(self):
        self.free += 1
        self.share()

    def share(self):
        """Gives free permits to those who want them."""
        while self.free > 0:
            queue = self.urgent or self.others
            if queue:
                self.free -= 1
                self.after(self.wake_s, lambda thread=queue.popleft(): self.go_on(thread))
            elif self.loop and self.loop.ranges and self.loop.running < self.loop.members:
                self.free -= 1
                self.loop.running += 1
                self.take_range()
            else:
                return

    def take_range(self):
        self.after(self.loop.ranges.popleft(), self.range_ended)

    def range_ended(self):
        self.loop.left -= 1
        if self.loop.ranges and not self.urgent:
            return self.take_range()
        self.loop.running -= 1
        self.give_back()
        if self.loop.left == 0:
            self.loop = None
            self.changed()

    # The frame's thread

    def paint(self):
        frame = self.frame
        yield "permit", False
        yield "work", frame.begin
        number = 0
        for index, slab in enumerate(frame.slabs):
            self.state = "begin"
            yield "work", slab.start
            self.start(slab)
            if index == 0:
                yield from self.draw(frame.clear)
            self.give_back()
            for number in range(number, number + len(slab.batches)):
                self.state = "wait for splats"
                yield "until", lambda: number in self.committed
                self.state = "permit"
                yield "permit", False
                yield from self.draw(frame.paintings[number])
                self.give_back()
                self.segments.popleft()
                self.changed()
            number += bool(slab.batches)
            self.state = "wait for workers"
            yield "until", lambda: self.working == 0
            self.state = "permit"
            yield "permit", False
        yield from self.draw(frame.finish)
        self.state = "ended"
        self.give_back()

    def draw(self, steps):
        for step in steps:
            self.state = step.name
            if not step.is_shared:
                yield "work", step.seconds[0]
                continue
            self.loop = loop = Loop(step, 1 if self.wake_s else self.cores)
            self.give_back()
            if self.wake_s:
                self.after(self.wake_s, lambda loop=loop: self.join(loop))
            yield "until", lambda loop=loop: loop.left == 0
            self.state = "permit"
            yield "permit", False

    def join(self, loop):
        loop.members = self.cores
        self.share()

    # Workers

    def start(self, slab):
        self.slab, self.turn, self.next, self.turns = slab, 0, 0, slab.turns()
        self.filled, self.all_filled = set(), 0
        self.batches = collections.deque(sorted(slab.batches))
        self.working = self.frame.workers
        for _ in range(self.working):
            self.after(self.wake_s, lambda thread=self.worker(): self.go_on(thread))

    def is_batch(self):
        return bool(self.batches) and self.slab.batches[self.batches[0]].turn <= self.turn

    def worker(self):
        yield "permit", True
        while True:
            if self.is_batch():
                yield from self.hand(self.batches.popleft())
            elif self.next < self.turns:
                turn = self.next
                self.next += 1
                yield from self.bring(turn, self.slab.bricks[turn])
            elif self.batches:
                yield from self.wait(self.is_batch_or_end)
            else:
                break
        self.working -= 1
        self.give_back()
        self.changed()

    def is_batch_or_end(self):
        return self.is_batch() or not self.batches

    def wait(self, condition):
        if condition():
            return
        self.give_back()
        yield "until", condition
        yield "permit", True

    def bring(self, turn, brick):
        yield "work", brick.prepare
        yield from self.wait(lambda: self.turn == turn)
        yield "work", brick.enter
        self.turn += 1
        self.changed()
        yield "work", brick.fill
        self.filled.add(turn)
        while self.all_filled in self.filled:
            self.all_filled += 1
        self.changed()

    def hand(self, number):
        batch = self.slab.batches[number]
        if not self.batches:
            self.changed()
        yield "work", batch.sort
        yield from self.wait(lambda: self.all_filled >= batch.turn and number == self.acquired
                             and self.place_for(batch.splats) is not None)
        begin = self.place_for(batch.splats)
        self.segments.append(begin)
        self.end = begin + batch.splats
        self.acquired += 1
        self.changed()
        yield "work", batch.copy
        self.committed.add(number)
        self.changed()

    def place_for(self, count):
        """As in segment_ring.cpp."""
        next_lap = -(-self.end // self.slab.ring_splats) * self.slab.ring_splats
        if not self.segments:
            return next_lap
        begin = next_lap if self.end % self.slab.ring_splats + count > self.slab.ring_splats else self.end
        return None if begin + count - self.segments[0] > self.slab.ring_splats else begin


def frames_of(path):
    scopes, _ = threads.read(path)
    return [Frame(scopes, scope) for scope in scopes if scope.name == "frame"]


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("traces", nargs="+", help="written by render --trace, each with another number of --threads")
    parser.add_argument("--wake-us", type=float, default=0, help="microseconds until a waiting thread goes on (default 0)")
    parser.add_argument("--what-if", choices=WHAT_IFS, help="; ".join(f"{name}: {what}" for name, what in WHAT_IFS.items()))
    parser.add_argument("--frame", type=int, default=0, help="which of a trace, from 0 on")
    arguments = parser.parse_args()
    one = None
    print(f"{'threads':>7} {'batches':>7} {'prepare':>8} {'paint':>8} {'alone':>8} {'work':>8} {'nameless':>8} {'traced':>8} "
          f"{'replayed':>8} {'efficiency':>10}   seconds; all but traced and replayed are processor times")
    for path in arguments.traces:
        frame = frames_of(path)[arguments.frame]
        if frame.waits_for_space:
            print(f"{path}: {frame.waits_for_space} waits for space in the sweep are not in the model")
        frame.change(arguments.what_if)
        replay = Replay(frame, frame.threads, 1e-6 * arguments.wake_us)
        if frame.threads == 1 and one is None:
            one = replay.now
        efficiency = (one or frame.work) / (frame.threads * replay.now)
        print(f"{frame.threads:7} {len(frame.paintings):7} {frame.preparing:8.3f} {frame.painting:8.3f} {frame.alone:8.3f} "
              f"{frame.work:8.3f} {frame.nameless:8.3f} {frame.wall:8.3f} {replay.now:8.3f} {efficiency:10.2f}")
        if frame.threads > 1:
            print("        seconds a core is idle meanwhile, on average: " + ", ".join(
                f"{state} {seconds / frame.threads:.3f}" for state, seconds in replay.idle.most_common()
                if seconds > 0.005 * frame.threads * replay.now))


if __name__ == "__main__":
    main()
