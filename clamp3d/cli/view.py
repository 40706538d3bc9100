"""``clamp3d view``."""

from __future__ import annotations

import click

from clamp3d.clamp.dimensions import Clamp
from clamp3d.cli.options import Method, Source, Viewing, command, option
from clamp3d.cli.terminal import finish, show
from clamp3d.errors import SequenceError


@command("view")
class View(Source, Method, Viewing):
    """Show INPUT in a browser: the assembly of a clamp as an animation, or a scene with its findings and motions.

    INPUT is a clamp (a built-in name or a TOML file), a scene file, or a file with parts. Prints the page's address
    and serves it until Ctrl-C (or --timeout). With --html the page is written to a file instead; with --url the scene
    goes to a meshcat server, which keeps it. Exit codes are those of check; 1 also if a clamp does not close as it
    should, or a step of the sequence is blocked: then it is shown how.
    """

    quiet: bool = option("No progress; the page's address is printed all the same.", "--quiet", "-q")

    def run(self) -> None:
        """Assemble or check on the page."""
        settings, loaded = self.settings(equilibria=False), self.load()
        if not isinstance(loaded, Clamp):
            self.refuse_method()
            if self.overlays:
                raise click.UsageError("--overlay goes with a clamp, not with a scene")
        from clamp3d.cli.viewing import Page  # meshcat, for a page alone

        page = Page(self, serve=self.html_file is None)
        if not isinstance(loaded, Clamp):
            finish(verdicts=page.check(loaded).counts)
            return
        try:
            run = page.assemble(loaded, self.model(loaded), settings)
        except SequenceError as error:
            show(f"not assembled: {error}")
            page.check(error.scene)
            finish(True)
        finish(not run.passed)
