"""``clamp3d stress``."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import click

from clamp3d.cli.options import JSON, PICTURE, QUIET, declared, group, option
from clamp3d.cli.terminal import command_line, finish, save, show
from clamp3d.errors import InputError


@dataclass(frozen=True)
class Runs:
    """Which cases are put to which methods, and how."""

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

    def case(self, number: int) -> str:
        """One case of the one family as Python. Raises click.UsageError for several, InputError beyond the last."""
        from clamp3d.bench.stress.run import FAMILIES

        if len(self.families) != 1 or self.families[0] not in FAMILIES:
            raise click.UsageError("--case needs one --family; see --list")
        family = FAMILIES[self.families[0]]
        count = max(1, int(self.n * family.part))
        if number >= count:
            raise InputError(f"--case must be less than the number of cases, {count}, got {number}")
        return family.case(count, self.seed, number)


@declared("stress")
def command(
    runs: Runs = group(Runs),
    show_list: bool = option("List families and methods.", "--list"),
    case: int | None = option(
        "Print case I of the family as Python, with its truth.", type=click.IntRange(0), metavar="I"
    ),
    json_file: Path | None = JSON,
    markdown_file: Path | None = option("Write the result as Markdown.", "--markdown"),
    plot_file: Path | None = option("Draw the matrix (.png, .svg, .pdf).", "--plot", type=PICTURE),
    quiet: bool = QUIET,
) -> None:
    """Run every contact method on families of hard cases with known answers, and count its errors.

    Exit code 1 if the project's own method, cas, has a wrong verdict or an error beyond its bound.
    """
    from clamp3d.bench.stress.report import markdown, plot, table
    from clamp3d.bench.stress.run import FAMILIES, METHODS, run_stress

    if show_list:
        for each in FAMILIES.values():
            show(f"{each.name:28s} {each.about}")
        for name, about in METHODS.items():
            show(f"{name:28s} (method) {about}")
        return
    if case is not None:
        show(runs.case(case))
        return

    from clamp3d.cli.progress import bar

    with bar(quiet) as report:
        result = run_stress(
            runs.families or None,
            runs.methods or None,
            n=runs.n,
            seed=runs.seed,
            check=runs.check,
            time_limit=runs.time_limit,
            workers=runs.workers,
            progress=report,
        )
    show(table(result))
    save(json_file, result.to_dict)
    save(markdown_file, lambda: markdown(result, command_line()))
    if plot_file is not None:
        plot(result, plot_file)
    own = [o for o in result.outcomes if o.method == "cas"]
    finish(any(o.wrong or o.beyond_bound for o in own))
