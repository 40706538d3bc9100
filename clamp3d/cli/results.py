"""Results as JSON that says what was asked, so that `clamp3d verify` can compute it again."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import click
from click.core import ParameterSource

from clamp3d.cli.options import Output

COMMAND = "command"
"""Key of the arguments."""
VERIFIABLE = ("run", "check", "fit", "sweep", "tolerance")
_NO_INPUT = {"host", "open_browser", "port", "processes", "quiet", "scheduler", "timeout", "url", "view"}
"""Parameters that no result depends on."""


def write_result(path: Path, data: dict[str, Any]) -> None:
    """Write ``data`` and the arguments of the command that runs. Raises InputError if it cannot be written."""
    from clamp3d.output.files import write_json

    write_json(path, {COMMAND: _arguments(), **data})


def _arguments() -> list[str]:
    """What was given on the command line, but for files to write and what no result depends on."""
    context = click.get_current_context()
    options, arguments = [str(context.command.name)], []
    for parameter in context.command.params:
        name = str(parameter.name)
        if context.get_parameter_source(name) is not ParameterSource.COMMANDLINE or name in _NO_INPUT:
            continue
        value = context.params[name]
        if isinstance(parameter.type, Output):
            continue
        if isinstance(parameter, click.Argument):
            arguments.append(str(value))
        elif isinstance(parameter, click.Option) and parameter.is_flag:
            options.append((parameter.opts if value else parameter.secondary_opts)[0])
        else:
            for one in value if parameter.multiple else [value]:
                options += [parameter.opts[0], str(one)]
    return [*options, *arguments]
