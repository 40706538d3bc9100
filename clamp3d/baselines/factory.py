"""The one place that makes contact models by name."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import TYPE_CHECKING

from clamp3d.errors import InputError

if TYPE_CHECKING:
    from clamp3d.baselines.decomposition import DecompositionParameters
    from clamp3d.baselines.model import ContactModel
    from clamp3d.baselines.polytopes import PartOrMesh

METHODS: dict[str, tuple[str, ...]] = {
    "cas": (),
    "chords": ("unit_angle",),
    "wedges": ("unit_angle",),
    "hulls": ("threshold", "mesh_error"),
    "mesh": ("mesh_error",),
}
"""Name of each contact model -> the settings that it takes."""

UNIT_ANGLE = math.radians(5.0)
MESH_ERROR = 0.05


def contact_model(
    name: str,
    parts: Mapping[str, PartOrMesh] | None = None,
    *,
    unit_angle: float | None = None,
    threshold: float | DecompositionParameters | None = None,
    mesh_error: float | None = None,
    progress: bool | None = None,
    time_limit: float = 300.0,
) -> ContactModel:
    """Make the contact model of a name.

    Parameters
    ----------
    name : {"cas", "chords", "wedges", "hulls", "mesh"}
        Exact arcs in closed form; equal chords in the section; convex wedges, CoACD's hulls or triangle meshes in 3D,
        the last three measured by FCL.
    parts : mapping of str to Solid or mesh, optional
        Shapes of the grooved parts by name, each in its own frame, mm. Wedges, hulls and mesh need them. A part is cut
        or meshed when it is first measured.
    unit_angle : float, optional
        Largest angle of a chord in rad, for chords and wedges; 5 degrees by default.
    threshold : float or DecompositionParameters, optional
        Concavity in mm that CoACD may leave, for hulls; 2 mm by default.
    mesh_error : float, optional
        Chord error of the meshes in mm, for hulls and mesh; 0.05 mm by default. Meshes among ``parts`` stay as they
        are.
    progress : bool, optional
        Whether CoACD's progress is shown on stderr; by default only on a terminal.
    time_limit : float
        Seconds that CoACD may take for a part.

    Returns
    -------
    ContactModel
        A model that `assemble`, `distance` and the experiments take.

    Raises
    ------
    InputError
        If the name is unknown, a setting does not go with it, or the parts are missing.

    Examples
    --------
    >>> contact_model("chords", unit_angle=math.radians(10.0)).limits
    ('parallel axes only', 'groove too tight by the chord error')
    >>> contact_model("cas", unit_angle=0.1)
    Traceback (most recent call last):
    clamp3d.errors.InputError: unit_angle goes with method chords or wedges, got method 'cas'
    """
    if name not in METHODS:
        raise InputError(f"unknown method {name!r}; available: {', '.join(METHODS)}")
    for setting, value in (("unit_angle", unit_angle), ("threshold", threshold), ("mesh_error", mesh_error)):
        if value is not None and setting not in METHODS[name]:
            takers = " or ".join(method for method, settings in METHODS.items() if setting in settings)
            raise InputError(f"{setting} goes with method {takers}, got method {name!r}")
    unit_angle = UNIT_ANGLE if unit_angle is None else unit_angle
    mesh_error = MESH_ERROR if mesh_error is None else mesh_error
    from clamp3d import baselines  # imports a model when it is asked for

    if name == "cas":
        return baselines.Cas()
    if name == "chords":
        return baselines.Chords(unit_angle)
    if parts is None:
        raise InputError(f"method {name!r} needs the parts that it is to measure, got none")
    if name == "wedges":
        return baselines.Wedges(parts, unit_angle)  # type: ignore[arg-type]  # a mesh is refused when it is cut
    if name == "mesh":
        return baselines.Meshes(parts, mesh_error)
    from clamp3d.baselines.decomposition import DecompositionParameters

    if isinstance(threshold, (int, float)):
        threshold = DecompositionParameters(threshold=threshold)
    return baselines.Hulls(parts, threshold, mesh_error=mesh_error, time_limit=time_limit, progress=progress)
