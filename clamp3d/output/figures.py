"""Pictures of a run in the section: one state, both states side by side, the five arc contacts.

Each function returns a matplotlib figure (no pyplot, no window); `save_figure` writes it as SVG, PNG or PDF.
"""

from __future__ import annotations

import io
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from clamp3d.checks import instance, whole
from clamp3d.checks import path as checked_path
from clamp3d.clamp.contact import Contact
from clamp3d.clamp.dimensions import TOUCHING, Clamp
from clamp3d.clamp.result import Assembly, Waypoint
from clamp3d.engine.verdict import Thresholds
from clamp3d.errors import InputError, need
from clamp3d.output.files import STDOUT, whole_file
from clamp3d.output.palette import INK, VERDICT_COLOURS
from clamp3d.output.section import Poses, draw_dimensions, draw_labels, draw_section, edge_openings, label_wires, note
from clamp3d.output.wording import distance_text

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

FORMATS = (".svg", ".png", ".pdf")


def blank(width: float, height: float) -> Figure:
    """An empty figure, inch, whose axes leave space for what is around them."""
    need("matplotlib", "a drawing")
    from matplotlib.figure import Figure

    return Figure(figsize=(width, height), layout="constrained")


def save_figure(figure: Figure, path: str | Path, *, dpi: int = 150) -> Path:
    """Write ``figure`` to ``path`` by its suffix (``-``: SVG), whole or not at all; equal figures give equal files.

    Raises InputError for a suffix other than .svg, .png, .pdf and for a folder that cannot be written.
    """
    from matplotlib.figure import Figure

    instance("figure", figure, Figure)
    path, dpi = checked_path("figure file", path), whole("dpi", dpi, least=1)
    suffix = ".svg" if path == STDOUT else path.suffix.lower()
    if suffix not in FORMATS:
        raise InputError(f"figure file must end in {', '.join(FORMATS)}, got {path.name!r}")
    with whole_file(path) as temporary:
        temporary.write_bytes(picture(figure, suffix[1:], dpi))
    return path


def picture(figure: Figure, format: str, dpi: int = 100) -> bytes:
    """The figure as a file of a format ("svg", "png", "pdf"), without the time: equal figures give equal files."""
    import matplotlib as mpl

    metadata: dict[str, Any] = {"svg": {"Date": None}, "pdf": {"CreationDate": None}}.get(format, {})
    out = io.BytesIO()
    with mpl.rc_context({"svg.hashsalt": "clamp3d"}):
        figure.savefig(out, format=format, dpi=dpi, metadata=metadata)
    return out.getvalue()


def section_figure(run: Assembly, waypoint: Waypoint | None = None) -> Figure:
    """The section at ``waypoint`` (by default the final state) to scale: names, dimensions, contact points."""
    instance("run", run, Assembly)
    if waypoint is not None:
        instance("waypoint", waypoint, Waypoint)
    figure = blank(8.0, 7.0)
    ax = figure.add_subplot()
    poses = near(run.clamp, run.poses if waypoint is None else waypoint.poses)
    draw_section(ax, run.clamp, poses)
    draw_labels(ax, run.clamp, poses)
    draw_dimensions(ax, run.clamp, poses)
    if waypoint is None:
        _draw_points(ax, _arc_contacts(run))
    title(ax, "final state" if waypoint is None else waypoint.label, f"{run.clamp.name} clamp, section to scale, mm")
    return figure


def states_figure(run: Assembly) -> Figure:
    """Initial and final state side by side at one scale, as in Fig. 2 of the paper."""
    instance("run", run, Assembly)
    figure = blank(11.5, 5.8)
    axes = figure.subplots(1, 2)
    names = ("(a) initial state", "(b) final state")
    for ax, all_poses, name in zip(axes, (run.path[0].poses, run.poses), names, strict=True):
        poses = near(run.clamp, all_poses)
        draw_section(ax, run.clamp, poses)
        draw_dimensions(ax, run.clamp, poses, sides=(-1, 1) if ax is axes[1] else (1,))
        title(ax, name, f"distance between the splints {edge_openings(run.clamp, poses)[0]:.3f} mm")
    label_wires(axes[0], near(run.clamp, run.path[0].poses))
    draw_labels(axes[1], run.clamp, run.poses)
    _draw_points(axes[1], _arc_contacts(run))
    same_scale(axes)
    return figure


def contacts_figure(run: Assembly) -> Figure:
    """The concave arc contacts in the section, as in Fig. 5, and each enlarged with its relation and gap."""
    instance("run", run, Assembly)
    figure = blank(11.5, 5.8)
    contacts = _arc_contacts(run)
    rows = max(1, (len(contacts) + 1) // 2)
    grid = figure.add_gridspec(rows, 3, width_ratios=(2.1, 1.0, 1.0))
    overview = figure.add_subplot(grid[:, 0])
    draw_section(overview, run.clamp, run.poses)
    title(
        overview, "concave arc contacts", f"{run.clamp.name} clamp, final state; dot: contact point, arrow: its normal"
    )
    for i, contact in enumerate(contacts):
        _draw_points(overview, [contact], size=5.0)
        if contact.point is not None:
            x, y = float(contact.point[0]), -float(contact.point[2])
            aside = x + (1 if i % 2 else -1) * 0.09 * run.clamp.up_splint.width
            overview.plot([x, aside], [y, y], color=INK, lw=0.8, zorder=45)
            numbered(overview, i + 1, (aside, y))
        _enlarge(figure.add_subplot(grid[i // 2, 1 + i % 2]), run, contact, f"{i + 1}  ")
    return figure


def contact_figure(run: Assembly, contact: Contact) -> Figure:
    """One contact of ``run``: where it is in the section, dimensioned, and enlarged with relation, gap and normal."""
    instance("run", run, Assembly)
    instance("contact", contact, Contact)
    figure = blank(9.0, 4.6)
    overview, close = figure.subplots(1, 2, width_ratios=(1.4, 1.0))
    draw_section(overview, run.clamp, run.poses)
    label_wires(overview, run.poses)
    draw_dimensions(overview, run.clamp, run.poses)
    _draw_points(overview, [contact])
    _enlarge(close, run, contact)
    return figure


def _enlarge(ax: Axes, run: Assembly, contact: Contact, number: str = "") -> None:
    """The two parts about their contact point; grooves in the section beside the bolt, where they are whole."""
    half = 0.045 * run.clamp.up_splint.width
    below = distance_text(contact.distance)
    in_arc = 3 in (contact.declared, contact.type)  # along a line, the section too
    if contact.point is not None and abs(contact.point[1]) > TOUCHING and not in_arc:
        below += f", {abs(contact.point[1]):.1f} mm {'before' if contact.point[1] < 0.0 else 'behind'} the section"
    if contact.normal is not None and abs(contact.normal[1]) > 0.7:
        half *= 4.0  # nearest across the section: a bolt in its hole, which is seen whole
    heading = f"{number}{contact.a} and {contact.b}: {contact.relation.replace('none', 'apart')}"
    ax.set_title(f"{heading}\n{below}", fontsize=8, loc="left", color=INK)
    ax.set(xticks=[], yticks=[])
    if contact.point is None:
        return
    x, y = float(contact.point[0]), -float(contact.point[2])
    draw_section(ax, run.clamp, run.poses, only=(contact.a, contact.b), holes=not in_arc, line_width=1.6)
    _draw_points(ax, [contact], size=7.0)
    if contact.normal is not None:
        tip = {"arrowstyle": "-|>,head_width=0.2,head_length=0.5", "color": INK, "lw": 1.2, "shrinkB": 0}
        end = x + 0.6 * half * float(contact.normal[0]), y - 0.6 * half * float(contact.normal[2])
        ax.annotate("", end, (x, y), arrowprops=tip, zorder=42)
    ax.set_axis_on()
    ax.set_xbound(x - 1.5 * half, x + 1.5 * half)
    ax.set_ybound(y - half, y + half)


def numbered(ax: Axes, number: int, at: tuple[float, float], colour: str = INK, offset: float = 0.0) -> None:
    """A number in a circle at a point, ``offset`` (pt) up and to the right of it."""
    box = {"boxstyle": "circle,pad=0.25", "fc": "white", "ec": colour, "lw": 1.2}
    style: dict[str, Any] = {"ha": "center", "va": "center", "fontsize": 8.5, "fontweight": "bold", "zorder": 46}
    note(ax, str(number), at, (offset, offset), bbox=box, **style)


def title(ax: Axes, text: str, below: str = "") -> None:
    """A bold title and a smaller line under it, on the left."""
    ax.set_title(f"{text}\n", fontsize=11, fontweight="bold", loc="left", color=INK)
    note(ax, below, (0.0, 1.0), (0.0, 8.0), xycoords="axes fraction", fontsize=8.5, va="bottom")


def near(clamp: Clamp, poses: Poses) -> dict[Any, Any]:
    """The poses without wires that are still far away from the clamp."""
    middle = poses["P1"].x + clamp.up_splint.width / 2
    return {name: pose for name, pose in poses.items() if abs(pose.x - middle) < 0.9 * clamp.up_splint.width}


def same_scale(axes: Sequence[Axes]) -> None:
    """Give axes of one size windows of one size: equal heights, and equal widths about their own middle."""
    from matplotlib.transforms import Bbox

    window = Bbox.union([ax.viewLim for ax in axes])
    width = max(abs(ax.viewLim.width) for ax in axes)
    for ax in axes:
        middle = 0.5 * sum(ax.get_xbound())
        ax.set_xbound(middle - width / 2, middle + width / 2)
        ax.set_ybound(window.ymin, window.ymax)


def _arc_contacts(run: Assembly) -> list[Contact]:
    return [contact for contact in run.contacts if 3 in (contact.declared, contact.type)]


def _draw_points(ax: Axes, contacts: Sequence[Contact], *, size: float = 6.0) -> None:
    """Dots at the contacts' points, in the colours of their verdicts."""
    for contact in contacts:
        if contact.point is not None:
            verdict = Thresholds(contact=TOUCHING).verdict(contact.distance)
            style: dict[str, Any] = {"ms": size, "mec": INK, "mew": 0.7, "mfc": VERDICT_COLOURS[verdict]}
            ax.plot([contact.point[0]], [-contact.point[2]], "o", **style, zorder=40, clip_on=False)
