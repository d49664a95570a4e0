#!/usr/bin/env python3
"""Pictures of README and guide: panels drawn by the program, side by side.

    python3 evidence/pictures.py PROGRAM            writes docs/pictures/*.svg
    python3 evidence/pictures.py PROGRAM --check    compares their texts with the present output of the program

PROGRAM is `tactile`. Every number in a picture comes from the program.
"""
import pathlib
import re
import subprocess
import sys
import tempfile

ROOT = pathlib.Path(__file__).resolve().parent.parent
PANEL = re.compile(r'<svg x="(\d+)" y="(\d+)" (width="560" height="420".*?</svg>)', re.S)
IMAGE = re.compile(r'<image x="(\d+)" y="(\d+)"[^>]*>')

# Picture: the calls that draw it, and the panels (call, file, number of the panel), with a heading if that of the panel is not
# sufficient.
PICTURES = {
    "press": (["measure"], [(0, "frames", 1, "1. frame"), (0, "surfaces", 1, "2. surface (apparent)"),
                            (0, "displacement", 0, "3. displacement and strain"), (0, "summary", 0, "4. modulus, beside the truth")]),
    "sensor": (["calibrate examples/data/sensor/calibration.toml"], [(0, "sensor", 0, ""), (0, "sensor", 1, "")]),
    "dark_gel": (["depth --reference examples/data/dark_reference.pgm --table examples/data/depth_table.csv --pixel-um 100 "
                  "examples/data/dark_frame.pgm --ball"], [(0, "dark_frame_depth", 0, ""), (0, "dark_frame_depth", 1, "")]),
    "strain": (["strain examples/data/before.csv examples/data/after.csv"], [(0, "strain", 0, ""), (0, "strain", 3, "")]),
    "scan": (["inclusion examples/data/inclusion/scan.toml"], [(0, "inclusion", 2, ""), (0, "inclusion", 3, "")]),
    "gel": (["depth --sensor examples/data/colour/sensor.toml examples/data/colour/press_6.png"], [(0, "press_6_depth", 0, "")]),
}


def panels_of(svg):
    """Every panel, moved to the origin, with the images in its box."""
    for x, y, panel in PANEL.findall(svg):
        x, y = int(x), int(y)
        inside = [m for m in IMAGE.finditer(svg) if x <= int(m[1]) < x + 560 and y <= int(m[2]) < y + 420]
        images = "\n".join(m[0].replace(f'x="{m[1]}" y="{m[2]}"', f'x="{int(m[1]) - x}" y="{int(m[2]) - y}"', 1) for m in inside)
        yield f"{images}\n<svg {panel}"


def picture(program, calls, panels):
    drawn = {}
    with tempfile.TemporaryDirectory() as folder:
        for k, call in enumerate(calls):
            out = pathlib.Path(folder) / str(k)
            # A calibration writes a file and its picture beside it.
            written = out / "sensor.toml" if call.startswith("calibrate") else out
            subprocess.run([program, *call.split(), "--out", written], cwd=ROOT, check=True, stdout=subprocess.DEVNULL)
            for path in out.glob("*.svg"):
                drawn[k, path.stem] = list(panels_of(path.read_text()))
    top = 40 if any(heading for *_, heading in panels) else 0
    columns = 2 if len(panels) > 1 else 1
    rows = -(-len(panels) // columns)
    width, height = 560 * columns, (420 + top) * rows
    lines = [f'<svg width="{width}" height="{height}" viewBox="0 0 {width} {height}" xmlns="http://www.w3.org/2000/svg">',
             f'<rect width="{width}" height="{height}" fill="white"/>']
    for k, (call, name, number, heading) in enumerate(panels):
        x, y = 560 * (k % columns), (420 + top) * (k // columns)
        if heading:
            lines.append(f'<text x="{x + 20}" y="{y + 28}" font-family="sans-serif" font-size="20">{heading}</text>')
        lines.append(f'<g transform="translate({x} {y + top})">{drawn[call, name][number]}</g>')
    return "\n".join([*lines, "</svg>", ""])


def texts(svg):
    return [" ".join(text.split()) for text in re.findall(r"<text[^>]*>(.*?)</text>", svg, re.S)]


def main():
    program, folder, differing = pathlib.Path(sys.argv[1]).resolve(), ROOT / "docs" / "pictures", []
    for name, (calls, panels) in PICTURES.items():
        path, svg = folder / f"{name}.svg", picture(program, calls, panels)
        if "--check" not in sys.argv:
            path.parent.mkdir(exist_ok=True)
            path.write_text(svg)
        elif not path.exists() or texts(path.read_text()) != texts(svg):
            differing.append(path.name)
    if differing:
        sys.exit(f"differ from what the program draws: {', '.join(differing)}; write them by evidence/pictures.py PROGRAM")


if __name__ == "__main__":
    main()
