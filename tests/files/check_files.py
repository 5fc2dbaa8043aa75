#!/usr/bin/env python3
"""Reads the files of a job with programs that are not ours and holds them against report.json.

usage: check_files.py OUT_DIR...

DXF through ezdxf (strict read, audit) and shapely; SVG through xmllint and resvg; G-code and HPGL through small readers
written here. Every fault is printed; the exit code is 1 if there is one.
"""
import json
import math
import re
import subprocess
import sys
import xml.etree.ElementTree as ElementTree
from collections import Counter
from pathlib import Path

import ezdxf
from ezdxf import path as dxf_path
from shapely import STRtree
from shapely.geometry import LineString, Polygon
from shapely.validation import explain_validity

# A coordinate in a file may differ by this much from the report, mm.
LIMIT = 1e-3
# Kerf, the blade's offset and its overcut move toolpaths away from the drawing by less than this, mm.
TOOL_LIMIT = 2.0
# What a boundary of cuts is called by the built-in profiles.
CUT, INNER = "CUT", "CUT_INNER"
# A line of 100 mm to measure a print or a cut by; no part of the job.
CHECK = "CHECK"
MM_PER_PX = 25.4 / 96
SVG = "{http://www.w3.org/2000/svg}"
INKSCAPE = "{http://www.inkscape.org/namespaces/inkscape}"


class Faults:
    """Collects what is wrong, file by file."""

    def __init__(self):
        self.found = []
        self.place = ""

    def __call__(self, text):
        self.found.append(f"{self.place}: {text}")

    def unless(self, holds, text):
        if not holds:
            self(text)


def near(a, b, limit=LIMIT):
    return len(a) == len(b) and all(abs(x - y) <= limit for x, y in zip(a, b))


# -- the report ----------------------------------------------------------------------------------------------------------


class Expected:
    """What the report promises."""

    def __init__(self, report):
        layout = report["layout"]
        self.sheets = layout["sheets"]
        self.size = layout["sheet_mm"]
        self.placed = layout["placed"]
        limits = {check["name"]: check["limit"] for check in report["checks"]}
        self.gap = limits.get("nest.gap", 0.0)
        self.margin = limits.get("nest.margin", 0.0)

    def on_sheet(self, number):
        return [part for part in self.placed if part["sheet"] == number]

    def named(self, stem):
        """The part that a file in parts/ shows; None for a part that lies on no sheet."""
        plain = lambda name: re.sub(r"[^A-Za-z0-9._-]", "-", name)
        found = [part for part in self.placed if stem.startswith(plain(part["name"]) + "_")]
        return max(found, key=lambda part: len(part["name"]), default=None)


# -- lines, whatever file they come from ---------------------------------------------------------------------------------


def contours_and_marks(lines, fault):
    """Splits (layer, points, closed) into polygons of the cuts and the lines of everything else."""
    polygons, marks = [], []
    for layer, points, closed in lines:
        if layer == CHECK:
            continue
        if layer not in (CUT, INNER):
            marks.append(LineString(points + points[:1] if closed else points))
            continue
        if not closed:
            fault(f"an open line on {layer} at {points[0]}")
            continue
        polygon = Polygon(points)
        if polygon.is_valid:
            polygons.append((layer, polygon))
        else:
            fault(f"a contour on {layer} is not simple: {explain_validity(polygon)}")
    return polygons, marks


def check_segments(lines, fault):
    """No segment of length zero, none twice."""
    seen = Counter()
    for layer, points, closed in lines:
        ends = points + points[:1] if closed else points
        for a, b in zip(ends, ends[1:]):
            key = tuple(sorted([(round(a[0], 4), round(a[1], 4)), (round(b[0], 4), round(b[1], 4))]))
            if key[0] == key[1]:
                fault(f"a segment of length zero on {layer} at {key[0]}")
            seen[key] += 1
    for key, count in seen.items():
        fault.unless(count == 1, f"the segment {key} is there {count} times")


def check_nesting(polygons, expected, fault):
    """Contours apart, inside the margins; holes on the layer of inner cuts. Returns depth of each polygon."""
    shapes = [polygon for _, polygon in polygons]
    tree = STRtree(shapes)
    depth = [0] * len(shapes)
    for i, shape in enumerate(shapes):
        for j in tree.query(shape, predicate="contains"):
            depth[j] += int(j) != i
    for i, (layer, shape) in enumerate(polygons):
        fault.unless((layer == INNER) == (depth[i] % 2 == 1), f"a contour {depth[i]} deep is on layer {layer}")
        for j in tree.query(shape.buffer(expected.gap + 1)):
            if j <= i:
                continue
            other = shapes[j]
            inner = i if depth[i] > depth[j] else j
            of_one_part = abs(depth[i] - depth[j]) == 1 and depth[inner] % 2 == 1
            distance = shape.boundary.distance(other.boundary)
            if shape.boundary.intersects(other.boundary):
                fault(f"contours {i} and {j} touch or cross near {shape.boundary.intersection(other.boundary).bounds}")
            elif not of_one_part and distance < expected.gap - 1e-6:
                fault(f"contours {i} and {j} are {distance:.6f} mm apart, promised {expected.gap}")
        if depth[i] % 2 == 0:
            x0, y0, x1, y1 = shape.bounds
            room = min(x0, y0, expected.size[0] - x1, expected.size[1] - y1)
            fault.unless(room >= expected.margin - LIMIT, f"a part is {room:.4f} mm from the edge, promised {expected.margin}")
    return depth


def check_parts(polygons, depth, rows, fault):
    """Every row of the report has its contours in the file, and nothing else is there."""
    outer = [shape for (_, shape), level in zip(polygons, depth) if level % 2 == 0]
    fault.unless(len(outer) == len(rows), f"{len(outer)} parts, the report says {len(rows)}")
    holes = sum(level % 2 for level in depth)
    promised = sum(row["holes"] for row in rows)
    fault.unless(holes == promised, f"{holes} holes, the report says {promised}")
    for row in rows:
        if not any(near(shape.bounds, row["box_mm"]) for shape in outer):
            fault(f"no contour has the box of part {row['name']}: {row['box_mm']}")
    area = sum(shape.area * (-1) ** level for (_, shape), level in zip(polygons, depth))
    promised = sum(row["area_mm2"] for row in rows)
    edge = sum(shape.length for _, shape in polygons)
    fault.unless(abs(area - promised) <= LIMIT * edge, f"cut area {area:.4f} mm², the report says {promised:.4f}")


# -- DXF -----------------------------------------------------------------------------------------------------------------


def read_dxf(file, fault):
    document = ezdxf.readfile(file)
    audit = document.audit()
    for found in audit.errors + audit.fixes:
        fault(f"audit {found.code}: {found.message}")
    old = str(file).endswith(".r12.dxf")
    version = "AC1009" if old else "AC1015"
    fault.unless(document.dxfversion == version, f"version {document.dxfversion}, expected {version}")
    for name, value in (("$INSUNITS", 4), ("$MEASUREMENT", 1)):
        fault.unless(document.header.get(name) == value, f"{name} is {document.header.get(name)}, expected {value}")
    layers = {layer.dxf.name for layer in document.layers}
    lines = []
    for entity in document.modelspace():
        kind = entity.dxftype()
        if kind not in (("POLYLINE",) if old else ("LWPOLYLINE", "CIRCLE", "ARC")):
            fault(f"a {kind} on {entity.dxf.layer}")
            continue
        fault.unless(entity.dxf.layer in layers, f"layer {entity.dxf.layer} is not in the table")
        points = [(p.x, p.y) for p in dxf_path.make_path(entity).flattening(0.001)]
        if not all(math.isfinite(c) for point in points for c in point):
            fault(f"a {kind} with a coordinate that is not finite")
            continue
        closed = kind == "CIRCLE" or (kind == "LWPOLYLINE" and entity.closed) or (kind == "POLYLINE" and entity.is_closed)
        if closed and points[0] == points[-1]:
            points.pop()
        lines.append((entity.dxf.layer, points, closed))
    return lines


# -- SVG -----------------------------------------------------------------------------------------------------------------


def read_svg(file, fault):
    """Page size and lines, y up, by a reader that knows nothing but what our files may hold."""
    done = subprocess.run(["xmllint", "--noout", file], capture_output=True, text=True)
    fault.unless(done.returncode == 0, f"xmllint: {done.stderr.strip()}")
    root = ElementTree.parse(file).getroot()
    size = [float(root.get(name).removesuffix("mm")) for name in ("width", "height")]
    fault.unless(near([float(it) for it in root.get("viewBox").split()], [0, 0, *size], 0), "the viewBox is not the page in mm")
    lines, colors = [], {}
    for layer in root:
        if layer.tag != SVG + "g" or layer.get(INKSCAPE + "groupmode") != "layer":
            fault(f"{layer.tag} outside any layer")
            continue
        name = layer.get(INKSCAPE + "label")
        for item in layer:
            wrong = set(item.keys()) - {"d", "fill", "stroke", "stroke-width"}
            if item.tag != SVG + "path" or wrong or item.get("fill") != "none":
                fault(f"{item.tag} on {name} with {sorted(wrong)}: importers may read it differently")
                continue
            colors.setdefault(name, set()).add(item.get("stroke"))
            data = item.get("d")
            fault.unless(re.fullmatch(r"M[-\d.,]+( L?[-\d.,]+)+( Z)?", data), f"path data on {name}: {data[:60]}")
            points = [tuple(map(float, pair.split(","))) for pair in re.findall(r"-?[\d.]+,-?[\d.]+", data)]
            lines.append((name, [(x, size[1] - y) for x, y in points], data.endswith("Z")))
    owners = Counter(color for stroke in colors.values() for color in stroke)
    fault.unless(all(len(it) == 1 for it in colors.values()), f"a layer in several colours: {colors}")
    fault.unless(max(owners.values(), default=1) == 1, f"layers that share a colour: {colors}")
    return size, lines


def check_resvg(file, size, lines, fault):
    """The page and the box of every layer of closed lines as resvg measures them."""
    # A filled shape has the box of its points; a stroked one also that of its width and its mitres.
    text = Path(file).read_text()
    text = re.sub(r'fill="none" stroke="[^"]*" stroke-width="[^"]*"', 'fill="#000000"', text)
    resvg = Path(sys.executable).parent / "resvg"
    run = lambda *args: subprocess.run(
        [resvg if resvg.exists() else "resvg", *args], input=text, capture_output=True, text=True
    )
    done = run("--query-all", "-")
    if done.returncode != 0:
        return fault(f"resvg: {done.stderr.strip()}")
    boxes = {name: [float(it) * MM_PER_PX for it in box] for name, *box in (row.split(",") for row in done.stdout.split())}
    for layer in {name for name, _, _ in lines}:
        if not all(closed for name, _, closed in lines if name == layer):
            continue
        points = [point for name, line, _ in lines if name == layer for point in line]
        x0, x1 = min(p[0] for p in points), max(p[0] for p in points)
        y0, y1 = min(p[1] for p in points), max(p[1] for p in points)
        box = boxes.get(layer.lower(), [])
        # Its coordinates are f32, in pixels, printed with three decimals.
        fault.unless(
            near(box, [x0, size[1] - y1, x1 - x0, y1 - y0], LIMIT), f"resvg sees layer {layer} at {box} mm, drawn at {[x0, y0, x1, y1]}"
        )
    picture = Path(file).with_suffix(".resvg.png")
    done = run("-", str(picture))
    if done.returncode != 0:
        return fault(f"resvg: {done.stderr.strip()}")
    header = picture.read_bytes()[16:24]
    picture.unlink()
    pixels = [int.from_bytes(header[:4], "big"), int.from_bytes(header[4:], "big")]
    fault.unless(near(pixels, [round(it / MM_PER_PX) for it in size], 1), f"resvg draws {pixels} pixels for {size} mm")


def same_lines(a, b):
    """Whether two lists of lines are the same line by line, within what rounding may do."""
    return len(a) == len(b) and all(
        one[0] == other[0] and one[2] == other[2] and len(one[1]) == len(other[1]) and all(map(near, one[1], other[1]))
        for one, other in zip(a, b)
    )


# -- programs ------------------------------------------------------------------------------------------------------------


def arc(start, end, offset, turn):
    """Points of a circular arc after its start; `turn` is 1 counter-clockwise, -1 clockwise."""
    x, y = start[0] + offset[0], start[1] + offset[1]
    radius = math.hypot(*offset)
    a, b = math.atan2(start[1] - y, start[0] - x), math.atan2(end[1] - y, end[0] - x)
    sweep = turn * ((turn * (b - a)) % math.tau or math.tau)
    steps = max(2, math.ceil(abs(sweep) / 0.05))
    angles = [a + sweep * k / steps for k in range(1, steps)]
    return [(x + radius * math.cos(it), y + radius * math.sin(it)) for it in angles] + [tuple(end)]


def read_gcode(file, fault):
    """Strokes with the tool at work, by a reader that knows no more G-code than our files may hold."""
    raw = Path(file).read_bytes()
    fault.unless(raw.isascii() and b"\r" not in raw and raw.endswith(b"M2\n"), "not plain ASCII with LF that ends in M2")
    text = raw.decode("ascii", "replace")
    code = [re.sub(r"\([^)]*\)", "", line).strip() for line in text.split("\n")]
    fault.unless(max(map(len, text.split("\n"))) <= 79, "a line of 80 characters or more")
    fault.unless([it for it in code if it][0] == "G21 G90 G94 G17 G54", "the header is not G21 G90 G94 G17 G54")
    laser = any(it.startswith("M4") for it in code)
    z_axis = any("Z" in it for it in code)
    at, motion, power, on, z, feed = [None, None], None, 0.0, False, math.inf, None
    up = None
    strokes, down, cuts_on_rapids = [], False, 0
    for number, line in enumerate(code, 1):
        words = re.findall(r"([A-Z])(-?\d+(?:\.\d+)?)", line)
        if "".join(letter + value for letter, value in words) != line.replace(" ", ""):
            fault(f"line {number} holds something else than words: {line}")
        before, center = list(at), [0.0, 0.0]
        for letter, value in words:
            value = float(value)
            if letter == "G" and value in (0, 1, 2, 3):
                motion = value
            elif letter == "G":
                fault.unless(value in (4, 17, 21, 54, 90, 94), f"line {number}: G{value:g}")
            elif letter == "M":
                fault.unless(value in (0, 2, 3, 4, 5), f"line {number}: M{value:g}")
                on = value in (3, 4) if value in (3, 4, 5) else on
            elif letter == "X":
                at[0] = value
            elif letter == "Y":
                at[1] = value
            elif letter == "Z":
                z = value
            elif letter == "S":
                power = value
                up = power if up is None else up
            elif letter == "F":
                feed = value
            elif letter in "IJ" and motion in (2, 3):
                center["IJ".index(letter)] = value
            else:
                fault.unless(letter == "P", f"line {number}: {letter}")
        z_up = max((float(it) for it in re.findall(r"Z(-?[\d.]+)", text)), default=0)
        working = z < z_up if z_axis else on and (power > 0 if laser else power != up)
        moved = at != before
        if moved and working and motion == 0:
            cuts_on_rapids += 1
        fault.unless(not (moved and working) or feed, f"line {number}: no feed rate")
        if working:
            if not down:
                strokes.append([tuple(before if moved else at)])
            if moved and motion in (2, 3):
                strokes[-1] += arc(before, at, center, -1 if motion == 2 else 1)
            elif moved:
                strokes[-1].append(tuple(at))
        down = working
    fault.unless(cuts_on_rapids == 0, f"{cuts_on_rapids} rapids with the tool at work")
    fault.unless(not on and (not z_axis or z >= 0), "the tool is on at the end")
    return [stroke for stroke in strokes if len(stroke) > 1]


def read_hpgl(file, fault):
    strokes, at, down = [], None, False
    for number, command in enumerate(Path(file).read_text("ascii").splitlines(), 1):
        found = re.fullmatch(r"(IN|PA|PU|PD|SP)(-?\d+)?(?:,(-?\d+))?;", command)
        if not found:
            fault(f"line {number}: {command}")
            continue
        name, x, y = found.groups()
        if name in ("PU", "PD") and y is not None:
            to = (int(x) / 40, int(y) / 40)
            if name == "PD":
                strokes[-1].append(to) if down else strokes.append([at, to])
            at = to
        down = name == "PD"
    fault.unless(not down, "the tool is down at the end")
    return strokes


def check_toolpaths(strokes, lines, expected, fault):
    """The program does what the drawing shows, but for what kerf and a trailing blade ask for."""
    # A trailing blade is first turned by a short stroke in the empty margin, away from all that is drawn.
    in_margin = lambda stroke: all(min(p) < expected.margin for p in stroke)
    strokes = [it for it in strokes if not in_margin(it)]
    # The work zero may be any corner of the sheet: the boxes must agree up to that move.
    flat = [p for stroke in strokes for p in stroke]
    drawn = [p for _, line, _ in lines for p in line]
    for axis, name in enumerate("xy"):
        low, high = min(p[axis] for p in flat), max(p[axis] for p in flat)
        meant = [min(p[axis] for p in drawn), max(p[axis] for p in drawn)]
        size = expected.size[axis]
        moves = [(low, high), (low + size, high + size), (-high, -low), (size - high, size - low)]
        if not any(near(it, meant, TOOL_LIMIT) for it in moves):
            fault(f"{name} runs from {low} to {high}, the drawing from {meant[0]:.3f} to {meant[1]:.3f}")
    length = sum(LineString(it).length for it in strokes)
    meant = sum(LineString(it + it[:1] if closed else it).length for _, it, closed in lines)
    fault.unless(length >= 0.98 * meant, f"{length:.1f} mm of work for {meant:.1f} mm of lines")


# -- a job ---------------------------------------------------------------------------------------------------------------


def check_sheet(out, number, formats, expected, fault):
    rows = expected.on_sheet(number)
    base = out / "sheets" / f"sheet-{number:02}"
    drawn = {}
    if "dxf" in formats:
        fault.place = f"{base}.dxf"
        drawn["dxf"] = read_dxf(f"{base}.dxf", fault)
    if "svg" in formats:
        fault.place = f"{base}.svg"
        size, drawn["svg"] = read_svg(f"{base}.svg", fault)
        fault.unless(near(size, expected.size), f"the page is {size} mm, the sheet {expected.size}")
        check_resvg(f"{base}.svg", size, drawn["svg"], fault)
    for name, lines in drawn.items():
        fault.place = f"{base}.{name}"
        lengths = [math.dist(*points) for layer, points, _ in lines if layer == CHECK and len(points) == 2]
        fault.unless(expected.size[0] < 130 or any(abs(it - 100) <= LIMIT for it in lengths), "no check line of 100 mm")
        check_segments(lines, fault)
        polygons, marks = contours_and_marks(lines, fault)
        depth = check_nesting(polygons, expected, fault)
        check_parts(polygons, depth, rows, fault)
        promised = sum(sum(row["marks"].values()) for row in rows)
        fault.unless(len(marks) == promised, f"{len(marks)} marks, the report says {promised}")
    if len(drawn) == 2:
        fault.unless(same_lines(drawn["dxf"], drawn["svg"]), "SVG and DXF do not show the same lines in the same order")
    for name, ending, read in (("gcode", "nc", read_gcode), ("hpgl", "plt", read_hpgl)):
        if name in formats:
            fault.place = f"{base}.{ending}"
            strokes = read(f"{base}.{ending}", fault)
            if drawn and strokes:
                cuts = [line for line in next(iter(drawn.values())) if line[0] != CHECK]
                check_toolpaths(strokes, cuts, expected, fault)
            fault.unless(strokes, "nothing is cut")


def check_part(file, expected, fault):
    fault.place = str(file)
    stem = re.sub(r"(\.r12|\.a4|\.letter)?\.[a-z]+$", "", file.name)
    match = re.fullmatch(r".+_.+_[\d.]+mm_q\d+", stem)
    fault.unless(match, "the name is not NAME_MATERIAL_THICKNESSmm_qN")
    if file.suffix == ".dxf":
        lines = read_dxf(str(file), fault)
    else:
        size, lines = read_svg(str(file), fault)
        check_resvg(str(file), size, lines, fault)
    check_segments(lines, fault)
    polygons, marks = contours_and_marks(lines, fault)
    row = expected.named(stem)
    if row is None:
        return
    outer = [shape for layer, shape in polygons if layer == CUT]
    holes = [shape for layer, shape in polygons if layer == INNER]
    fault.unless(len(outer) == 1 and len(holes) == row["holes"], f"{len(outer)} outlines and {len(holes)} holes for {row}")
    area = sum(it.area for it in outer) - sum(it.area for it in holes)
    edge = sum(shape.length for _, shape in polygons)
    fault.unless(abs(area - row["area_mm2"]) <= LIMIT * edge, f"area {area:.4f} mm², the report says {row['area_mm2']:.4f}")
    fault.unless(len(marks) == sum(row["marks"].values()), f"{len(marks)} marks, the report says {row['marks']}")


def check_job(out, fault):
    fault.place = str(out / "report.json")
    report = json.loads((out / "report.json").read_text())
    for entry in report["files"]:
        file = out / entry["path"]
        if not file.is_file():
            fault(f"{entry['path']} is not there")
        elif file.stat().st_size != entry["bytes"]:
            fault(f"{entry['path']} has {file.stat().st_size} bytes, the report says {entry['bytes']}")
    if "layout" not in report:
        return fault("there is no layout, so there is nothing to cut")
    expected = Expected(report)
    formats = {entry["format"] for entry in report["files"] if entry["path"].startswith("sheets/")}
    fault.unless(formats, "no file in sheets/")
    listed = {entry["path"] for entry in report["files"]}
    for file in sorted([*out.glob("sheets/*"), *out.glob("parts/*")]):
        fault.unless(file.relative_to(out).as_posix() in listed, f"{file.name} is not in the report: left from another job?")
    for number in range(1, expected.sheets + 1):
        check_sheet(out, number, formats, expected, fault)
    parts = sorted(out.glob("parts/*"))
    fault.place = str(out / "parts")
    names = {file.stem for file in parts}
    fault.unless(len(names) >= len(expected.placed), f"{len(names)} parts in files, {len(expected.placed)} on sheets")
    for file in parts:
        if file.suffix in (".dxf", ".svg"):
            check_part(file, expected, fault)
    print(f"{out}: {expected.sheets} sheets, {len(expected.placed)} parts, formats {', '.join(sorted(formats))}")


def main():
    if len(sys.argv) < 2:
        sys.exit(__doc__)
    fault = Faults()
    for out in map(Path, sys.argv[1:]):
        before = len(fault.found)
        try:
            check_job(out, fault)
        except (OSError, KeyError, ValueError, TypeError, ezdxf.DXFError, ElementTree.ParseError) as error:
            fault(f"{type(error).__name__}: {error}")
        for text in fault.found[before:]:
            print("  FAIL", text)
    sys.exit(1 if fault.found else 0)


if __name__ == "__main__":
    main()
