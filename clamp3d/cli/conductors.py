"""``clamp3d conductors``."""

from __future__ import annotations

import json

from clamp3d.cli.options import declared, option
from clamp3d.cli.terminal import show


@declared("conductors")
def command(
    as_json: bool = option("Print JSON.", "--json"),
) -> None:
    """List the conductor catalogue: designation, diameter over all strands, standard."""
    from dataclasses import asdict

    from clamp3d.clamp.conductors import catalogue

    if as_json:
        show(json.dumps([asdict(entry) for entry in catalogue().values()], indent=2))
        return
    for entry in catalogue().values():
        show(f"{entry.designation:12s} {entry.diameter:7.2f} mm   {entry.standard}")
