"""``clamp3d view``."""

from __future__ import annotations

import click

from clamp3d.cli.options import Method, Source, Viewing, clamp_argument, method_options, viewer_options
from clamp3d.cli.terminal import finish


@click.command("view")
@clamp_argument
@method_options
@viewer_options
@click.option("--quiet", "-q", is_flag=True, help="No progress; the page's address is printed all the same.")
def command(
    source: Source,
    method: Method,
    viewing: Viewing,
    quiet: bool,
) -> None:
    """Assemble CLAMP (a built-in name or a TOML file) before your eyes, step by step, in a browser.

    Prints the page's address and serves it until Ctrl-C (or --timeout). With --html the page is written to a file
    instead; with --url the scene goes to a meshcat server, which keeps it. Exit code 1 as for run.
    """
    from clamp3d.cli.viewing import run_and_view

    settings = method.settings()
    loaded = source.clamp()
    model = method.model(loaded, quiet=quiet)
    run = run_and_view(loaded, model, settings, viewing, quiet=quiet, serve=viewing.html_file is None)
    finish(finding=not run.clamped or bool(run.undeclared))
