#!/usr/bin/env python3
"""What a build from nothing takes, crate by crate: a table in Markdown.

    python3 benches/build_times.py [--least 5] [CARGO WORDS]

Runs `cargo build --release --timings` (or the words that are given) with a target folder of its own, which is removed.
Seconds are those between the start of a compiler and its end, of as many as run at once; processor time is that of all.
"""

import argparse
import collections
import json
import os
import pathlib
import resource
import subprocess
import tempfile
import time

ROOT = pathlib.Path(__file__).resolve().parent.parent


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--least", type=float, default=5.0, help="seconds of the crates that have a row")
    parser.add_argument("words", nargs="*", default=["build", "--release"], help="of cargo")
    options = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        begin = time.perf_counter()
        words = ["cargo", *options.words, "--timings"]
        subprocess.run(words, cwd=ROOT, env={**os.environ, "CARGO_TARGET_DIR": folder}, check=True)
        wall = time.perf_counter() - begin
        used = resource.getrusage(resource.RUSAGE_CHILDREN)
        text = (pathlib.Path(folder) / "cargo-timings/cargo-timing.html").read_text()
    units, _ = json.JSONDecoder().raw_decode(text[text.index("UNIT_DATA = ") + len("UNIT_DATA = ") :])
    seconds = collections.Counter()
    for unit in units:
        seconds[unit["name"]] += unit["duration"]
    print(f"`{' '.join(words)}`: {used.ru_utime + used.ru_stime:.0f} s of processor time, {wall:.0f} s on {os.cpu_count()} cores\n")
    print("| crate | seconds |\n|---|---|")
    rest = 0.0
    for name, duration in seconds.most_common():
        if duration < options.least:
            rest += duration
            continue
        print(f"| {name} | {duration:.0f} |")
    few = sum(duration < options.least for duration in seconds.values())
    print(f"| {few} others | {rest:.0f} |")


main()
