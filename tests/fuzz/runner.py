"""Inputs of one kind put to the project in a child process, which may die or hang: ``python -m tests.fuzz.runner``."""

from __future__ import annotations

import contextlib
import faulthandler
import importlib
import json
import os
import resource
import subprocess
import sys
import tempfile
import time
from collections import Counter
from collections.abc import Callable, Iterator
from pathlib import Path

import hypothesis
from hypothesis import strategies as st

from tests.fuzz.values import Draw

CASE_LIMIT = 300.0
"""Seconds after which one input counts as hanging, on however busy a machine."""
_MEMORY = 6 << 30  # bytes of address space: what asks for more is a finding, not the end of the machine

Kind = Callable[[Draw, Path], tuple[str, Callable[[], bool]]]
"""Makes one input in a folder of its own: its description, and a call that is True if answered, False if refused."""


WAYS: dict[str, Callable[[], bool]] = {
    "answers": lambda: True,
    "refuses": lambda: False,
    "raises": lambda: bool([][0]),
    "dies": os.abort,
    "hangs": lambda: time.sleep(600) is None,
}
"""What becomes of the runner's own inputs."""
KINDS = {
    "clamp files": ("files", "make_clamp"),
    "scene files": ("files", "make_scene"),
    "API calls": ("api", "make"),
    "mesh files": ("mesh_files", "make"),
    "command lines": ("command_lines", "make"),
}
"""The modules and functions that make the others: a process imports what it needs."""


def maker(kind: str) -> Kind:
    """What makes inputs of a kind."""
    if kind in WAYS:
        return lambda draw, folder: (kind, WAYS[kind])
    module, name = KINDS[kind]
    made: Kind = getattr(importlib.import_module(f"tests.fuzz.{module}"), name)
    return made


def run(kind: str, n: int, seed: int, *, limit: float = CASE_LIMIT) -> tuple[Counter[str], str]:
    """Put ``n`` inputs of a kind to the project: how many were answered and refused, and what went wrong, if any."""
    with tempfile.TemporaryDirectory(prefix="fuzz-") as folder:
        path = os.pathsep.join([str(Path(__file__).parents[2]), *filter(None, [os.environ.get("PYTHONPATH")])])
        command = [sys.executable, "-m", "tests.fuzz.runner", kind, str(n), str(seed), str(limit), folder]
        done = subprocess.run(
            command, stdin=subprocess.DEVNULL, capture_output=True, check=False, env={**os.environ, "PYTHONPATH": path}
        )
        said, last, counts = done.stderr.decode("utf-8", "replace"), Path(folder, "last"), Path(folder, "counts")
        if done.returncode:
            text = last.read_text("utf-8", "backslashreplace") if last.exists() else "(not made)"
            return Counter(), f"exit code {done.returncode} at {text}\n{said[-6000:]}"
        return Counter(json.loads(counts.read_text())), ""


def search(kind: str, n: int, seed: int, limit: float, folder: Path) -> None:
    """The same in this process; raises for the first input that is neither answered nor refused, made small."""
    make, counts = maker(kind), Counter[str]()

    @hypothesis.seed(seed)
    @hypothesis.settings(
        max_examples=n,
        database=None,
        deadline=None,
        print_blob=False,
        suppress_health_check=list(hypothesis.HealthCheck),
        phases=[hypothesis.Phase.generate, hypothesis.Phase.shrink],
    )
    @hypothesis.given(st.data())
    def ask(data: st.DataObject) -> None:
        with tempfile.TemporaryDirectory(dir=folder) as own, _inside(Path(own)) as place:
            text, call = make(data.draw, place)
            (folder / "last").write_text(text, "utf-8", "backslashreplace")
            hypothesis.note(text)
            faulthandler.dump_traceback_later(limit, exit=True)
            counts["answered" if call() else "refused"] += 1
            faulthandler.cancel_dump_traceback_later()

    ask()
    (folder / "counts").write_text(json.dumps(counts))


@contextlib.contextmanager
def _inside(folder: Path) -> Iterator[Path]:
    before = os.getcwd()
    os.chdir(folder)
    try:
        yield Path()
    finally:
        os.chdir(before)
        for path in folder.rglob("*"):  # a folder without write permission could not be removed
            if path.is_dir() and not path.is_symlink():
                path.chmod(0o700)


if __name__ == "__main__":
    resource.setrlimit(resource.RLIMIT_AS, (_MEMORY, _MEMORY))
    resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
    search(sys.argv[1], int(sys.argv[2]), int(sys.argv[3]), float(sys.argv[4]), Path(sys.argv[5]))
