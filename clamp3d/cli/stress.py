"""``clamp3d stress``."""

from __future__ import annotations

from pathlib import Path

import click

from clamp3d.cli.options import JSON, PICTURE, QUIET, declared, option
from clamp3d.cli.terminal import finish, show


@declared("stress")
def command(
    families: tuple[str, ...] = option(
        "Only this family, or pose, flat, motion, assembly for a kind; may be repeated.",
        "--family",
        multiple=True,
        metavar="NAME",
    ),
    methods: tuple[str, ...] = option("Only this method; may be repeated.", "--method", multiple=True, metavar="NAME"),
    show_list: bool = option("List families and methods.", "--list"),
    n: int = option("Cases per family.", type=click.IntRange(1), default=1000),
    seed: int = option("Seed of the cases.", type=click.IntRange(0), default=0),
    check: int = option("Truths checked at 50 digits.", type=click.IntRange(0), default=20),
    time_limit: float = option(
        "Seconds for each other method per family.", type=click.FloatRange(1.0), default=60.0, metavar="S"
    ),
    workers: int = option("Processes.", type=click.IntRange(1), default=1),
    case: int | None = option(
        "Print case I of the family as Python, with its truth.", type=click.IntRange(0), metavar="I"
    ),
    json_file: Path | None = JSON,
    markdown_file: Path | None = option("Write the result as Markdown.", "--markdown"),
    plot_file: Path | None = option("Draw the matrix (.png, .svg, .pdf).", "--plot", type=PICTURE),
    quiet: bool = QUIET,
) -> None:
    """Put families of hard contact cases with exact answers to every contact method, and count what goes wrong.

    Exit code 1 if the project's own method, cas, has a wrong verdict or an error beyond its bound.
    """
    from clamp3d.bench.stress.report import markdown, plot, table
    from clamp3d.bench.stress.run import FAMILIES, METHODS, run_stress
    from clamp3d.errors import InputError

    if show_list:
        for each in FAMILIES.values():
            show(f"{each.name:28s} {each.about}")
        for name, about in METHODS.items():
            show(f"{name:28s} (method) {about}")
        return
    if case is not None:
        if len(families) != 1 or families[0] not in FAMILIES:
            raise click.UsageError("--case needs one --family; see --list")
        family = FAMILIES[families[0]]
        n = max(1, int(n * family.part))
        if case >= n:
            raise InputError(f"--case must be less than the number of cases, {n}, got {case}")
        show(family.case(n, seed, case))
        return

    from clamp3d.cli.progress import bar
    from clamp3d.output.files import write_json, write_text

    with bar(quiet) as report:
        result = run_stress(
            families or None,
            methods or None,
            n=n,
            seed=seed,
            check=check,
            time_limit=time_limit,
            workers=workers,
            progress=report,
        )
    show(table(result))
    if json_file is not None:
        write_json(json_file, result.to_dict())
    if markdown_file is not None:
        extra = "".join(f' --family "{f}"' for f in families) + "".join(f' --method "{m}"' for m in methods)
        write_text(markdown_file, markdown(result, f"clamp3d stress --n {n} --seed {seed} --check {check}{extra}"))
    if plot_file is not None:
        plot(result, plot_file)
    own = [o for o in result.outcomes if o.method == "cas"]
    finish(finding=any(o.wrong or o.beyond_bound for o in own))
