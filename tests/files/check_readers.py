#!/usr/bin/env python3
"""Do all readers see the same? The cuts of every sheet and part of a job, as many programs as are installed read them: how
many contours, and how large the box around them.

usage: check_readers.py OUT_DIR...

ezdxf is the measure (`check_files.py` holds it against report.json); beside it GDAL (ogrinfo), OpenSCAD and Inkscape's DXF
importer read the DXF, resvg, Inkscape, vpype and rsvg-convert the SVG, pdfinfo the PDF. What is not installed is said. Every
difference is printed; the exit code is 1 if there is one.
"""
import json
import math
import re
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path

import ezdxf

# The layers whose lines are cuts in the built-in profiles.
CUTS = ("CUT", "CUT_INNER")
MM_PER_PX = 25.4 / 96
MM_PER_PT = 25.4 / 72
IMPORTER = Path("/usr/share/inkscape/extensions/dxf_input.py")
PAIR = re.compile(r"(-?[\d.]+(?:e-?\d+)?)[ ,](-?[\d.]+(?:e-?\d+)?)")


class Missing(Exception):
    """A program that is not installed."""


def run(*command, **options):
    if shutil.which(command[0]) is None:
        beside = Path(sys.executable).parent / command[0]
        if not beside.exists():
            raise Missing(command[0])
        command = (str(beside), *command[1:])
    done = subprocess.run([str(it) for it in command], capture_output=True, text=True, **options)
    if done.returncode != 0:
        raise ValueError(f"{command[0]}: {done.stderr.strip()[-300:]}")
    return done.stdout


def seen(contours):
    """Number of contours, and width and height of the box around them."""
    points = [point for contour in contours for point in contour]
    if not points:
        return 0, 0.0, 0.0
    (x0, x1), (y0, y1) = ((min(it), max(it)) for it in zip(*points))
    return len(contours), x1 - x0, y1 - y0


def pairs(text):
    return [(float(x), float(y)) for x, y in PAIR.findall(text)]


# -- DXF -----------------------------------------------------------------------------------------------------------------


def by_ezdxf(file):
    lines = [it for it in ezdxf.readfile(file).modelspace() if it.dxf.layer in CUTS]
    return seen([[(p[0], p[1]) for p in it.get_points("xy")] for it in lines])


def by_gdal(file):
    found = []
    for feature in run("ogrinfo", "-ro", "-al", file).split("OGRFeature")[1:]:
        layer = re.search(r"Layer \(String\) = (\S+)", feature)
        if layer and layer[1] in CUTS:
            found.append(pairs(feature[re.search(r"(LINESTRING|POLYGON)", feature).start() :]))
    return seen(found)


def by_openscad(file):
    """Layer by layer: holes would be united with what they are in."""
    found = []
    for layer in CUTS:
        with tempfile.TemporaryDirectory() as folder:
            program, svg = Path(folder) / "in.scad", Path(folder) / "out.svg"
            program.write_text(f'import("{Path(file).resolve()}", layer="{layer}");')
            try:
                run("openscad", "-o", svg, program)
            except ValueError as error:
                # What it says of a layer without lines.
                if "not a 2D object" in str(error):
                    continue
                raise
            paths = re.findall(r'<path d="([^"]*)"', svg.read_text())
            found += [pairs(contour) for path in paths for contour in path.split("z") if contour.strip()]
    return seen(found)


def by_inkscape_import(file):
    if not IMPORTER.exists():
        raise Missing("Inkscape's dxf_input.py")
    text = run("/usr/bin/python3", IMPORTER, "--scalemethod=file", file)
    found = []
    for layer in text.split("<g inkscape:groupmode")[1:]:
        if re.match(r'="layer" inkscape:label="([^"]*)"', layer)[1] in CUTS:
            paths = re.findall(r'<path d="([^"]*)"', layer)
            found += [[(x * MM_PER_PX, y * MM_PER_PX) for x, y in pairs(path)] for path in paths]
    return seen(found)


# -- SVG -----------------------------------------------------------------------------------------------------------------


def cuts_only(file):
    """The SVG with no layers but the cuts, filled: the box of a stroke has its mitres."""
    text = Path(file).read_text()
    text = re.sub(r'<g id="(?!cut"|cut_inner")[^>]*>.*?</g>', "", text, flags=re.S)
    return re.sub(r'fill="none" stroke="[^"]*" stroke-width="[^"]*"', 'fill="#000000"', text)


def boxes(rows):
    """Number of paths and box, of rows of the form id,x,y,w,h in pixels."""
    found = [(name, *map(float, box)) for name, *box in (row.split(",") for row in rows.split()) if len(box) == 4]
    layers = [it for it in found if it[0] in ("cut", "cut_inner")]
    corners = [[(x, y), (x + w, y + h)] for _, x, y, w, h in layers]
    _, width, height = seen(corners)
    return None, width * MM_PER_PX, height * MM_PER_PX


def by_resvg(file):
    return boxes(run("resvg", "--query-all", "-", input=cuts_only(file)))


def by_inkscape(file):
    with tempfile.NamedTemporaryFile("w", suffix=".svg") as copy:
        copy.write(cuts_only(file))
        copy.flush()
        return boxes(run("inkscape", "--query-all", copy.name))


def by_vpype(file):
    try:
        import vpype
    except ImportError:
        raise Missing("vpype") from None
    with tempfile.NamedTemporaryFile("w", suffix=".svg") as copy:
        copy.write(Path(file).read_text())
        copy.flush()
        document = vpype.read_multilayer_svg(copy.name, quantization=0.1, crop=False)
    lines = []
    for layer in document.layers.values():
        if str(layer.property("vp_name")).upper() in CUTS:
            lines += [[(p.real * MM_PER_PX, p.imag * MM_PER_PX) for p in line] for line in layer]
    return seen(lines)


def page_by_rsvg(file):
    """Width and height of the picture, in whole pixels at 96 per inch."""
    with tempfile.NamedTemporaryFile(suffix=".png") as picture:
        run("rsvg-convert", "-d", "96", "-p", "96", "-o", picture.name, file)
        header = Path(picture.name).read_bytes()[16:24]
    return [int.from_bytes(it, "big") * MM_PER_PX for it in (header[:4], header[4:])]


# -- PDF -----------------------------------------------------------------------------------------------------------------


def page_by_pdfinfo(file):
    size = re.search(r"Page size:\s+([\d.]+) x ([\d.]+) pts", run("pdfinfo", file))
    return [float(it) * MM_PER_PT for it in size.groups()]


# Name, ending, reader, largest difference of a side of the box, mm: what each program rounds to.
READERS = [
    ("GDAL", ".dxf", by_gdal, 1e-3),
    ("OpenSCAD", ".dxf", by_openscad, 2e-3),
    ("Inkscape's importer", ".dxf", by_inkscape_import, 1e-3),
    ("resvg", ".svg", by_resvg, 1e-3),
    ("Inkscape", ".svg", by_inkscape, 1e-2),
    ("vpype", ".svg", by_vpype, 1e-3),
]
PAGES = [("rsvg-convert", ".svg", page_by_rsvg, MM_PER_PX), ("pdfinfo", ".pdf", page_by_pdfinfo, 1e-2)]


def page_of_svg(file):
    root = re.search(r"<svg[^>]*>", Path(file).read_text())[0]
    return [float(re.search(rf' {side}="([\d.]+)mm"', root)[1]) for side in ("width", "height")]


def check(stem, worst, missing, faults):
    """One sheet or part in all its formats."""
    count, *box = by_ezdxf(f"{stem}.dxf")
    page = page_of_svg(f"{stem}.svg")
    for name, ending, read, limit in READERS + PAGES:
        file = f"{stem}{ending}"
        if name in missing or not Path(file).exists():
            continue
        whole = (name, ending, read, limit) in PAGES
        try:
            number, *size = (None, *read(file)) if whole else read(file)
        except Missing as what:
            missing.add(name)
            print(f"not installed: {what}")
            continue
        except (ValueError, TypeError, IndexError) as error:
            faults.append(f"{file}: {name}: {error}")
            continue
        off = max(abs(a - b) for a, b in zip(size, page if whole else box))
        files, before = worst.get(name, (0, 0.0))
        worst[name] = (files + 1, max(before, off))
        if number not in (None, count):
            faults.append(f"{file}: {name} sees {number} contours, ezdxf {count}")
        if not math.isfinite(off) or off > limit:
            faults.append(f"{file}: {name} sees {size} mm, expected {page if whole else box}")


def main():
    if len(sys.argv) < 2:
        sys.exit(__doc__)
    missing, faults = set(), []
    for out in map(Path, sys.argv[1:]):
        worst = {}
        files = [it for folder in ("sheets", "parts") for it in sorted((out / folder).glob("*.dxf")) if ".r12." not in it.name]
        for file in files:
            check(str(file.with_suffix("")), worst, missing, faults)
        sheets = json.loads((out / "report.json").read_text())["layout"]["sheets"]
        print(f"{out}: {sheets} sheets, {len(files) - sheets} parts")
        for name, (count, off) in worst.items():
            print(f"  {name}: {count} files, sides of the box within {off:.1e} mm")
    for fault in faults:
        print("  FAIL", fault)
    sys.exit(1 if faults else 0)


if __name__ == "__main__":
    main()
