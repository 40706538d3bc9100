"""Draws docs/architecture.svg, the way from input to verdict: ``python scripts/make_architecture.py``."""

from __future__ import annotations

from html import escape
from pathlib import Path

OUTPUT = Path(__file__).resolve().parent.parent / "docs" / "architecture.svg"
WIDTH, HEIGHT = 1000, 760
INK, LINE, PAPER = "#1f2933", "#7b8794", "#ffffff"
COLOURS = {"in": "#e3f0fb", "clamp": "#fdeed3", "scene": "#e5f4e3", "engine": "#eee9f9", "out": "#f1f3f5"}

# Kind, left, top, width, height, title, lines (a file, or a few words)
BOXES = {
    "built-in": ("in", 30, 60, 200, 70, "clamp", ("reference, clamp.toml",)),
    "toml": ("in", 280, 60, 200, 70, "scene", ("scene.toml",)),
    "mesh": ("in", 530, 60, 200, 70, "mesh, STEP", ("STL OBJ PLY GLB 3MF STEP",)),
    "python": ("in", 780, 60, 190, 70, "Python", ("Scene().add(...)",)),
    "load": ("scene", 30, 180, 700, 60, "load()", ("scenefile/load.py",)),
    "assemble": ("clamp", 30, 290, 330, 90, "assemble() -> Assembly", ("clamp/assemble.py", "clamp/final_state.py")),
    "scene": ("scene", 430, 290, 540, 90, "Scene: parts, poses, motions", ("engine/scene.py", "geometry/shapes.py")),
    "broad": ("engine", 30, 440, 150, 100, "near pairs", ("engine/broad.py", "boxes, R-tree")),
    "forms": (
        "engine",
        200,
        440,
        190,
        100,
        "kernel, pieces",
        ("kernel/distance.py", "engine/closed_form.py", "engine/convex.py"),
    ),
    "meshes": (
        "engine",
        410,
        440,
        195,
        100,
        "meshes",
        ("engine/mesh_distance.py", "engine/overlap.py", "FCL, manifold3d"),
    ),
    "exact": ("engine", 625, 440, 165, 100, "Open CASCADE", ("engine/exact.py", "files/cad_process.py")),
    "verdict": ("engine", 810, 440, 160, 100, "Distance, verdict", ("engine/answer.py", "engine/verdict.py")),
    "text": ("out", 30, 620, 210, 90, "text, JSON, table", ("output/scene_report.py", "output/run_report.py")),
    "report": ("out", 273, 620, 210, 90, "report()", ("output/report.py", "output/report_page.py")),
    "view": ("out", 516, 620, 210, 90, "view()", ("output/viewer.py", "output/viewer_scene.py")),
    "export": ("out", 760, 620, 210, 90, "export()", ("output/export.py", "output/step.py")),
}
# Points of each arrow, and a label with its place
ARROWS = [
    ([(130, 130), (130, 180)], ""),
    ([(380, 130), (380, 180)], ""),
    ([(630, 130), (630, 180)], ""),
    ([(875, 130), (875, 290)], ""),
    ([(195, 240), (195, 290)], "a clamp"),
    ([(580, 240), (580, 290)], "a scene"),
    ([(360, 335), (430, 335)], ".scene"),
    ([(700, 380), (700, 410), (105, 410), (105, 440)], ""),
    ([(180, 490), (200, 490)], ""),
    ([(390, 490), (410, 490)], ""),
    ([(605, 490), (625, 490)], ""),
    ([(790, 490), (810, 490)], ""),
    ([(890, 540), (890, 580), (135, 580), (135, 620)], ""),
    ([(378, 580), (378, 620)], ""),
    ([(621, 580), (621, 620)], ""),
    ([(865, 580), (865, 620)], ""),
]
NOTES = [
    (30, 40, "input of a command or a script"),
    (120, 430, "check(), measure(), distance() (engine/refine.py): the next level only while the verdict is open"),
    (30, 740, "one engine for every command; cli/ prints its results and sets the exit code"),
]


def text(x: float, y: float, content: str, *, size: int = 14, weight: str = "normal", anchor: str = "start") -> str:
    return (
        f'<text x="{x:g}" y="{y:g}" font-size="{size}" font-weight="{weight}" text-anchor="{anchor}" '
        f'fill="{INK}">{escape(content)}</text>'
    )


def draw() -> str:
    out = [
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {WIDTH} {HEIGHT}" font-family="sans-serif">',
        "<title>From input to verdict</title>",
        f'<rect width="{WIDTH}" height="{HEIGHT}" fill="{PAPER}"/>',
        '<defs><marker id="tip" viewBox="0 0 8 8" refX="7" refY="4" markerWidth="8" markerHeight="8" orient="auto">'
        f'<path d="M0 0 L8 4 L0 8 z" fill="{LINE}"/></marker></defs>',
    ]
    for points, label in ARROWS:
        path = " ".join(f"{x},{y}" for x, y in points)
        out.append(f'<polyline points="{path}" fill="none" stroke="{LINE}" stroke-width="1.6" marker-end="url(#tip)"/>')
        if label:
            (x0, y0), (x1, y1) = points[0], points[-1]
            right, down = (8, 5) if x0 == x1 else (-20, -8)
            out.append(text((x0 + x1) / 2 + right, (y0 + y1) / 2 + down, label, size=13))
    for kind, x, y, width, height, title, lines in BOXES.values():
        out.append(
            f'<rect x="{x}" y="{y}" width="{width}" height="{height}" rx="8" fill="{COLOURS[kind]}" stroke="{LINE}"/>'
        )
        out.append(text(x + width / 2, y + 26, title, size=16, weight="bold", anchor="middle"))
        out += [text(x + width / 2, y + 48 + 19 * i, line, anchor="middle") for i, line in enumerate(lines)]
    out += [text(x, y, note, size=13) for x, y, note in NOTES]
    return "\n".join([*out, "</svg>", ""])


if __name__ == "__main__":
    OUTPUT.write_text(draw(), encoding="utf-8")
