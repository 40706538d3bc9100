"""`clamp3d.check`: the verdicts of a scene, or of whatever can be made one."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from clamp3d.checks import shown
from clamp3d.clamp.dimensions import Clamp
from clamp3d.clamp.result import Assembly
from clamp3d.engine.check import check as check_scene
from clamp3d.engine.model import ModelCache, Progress
from clamp3d.engine.result import CheckResult
from clamp3d.engine.scene import Part, Scene
from clamp3d.errors import InputError
from clamp3d.scenefile.load import load


def check(
    source: Any,
    *,
    pairs: Sequence[tuple[str, str]] | None = None,
    distances: bool = False,
    depths: bool = True,
    progress: Progress | None = None,
    cache: ModelCache | None = None,
) -> CheckResult:
    """Verdicts of all pairs of an assembly, at rest and in its motions.

    Parameters
    ----------
    source
        A scene; whatever `load` reads: a path, a trimesh scene, a CadQuery or build123d assembly; a list of
        ``(name, shape)`` or ``(name, shape, pose)``; or a clamp, which is assembled first.
    pairs : sequence of (str, str), optional
        Names of the pairs to look at; all by default.
    distances : bool
        Measure every pair as finely as possible, not only until its verdict is certain.
    depths : bool
        Measure the penetration depth of clashes; without, "at least".
    progress : callable, optional
        Called with (stage, done, of).
    cache : ModelCache, optional
        Keeps models from one check to the next.

    Returns
    -------
    CheckResult
        Rows with verdict and distance; pairs that never came near are clear and have no row, unless ``distances``. A
        pair that could not be measured has the verdict failed, and its reason.

    Raises
    ------
    InputError
        For what cannot be read, and for unknown names.
    MissingLibraryError
        If a part needs a library that is not installed.

    Examples
    --------
    >>> from clamp3d.geometry import shapes
    >>> from clamp3d.geometry.pose import translation
    >>> check([("a", shapes.box((10, 10, 10))), ("b", shapes.cylinder(3, 10), translation(0, 0, 9))])
    CheckResult('scene': not clean; 1 clash)
    """
    scene = opened(source)
    if isinstance(scene, Assembly):
        scene = scene.scene
    return check_scene(scene, pairs=pairs, distances=distances, depths=depths, progress=progress, cache=cache)


def opened(source: Any) -> Scene | Assembly:
    """A scene or an assembly as it is, else made from a list of parts or by `load`; a clamp is assembled."""
    if isinstance(source, (Scene, Assembly)):
        return source
    if isinstance(source, (list, tuple)):
        return Scene(tuple(_part(row) for row in source))
    loaded = source if isinstance(source, Clamp) else load(source)
    if not isinstance(loaded, Clamp):
        return loaded
    from clamp3d.clamp.assemble import assemble  # SciPy's optimisers, 0.4 s of CPU, only for a clamp

    return assemble(loaded)


def _part(row: Any) -> Part:
    if isinstance(row, Part):
        return row
    if not (isinstance(row, (list, tuple)) and len(row) in (2, 3)):
        raise InputError(f"a list of parts must hold (name, shape) or (name, shape, pose), got {shown(row)}")
    return Part(*row)
