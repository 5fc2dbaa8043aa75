"""Writes a bumpy ball of 100 350 faces as OBJ, the largest mesh that the report page is tested with: large_mesh.py FILE"""

import math
import sys

RINGS, SEGMENTS = 224, 225


def main(path):
    def place(ring, segment):
        polar, around = math.pi * ring / RINGS, 2 * math.pi * segment / SEGMENTS
        radius = 60 * (1 + 0.12 * math.sin(3 * around) * math.sin(polar) ** 2 + 0.1 * math.cos(4 * polar))
        return (
            radius * math.sin(polar) * math.cos(around),
            1.3 * radius * math.cos(polar),
            radius * math.sin(polar) * math.sin(around),
        )

    top, bottom = 1, 2

    def index(ring, segment):
        return 3 + (ring - 1) * SEGMENTS + segment % SEGMENTS

    with open(path, "w", encoding="ascii") as out:
        rows = [place(0, 0), place(RINGS, 0)]
        rows += [place(ring, segment) for ring in range(1, RINGS) for segment in range(SEGMENTS)]
        out.writelines(f"v {x:.6f} {y:.6f} {z:.6f}\n" for x, y, z in rows)
        for segment in range(SEGMENTS):
            out.write(f"f {top} {index(1, segment + 1)} {index(1, segment)}\n")
            out.write(f"f {bottom} {index(RINGS - 1, segment)} {index(RINGS - 1, segment + 1)}\n")
            for ring in range(1, RINGS - 1):
                a, b = index(ring, segment), index(ring, segment + 1)
                c, d = index(ring + 1, segment), index(ring + 1, segment + 1)
                out.write(f"f {a} {b} {d}\nf {a} {d} {c}\n")


if __name__ == "__main__":
    main(sys.argv[1])
