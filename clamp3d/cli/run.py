"""``clamp3d run``."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import click

from clamp3d.cli.mechanics import MECHANICS, Mechanics
from clamp3d.cli.options import CLAMP, JSON, METHOD, QUIET, VIEWING, ClampSource, Method, Viewing, declared, option
from clamp3d.cli.progress import narrator
from clamp3d.cli.terminal import finish, show
from clamp3d.errors import SequenceError

if TYPE_CHECKING:
    from clamp3d.clamp.result import Assembly


@declared("run")
def command(
    source: ClampSource = CLAMP,
    method: Method = METHOD,
    equilibria: bool | None = option(
        "Also report the other states that closing can end in.  [default: with method cas, exact solver]",
        "--equilibria/--no-equilibria",
        default=None,
    ),
    mechanics: Mechanics = MECHANICS,
    json_file: Path | None = JSON,
    view: bool = option("Show the run in a browser while it goes on; prints the page's address."),
    viewing: Viewing = VIEWING,
    quiet: bool = QUIET,
) -> None:
    """Assemble CLAMP (a built-in name or a TOML file) with its wires, and print where every part ends up.

    Exit code 1 if the clamp does not close on both wires, parts meet that should not, or a step of the sequence is
    blocked: the message names what blocks it, where and when, and the page shows it.
    """
    settings = method.settings()
    if equilibria and settings["solver"] != "exact":
        raise click.UsageError(f"--equilibria goes with --solver exact, not {settings['solver']}")
    settings["others"] = (
        equilibria if equilibria is not None else method.method == "cas" and settings["solver"] == "exact"
    )
    mechanics.check(settings["solver"])
    from clamp3d.clamp.assemble import assemble
    from clamp3d.output.files import write_json
    from clamp3d.output.run_report import run_to_text

    loaded = source.clamp()
    model = method.model(loaded, quiet=quiet)
    result: Assembly | None = None

    def done(run: Assembly) -> None:
        show(run_to_text(run))
        data = run.to_dict()
        if mechanics.anything:
            text, more = mechanics.answer(run)
            show(text)
            data |= more
        if json_file is not None:
            write_json(json_file, data)

    viewed = view or viewing.html_file is not None or viewing.url is not None
    try:
        if viewed:
            from clamp3d.cli.viewing import run_and_view

            result = run_and_view(loaded, model, settings, viewing, quiet=quiet, serve=view, done=done)
        else:
            with narrator(quiet) as narrate:
                result = assemble(loaded, model, on_waypoint=narrate.waypoint, progress=narrate.position, **settings)
            done(result)
    except SequenceError as error:
        show(f"not assembled: {error}")
        if json_file is not None:
            write_json(json_file, {"status": f"not assembled: {error}", "blocks": [b.to_dict() for b in error.blocks]})
        if viewed:
            from clamp3d.cli.viewing import view_blocked

            view_blocked(error, viewing, quiet=quiet, serve=view)
    finish(finding=result is None or not result.passed)
