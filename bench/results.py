"""The form of measurements that all of bench/ and `curvisplat bench` write, and their statistics.

    {"schema": ..., "program": ..., "version": ..., "machine": {...},
     "measurements": [{"name", "unit", "better": "more" or "less", "median", "samples": [...]}],
     "left_out": [{"name", "reason"}]}

A name is a path that does not change from version to version, with parameters last: "frames/wake/backend:cpu". Units have no
prefix: s, B, B/s, nodes/s, dB, 1 (a count).
"""
import decimal
import json
import os
import platform
import statistics
import subprocess
import sys

SCHEMA = 1
SECONDS = {"ns": 1e-9, "us": 1e-6, "ms": 1e-3, "s": 1.0}  # Google Benchmark's units


def more_is_better(unit):
    return unit == "dB" or unit.endswith("/s")


def spread(samples):
    """The median distance of the samples from their median, scaled to the standard deviation of a normal distribution.
    For fewer than five samples half their range, since two of three may lie together by chance; None for one sample."""
    if len(samples) < 2:
        return None
    if len(samples) < 5:
        return 0.5 * (max(samples) - min(samples))
    middle = statistics.median(samples)
    return 1.4826 * statistics.median(abs(sample - middle) for sample in samples)


def three_digits(number):
    """As text without an exponent: 0.0712, 8.71, 5060."""
    return f"{decimal.Decimal(f'{number:.2e}'):f}"


def machine():
    processor = "unknown"
    with open("/proc/cpuinfo") as file:
        for line in file:
            if line.startswith("model name"):
                processor = line.split(":", 1)[1].strip()
                break
    with open("/proc/meminfo") as file:
        memory = next(int(line.split()[1]) * 1024 for line in file if line.startswith("MemTotal"))
    return {"processor": processor, "cores": os.cpu_count(), "memory_bytes": memory,
            "system": f"{platform.system()} {platform.release()}"}


class Results:
    def __init__(self):
        self.measurements = []
        self.left_out = []

    def add(self, name, unit, samples):
        samples = [float(sample) for sample in samples]
        if not samples or any(one["name"] == name for one in self.measurements):
            raise ValueError(f"{name}: already measured, or without samples")
        self.measurements.append({"name": name, "unit": unit, "better": "more" if more_is_better(unit) else "less",
                                  "median": statistics.median(samples), "samples": samples})

    def leave_out(self, name, reason):
        self.left_out.append({"name": name, "reason": reason})

    def take(self, other, prefix=""):
        """Adds all of another file's measurements, as read() returns them."""
        for one in other["measurements"]:
            self.measurements.append({**one, "name": prefix + one["name"]})
        for one in other.get("left_out", []):
            self.left_out.append({**one, "name": prefix + one["name"]})

    def write(self, path, program, version, **more):
        with open(path, "w") as file:
            json.dump({"schema": SCHEMA, "program": program, "version": version, "machine": machine(), **more,
                       "measurements": self.measurements, "left_out": self.left_out}, file, indent=1)
            file.write("\n")


def from_google_benchmark(content):
    """The output of --benchmark_format=json, as seconds of real time with one sample a repetition."""
    results, samples = Results(), {}
    for run in content["benchmarks"]:
        name = run.get("run_name", run["name"])
        if run.get("error_occurred"):
            results.leave_out(name, run.get("error_message", "failed"))
        elif run.get("run_type", "iteration") == "iteration":
            samples.setdefault(name, []).append(run["real_time"] * SECONDS[run["time_unit"]])
    for name, values in samples.items():
        results.add(name, "s", values)
    context = content.get("context", {})
    return {"program": "curvisplat_bench", "version": "",
            "machine": {"processor": "", "cores": context.get("num_cpus")},
            "measurements": results.measurements, "left_out": results.left_out}


def read(path):
    """Reads a file of this form, or one of Google Benchmark's."""
    with open(path) as file:
        content = json.load(file)
    if isinstance(content, dict) and "benchmarks" in content:
        return from_google_benchmark(content)
    if not isinstance(content, dict) or not isinstance(content.get("measurements"), list):
        raise ValueError(f"{path}: has no \"measurements\"; expected a file that bench/ or `curvisplat bench` wrote")
    for one in content["measurements"]:
        if not {"name", "unit", "samples"} <= set(one) or not one["samples"]:
            raise ValueError(f"{path}: a measurement lacks name, unit or samples: {one}")
    return content


def run(command, **how):
    """Runs a program; exits with its output if it fails."""
    command = [str(word) for word in command]
    try:
        result = subprocess.run(command, capture_output=True, text=True, **how)
    except FileNotFoundError:
        sys.exit(f"{command[0]}: no such program; build it (see bench/README.md), or give another one")
    if result.returncode != 0:
        sys.exit(f"{' '.join(command)}\n{result.stdout}{result.stderr}")
    return result.stdout


def version_of(program):
    return run([program, "--version"]).split()[-1]
