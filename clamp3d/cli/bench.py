"""Experiments on the methods: ``clamp3d compare``, ``reproduce``, ``stress`` and ``measure-image``."""

from __future__ import annotations

from dataclasses import asdict
from pathlib import Path
from typing import Literal

import click

from clamp3d.cli.options import INPUT_FILE, JSON, PICTURE, Output, Quiet, argument, command, number, option
from clamp3d.cli.terminal import bar, command_line, finish, save, show
from clamp3d.errors import InputError


@command("compare")
class Compare(Quiet):
    """Measure every contact method on the same poses and the same assembly: accuracy against speed.

    Takes some minutes. Each method runs in a process of its own; one that fails or does not finish is a row that says
    so.
    """

    json_file: Path | None = JSON
    plot_file: Path | None = option(
        "Draw the chart: .png, .svg or .html.", "--plot", type=Output((".png", ".svg", ".html"))
    )
    peers: bool = option("Also measure coal, python-fcl, trimesh, MuJoCo, manifold3d and Open CASCADE.")

    def run(self) -> None:
        """Measure, print and draw."""
        from clamp3d.bench.compare.chart import save_comparison
        from clamp3d.bench.compare.report import comparison_to_dict, comparison_to_text
        from clamp3d.bench.compare.run import compare

        with bar(self.quiet) as report:
            comparison = compare(peers=self.peers, progress=lambda done, total, what: report(what, done, total))
        show(comparison_to_text(comparison))
        save(self.json_file, lambda: comparison_to_dict(comparison))
        if self.plot_file is not None:
            save_comparison(comparison, self.plot_file, command_line())


@command("reproduce")
class Reproduce(Quiet):
    """Print Tables 1-5 of the paper beside this program's values, with the difference of each."""

    json_file: Path | None = JSON

    def run(self) -> None:
        """Compute and print."""
        from clamp3d.bench.reproduce import reproduce
        from clamp3d.bench.reproduce_report import reproduction_to_dict, reproduction_to_text

        tables = reproduce(lambda message: None if self.quiet else click.echo(message, err=True))
        save(self.json_file, lambda: reproduction_to_dict(tables))
        show(reproduction_to_text(tables))


@command("stress")
class Stress(Quiet):
    """Run every contact method on families of hard cases with known answers, and count its errors.

    Exit code 1 if the project's own method, cas, has a wrong verdict or an error beyond its bound.
    """

    families: tuple[str, ...] = option(
        "Only this family, or pose, flat, motion, assembly for a kind; may be repeated.",
        "--family",
        multiple=True,
        metavar="NAME",
    )
    methods: tuple[str, ...] = option("Only this method; may be repeated.", "--method", multiple=True, metavar="NAME")
    n: int = option("Cases per family.", type=click.IntRange(1), default=1000)
    seed: int = option("Seed of the cases.", type=click.IntRange(0), default=0)
    check: int = option("Truths checked at 50 digits.", type=click.IntRange(0), default=20)
    time_limit: float = option(
        "Seconds for each other method per family.", type=click.FloatRange(1.0), default=60.0, metavar="S"
    )
    workers: int = option("Processes.", type=click.IntRange(1), default=1)
    show_list: bool = option("List families and methods.", "--list")
    case: int | None = option(
        "Print case I of the family as Python, with its truth.", type=click.IntRange(0), metavar="I"
    )
    json_file: Path | None = JSON
    markdown_file: Path | None = option("Write the result as Markdown.", "--markdown")
    plot_file: Path | None = option("Draw the matrix (.png, .svg, .pdf).", "--plot", type=PICTURE)

    def run(self) -> None:
        """Run the cases, or print the list or one of them."""
        from clamp3d.bench.stress.report import markdown, plot, table
        from clamp3d.bench.stress.run import FAMILIES, METHODS, run_stress

        if self.show_list:
            for each in FAMILIES.values():
                show(f"{each.name:28s} {each.about}")
            for name, about in METHODS.items():
                show(f"{name:28s} (method) {about}")
            return
        if self.case is not None:
            self._show_case(self.case)
            return
        names = ("n", "seed", "check", "time_limit", "workers")
        settings = {name: getattr(self, name) for name in names}
        with bar(self.quiet) as report:
            result = run_stress(self.families or None, self.methods or None, **settings, progress=report)
        show(table(result))
        save(self.json_file, result.to_dict)
        save(self.markdown_file, lambda: markdown(result, command_line()))
        if self.plot_file is not None:
            plot(result, self.plot_file)
        own = [o for o in result.outcomes if o.method == "cas"]
        finish(any(o.wrong or o.beyond_bound for o in own))

    def _show_case(self, case: int) -> None:
        from clamp3d.bench.stress.run import FAMILIES

        if len(self.families) != 1 or self.families[0] not in FAMILIES:
            raise click.UsageError("--case needs one --family; see --list")
        family = FAMILIES[self.families[0]]
        count = max(1, int(self.n * family.part))
        if case >= count:
            raise InputError(f"--case must be less than the number of cases, {count}, got {case}")
        show(family.case(count, self.seed, case))


def two_points(text: str) -> list[tuple[float, float]]:
    """Two positions in px, as the type of an option."""
    pairs = [pair.split(",") for pair in text.replace(";", " ").split()]
    if [len(pair) for pair in pairs] != [2, 2]:
        raise click.BadParameter(f"must be two positions 'X,Y X,Y' in px, got {text!r}")
    return [(number(x), number(y)) for x, y in pairs]


@command("measure-image")
class MeasureImage:
    """Measure a distance in the photograph IMAGE by marked points and a length that was measured.

    \b
    clamp3d measure-image clamp.jpg --points "31,458 58,584" --reference "31,458 579,458" --scale 137
    """

    image: Path = argument(type=INPUT_FILE)
    points: list[tuple[float, float]] = option(
        "The two end points in px from the top left.", type=two_points, required=True, metavar="'X,Y X,Y'"
    )
    reference: list[tuple[float, float]] = option(
        "The two ends of a measured length, in px.", type=two_points, required=True, metavar="'X,Y X,Y'"
    )
    scale: float = option("The measured length.", required=True, metavar="MM")
    kind: Literal["height", "straight"] = option(
        "Square to the reference line, or straight from point to point.",
        "--measure",
        default="height",
    )
    snap: float | None = option("Move each mark to the strongest corner within PX pixels.", metavar="PX")
    marking_error: float | None = option("Standard deviation of a mark.  [default: 4.5; 0.5 snapped]", metavar="PX")
    calliper_error: float = option("Standard deviation of a reading.", default=0.02, metavar="MM")
    json_file: Path | None = JSON

    def run(self) -> None:
        """Measure and print."""
        import numpy as np

        from clamp3d.bench.image import MARKING_ERROR, measure_image
        from clamp3d.bench.picture import check_marks, load_image, snap_marks

        marks, picture = np.array(self.points + self.reference), load_image(self.image)
        marks = check_marks(picture, marks) if self.snap is None else snap_marks(picture, marks, self.snap)
        usual = MARKING_ERROR if self.snap is None else 0.5
        errors = {
            "marking_error": usual if self.marking_error is None else self.marking_error,
            "calliper_error": self.calliper_error,
        }
        measured = measure_image(marks[:2], marks[2:], self.scale, kind=self.kind, **errors)
        precision = f"+- {measured.uncertainty:.3f} mm ({self.kind}; one standard deviation)"
        show(f"distance     {measured.distance:.3f} mm {precision}")
        show(f"height       {measured.height:.3f} mm, straight {measured.straight:.3f} mm")
        precision = f"marks +- {errors['marking_error']:g} px, reading +- {errors['calliper_error']:g} mm"
        show(f"scale        {measured.mm_per_px:.6f} mm/px, {precision}")
        show(f"marks        {', '.join(f'({x:.2f}, {y:.2f})' for x, y in marks)}")
        data = {"image": str(self.image), "kind": self.kind, "marks": marks.tolist(), **asdict(measured)}
        save(self.json_file, lambda: data)
