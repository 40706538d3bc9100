"""``clamp3d conductors``."""

from __future__ import annotations

import json
from dataclasses import asdict

from clamp3d.clamp import conductors
from clamp3d.cli.options import command, option
from clamp3d.cli.terminal import show


@command("conductors")
class Conductors:
    """List the conductor catalogue: designation, diameter over all strands, standard."""

    as_json: bool = option("Print JSON.", "--json")

    def run(self) -> None:
        """Print the table, or JSON."""
        entries = conductors.catalogue().values()
        if self.as_json:
            show(json.dumps([asdict(entry) for entry in entries], indent=2))
            return
        for entry in entries:
            show(f"{entry.designation:12s} {entry.diameter:7.2f} mm   {entry.standard}")
