"""What figures were taken on: every result that holds times or counts says so."""

from __future__ import annotations

import os
import platform
from collections.abc import Iterable
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path

import clamp3d
from clamp3d.output.manifest import versions


@dataclass(frozen=True, slots=True)
class Machine:
    """Where the figures come from; ``versions`` of the libraries that took part."""

    system: str
    processor: str
    cores: int
    python: str
    clamp3d: str
    versions: dict[str, str]

    def __str__(self) -> str:
        versions = ", ".join(f"{name} {version}" for name, version in self.versions.items())
        return (
            f"{self.processor}, {self.cores} cores, {self.system}, Python {self.python}, clamp3d {self.clamp3d}, "
            f"{versions}"
        )


def machine(libraries: Iterable[str]) -> Machine:
    """This machine, and those of ``libraries`` that are installed on it."""
    return Machine(
        f"{platform.system()} {platform.machine()}",
        _processor(),
        os.cpu_count() or 1,
        platform.python_version(),
        clamp3d.__version__,
        versions(libraries),
    )


def _processor() -> str:
    with suppress(OSError):
        for line in Path("/proc/cpuinfo").read_text(encoding="utf-8", errors="replace").splitlines():
            if line.startswith("model name"):
                return line.split(":", 1)[1].strip()
    return platform.processor() or platform.machine()
