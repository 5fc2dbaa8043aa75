#!/usr/bin/env python3
"""Strip packing by this program and by spyrrow (PyPI), one after the other, the same seconds on one thread each.

usage: nest_beside_spyrrow.py PROGRAM SECONDS FILE.json|JOB...        (pip install spyrrow ezdxf)

PROGRAM is the built benchmark; `cargo bench --bench nest --no-run` prints its path. A FILE holds an instance of the ESICUP
data sets, a JOB is the output folder of a job: its parts then are packed on a strip as wide as its sheet inside the margins,
at the job's gap and at any angle. The seconds behind each figure are those of the processor: spyrrow stops by the clock, so
a busy machine takes some away from it.
"""
import json
import multiprocessing
import pathlib
import re
import resource
import subprocess
import sys
import tempfile


def of_job(folder):
    """The parts of a finished job as an instance."""
    import ezdxf

    report = json.load(open(folder / "report.json"))
    limits = {it["name"]: it["limit"] for it in report["checks"]}
    margin, gap = limits["nest.margin"], limits["nest.gap"]
    items = []
    for number, file in enumerate(sorted((folder / "parts").glob("*.dxf"))):
        lines = ezdxf.readfile(file).modelspace().query('LWPOLYLINE[layer=="CUT"]')
        for line in lines:
            shape = [[x, y] for x, y in line.get_points("xy")]
            items.append({"id": number, "demand": 1, "shape": {"data": shape}})
    return {"name": folder.name, "strip_height": report["layout"]["sheet_mm"][0] - 2 * margin, "gap": gap, "items": items}


def solve(data, seconds, answer):
    import spyrrow

    items = [
        spyrrow.Item(str(it["id"]), [tuple(p) for p in it["shape"]["data"]], demand=it["demand"], allowed_orientations=it.get("allowed_orientations"))
        for it in data["items"]
    ]
    instance = spyrrow.StripPackingInstance(data["name"], strip_height=data["strip_height"], items=items)
    config = spyrrow.StripPackingConfig(
        early_termination=False,
        total_computation_time=seconds,
        num_workers=1,
        seed=0,
        min_items_separation=data.get("gap") or None,
    )
    density = instance.solve(config).density
    answer.send((100 * density, resource.getrusage(resource.RUSAGE_SELF).ru_utime))


def theirs(data, seconds):
    """In a process of its own, whose processor time can be told."""
    here, there = multiprocessing.Pipe()
    worker = multiprocessing.Process(target=solve, args=(data, seconds, there))
    worker.start()
    found = here.recv()
    worker.join()
    return found


def main():
    program, seconds, files = sys.argv[1], int(sys.argv[2]), [pathlib.Path(it) for it in sys.argv[3:]]
    for file in files:
        data = of_job(file) if file.is_dir() else json.load(open(file))
        with tempfile.NamedTemporaryFile("w", suffix=".json") as instance:
            json.dump(data, instance)
            instance.flush()
            done = subprocess.run([program, str(seconds), instance.name], capture_output=True, text=True)
        found = re.search(r"([\d.]+) % in ([\d.]+) s", done.stdout) or sys.exit(done.stderr)
        ours, spent = map(float, found.groups())
        other, others = theirs(data, seconds)
        print(f"{file.stem}: {ours:.2f} % here ({spent:.0f} s), {other:.2f} % by spyrrow ({others:.0f} s)", flush=True)


if __name__ == "__main__":
    main()
