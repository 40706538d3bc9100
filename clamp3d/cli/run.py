"""``clamp3d run``."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from clamp3d.cli.mechanics import MECHANICS, Mechanics
from clamp3d.cli.options import CLAMP, JSON, METHOD, QUIET, VIEWING, ClampSource, Method, Viewing, declared, option
from clamp3d.cli.progress import narrated
from clamp3d.cli.terminal import finish, save, show
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
    settings = method.settings(equilibria)
    mechanics.check(settings["solver"])
    from clamp3d.output.run_report import run_to_text

    loaded = source.clamp()
    model = method.model(loaded, quiet=quiet)
    page = None
    if view or viewing.html_file is not None or viewing.url is not None:
        from clamp3d.cli.viewing import Page

        page = Page(viewing, serve=view, quiet=quiet)

    def done(run: Assembly) -> None:
        show(run_to_text(run))
        text, more = mechanics.answer(run)
        if text:
            show(text)
        save(json_file, lambda: run.to_dict() | more)

    try:
        if page is not None:
            result = page.assemble(loaded, model, settings, done)
        else:
            result = narrated(loaded, model, settings, quiet)
            done(result)
    except SequenceError as error:
        status, blocks = f"not assembled: {error}", [block.to_dict() for block in error.blocks]
        show(status)
        save(json_file, lambda: {"status": status, "blocks": blocks})
        if page is not None:
            page.check(error.scene)
        finish(True)
    finish(not result.passed)
