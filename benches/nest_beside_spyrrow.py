#!/usr/bin/env python3
"""Strip packing by this program and by spyrrow (PyPI), one after the other, the same seconds on one thread each.

usage: nest_beside_spyrrow.py SECONDS FILE.json...        (pip install spyrrow)
"""
import json
import re
import subprocess
import sys

import spyrrow


def theirs(file, seconds):
    data = json.load(open(file))
    items = [
        spyrrow.Item(str(item["id"]), item["shape"]["data"], demand=item["demand"], allowed_orientations=item["allowed_orientations"])
        for item in data["items"]
    ]
    instance = spyrrow.StripPackingInstance(data["name"], strip_height=data["strip_height"], items=items)
    config = spyrrow.StripPackingConfig(early_termination=False, total_computation_time=seconds, num_workers=1, seed=0)
    return 100 * instance.solve(config).density


def main():
    seconds, files = int(sys.argv[1]), sys.argv[2:]
    for file in files:
        done = subprocess.run(
            ["cargo", "bench", "--quiet", "--bench", "nest", "--", str(seconds), file], capture_output=True, text=True
        )
        found = re.search(r"([\d.]+) %", done.stdout)
        ours = float(found.group(1)) if found else sys.exit(done.stderr)
        print(f"{file}: {ours:.2f} % here, {theirs(file, seconds):.2f} % by spyrrow, {seconds} s each", flush=True)


if __name__ == "__main__":
    main()
