"""Errors of the package: one clear line each, naming value, rule and choices."""

import importlib.util
import re
from typing import Any

LONGEST = 900
"""Most characters of a message: a value in it may be longer."""


def escaped(text: str, *, keep: str = "") -> str:
    r"""A text with its control characters, which a terminal would execute, escaped; those in ``keep`` stay.

    >>> escaped("red: \x1b[31m")
    'red: \\x1b[31m'
    """
    return "".join(c if c.isprintable() or c in keep else c.encode("unicode_escape").decode() for c in text)


def one_line(message: str) -> str:
    r"""A message as one short line, whatever names and values it contains.

    >>> one_line("no file named 'a\nb'")
    "no file named 'a\\nb'"
    """
    if len(message) > LONGEST:
        message = f"{message[: LONGEST // 2]} ... {message[-LONGEST // 2 :]}"
    return escaped(message)


class Clamp3dError(Exception):
    """Base of every error that clamp3d raises on purpose; its message is one line."""

    def __init__(self, message: object = "") -> None:
        super().__init__(one_line(str(message)))


class InputError(Clamp3dError, ValueError):
    """A value from outside breaks a rule. The message names the value and the rule (exit code 2)."""


class NotClampedError(InputError):
    """A clamp does not hold both wires, which the calculation requires (exit code 1). The message says why."""


class SolverError(Clamp3dError):
    """A solver could not prove its answer. The message says which condition does not hold."""


class SequenceError(Clamp3dError):
    """Parts block a step of a sequence (exit code 1). The message says which parts, where and when.

    Attributes
    ----------
    blocks : tuple
        What blocks each path that was tried, the one that leads furthest first.
    scene : Scene or None
        The parts assembled so far, with the motion along the first of these paths.
    """

    def __init__(self, message: object = "", blocks: tuple[Any, ...] = (), scene: Any = None) -> None:
        super().__init__(message)
        self.blocks, self.scene = blocks, scene


class MissingLibraryError(Clamp3dError, ImportError):
    """An optional library is not installed. The message says what to install."""


EXTRAS = {
    "OCP": "step",
    "distributed": "cluster",
    "lib3mf": "3mf",
    "matplotlib": "report",
    "mpmath": "stress",
    "pandas": "frame",
    "skimage": "image",
    "yourdfpy": "urdf",
}
"""Optional libraries, and the extra of this package that installs each."""


def need(library: str, what: str) -> None:
    """Raise MissingLibraryError unless a library of `EXTRAS` is installed that ``what`` needs; call before long work.

    >>> need("matplotlib", "a drawing")
    """
    if importlib.util.find_spec(library) is None:
        raise missing(library, what)


def missing(library: str, what: str) -> MissingLibraryError:
    """The error that names the extra with a library that ``what`` needs."""
    return MissingLibraryError(f"{what} needs {library}: pip install 'clamp3d[{EXTRAS[library]}]'")


def without_numbers(message: str) -> str:
    """A message without its numbers, so that equal reasons count together.

    >>> without_numbers("radius of P1 must be > 0 mm, got -1.5e-3")
    'radius of P1 must be > ... mm, got ...'
    """
    return re.sub(r"(?<![\w.])[-+]?\d[\d.]*(e[-+]?\d+)?", "...", message)
