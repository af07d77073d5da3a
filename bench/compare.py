#!/usr/bin/env python3
"""Compares two files of measurements by their medians and spreads.

    bench/compare.py OLD.json NEW.json [--least 3] [--only REGEX] [--allow-missing] [--all]

Both files are in the form of bench/results.py, or in Google Benchmark's (--benchmark_format=json
--benchmark_repetitions=5). A median has changed if it differs by more than --least percent, and by more than twice the sum of
both spreads. Seconds and rates with a single sample are shown but not judged. Bytes, counts and dB are repeatable, and are
judged (dB from a difference of 0.2 on).

Exit status: 0 nothing became worse; 1 something became worse, is missing, or has another unit; 2 a file cannot be read.
"""
import argparse
import re
import statistics
import sys

import results

LEAST_DB = 0.2


def judge(old, new, least):
    """Returns "worse", "better", "same", "one sample" or "other unit"."""
    if old["unit"] != new["unit"]:
        return "other unit"
    unit = old["unit"]
    before, after = statistics.median(old["samples"]), statistics.median(new["samples"])
    spreads = [results.spread(one["samples"]) for one in (old, new)]
    if None in spreads and (unit == "s" or unit.endswith("/s")):
        return "one sample"
    noise = 2 * sum(value or 0 for value in spreads)
    noise = max(noise, LEAST_DB if unit == "dB" else least * abs(before))
    if abs(after - before) <= noise:
        return "same"
    return "better" if (after > before) == results.more_is_better(unit) else "worse"


def text(measurement):
    value = statistics.median(measurement["samples"])
    spread = results.spread(measurement["samples"])
    around = "" if spread is None else f" ± {100 * spread / abs(value):.1f} %" if value else f" ± {spread:g}"
    return f"{value:.4g} {measurement['unit']}{around}"


def compare(old, new, least=0.03, allow_missing=False, only=""):
    """Returns [(name, judgement, old text, new text, ratio or None)], and whether anything failed."""
    rows, failed = [], False
    before = {one["name"]: one for one in old["measurements"]}
    after = {one["name"]: one for one in new["measurements"]}
    reasons = {one["name"]: one["reason"] for one in new.get("left_out", [])}
    for name in [*before, *(name for name in after if name not in before)]:
        if not re.search(only, name):
            continue
        if name not in after:
            failed |= not allow_missing
            rows.append((name, "missing", text(before[name]), reasons.get(name, "-"), None))
        elif name not in before:
            rows.append((name, "new", "-", text(after[name]), None))
        else:
            judgement = judge(before[name], after[name], least)
            failed |= judgement in ("worse", "other unit")
            middle = statistics.median(before[name]["samples"])
            ratio = statistics.median(after[name]["samples"]) / middle if middle else None
            rows.append((name, judgement, text(before[name]), text(after[name]), ratio))
    return rows, failed


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("old")
    parser.add_argument("new")
    parser.add_argument("--least", type=float, default=3, help="smallest change in percent that counts (default 3)")
    parser.add_argument("--only", default="", help="regular expression of the names to compare")
    parser.add_argument("--allow-missing", action="store_true", help="NEW may lack what OLD has")
    parser.add_argument("--all", action="store_true", help="also list what stayed the same")
    arguments = parser.parse_args()
    try:
        old, new = results.read(arguments.old), results.read(arguments.new)
    except (OSError, ValueError, KeyError) as error:
        print(f"compare: {error}", file=sys.stderr)
        sys.exit(2)
    if old.get("machine", {}).get("processor") != new.get("machine", {}).get("processor"):
        print("compare: measured on different or unknown machines", file=sys.stderr)
    rows, failed = compare(old, new, arguments.least / 100, arguments.allow_missing, arguments.only)
    shown = [row for row in rows if arguments.all or row[1] != "same"]
    width = max([len(row[0]) for row in shown], default=0)
    for name, judgement, before, after, ratio in shown:
        print(f"{name:{width}}  {judgement:10}  {before} -> {after}" + (f"  x {ratio:.3f}" if ratio else ""))
    counts = {kind: sum(row[1] == kind for row in rows) for kind in dict.fromkeys(row[1] for row in rows)}
    print(", ".join(f"{count} {kind}" for kind, count in counts.items()) or "nothing to compare")
    sys.exit(1 if failed or not rows else 0)


if __name__ == "__main__":
    main()
