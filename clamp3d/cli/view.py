"""``clamp3d view``."""

from __future__ import annotations

import click

from clamp3d.cli.options import METHOD, SOURCE, VIEWING, Method, Source, Viewing, declared, option
from clamp3d.cli.terminal import finish, show
from clamp3d.errors import SequenceError


@declared("view")
def command(
    source: Source = SOURCE,
    method: Method = METHOD,
    viewing: Viewing = VIEWING,
    quiet: bool = option("No progress; the page's address is printed all the same.", "--quiet", "-q"),
) -> None:
    """Show INPUT in a browser: the assembly of a clamp as an animation, or a scene with its findings and motions.

    INPUT is a clamp (a built-in name or a TOML file), a scene file, or a file with parts. Prints the page's address
    and serves it until Ctrl-C (or --timeout). With --html the page is written to a file instead; with --url the scene
    goes to a meshcat server, which keeps it. Exit codes are those of check; 1 also if a clamp does not close as it
    should, or a step of the sequence is blocked: then it is shown how.
    """
    from clamp3d.clamp.dimensions import Clamp

    settings = method.settings(equilibria=False)
    loaded = source.load()
    if not isinstance(loaded, Clamp):
        method.refuse()
        if viewing.overlays:
            raise click.UsageError("--overlay goes with a clamp, not with a scene")
    from clamp3d.cli.viewing import Page

    page = Page(viewing, serve=viewing.html_file is None, quiet=quiet)
    if not isinstance(loaded, Clamp):
        finish(verdicts=page.check(loaded).counts)
        return
    try:
        run = page.assemble(loaded, method.model(loaded, quiet=quiet), settings)
    except SequenceError as error:
        show(f"not assembled: {error}")
        page.check(error.scene)
        finish(True)
    finish(not run.passed)
