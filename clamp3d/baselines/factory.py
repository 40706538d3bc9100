"""The one registry of contact models: name, class, settings."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

from clamp3d.errors import InputError

if TYPE_CHECKING:
    from clamp3d.baselines.model import ContactModel
    from clamp3d.geometry.shapes import Solid

METHODS: dict[str, tuple[str, ...]] = {
    "cas": (),
    "chords": ("unit_angle",),
    "wedges": ("unit_angle",),
    "hulls": ("threshold", "mesh_error"),
    "mesh": ("mesh_error",),
}
"""Name of each contact model -> the settings that it takes."""

_CLASSES = {"cas": "Cas", "chords": "Chords", "wedges": "Wedges", "hulls": "Hulls", "mesh": "Meshes"}
"""Name -> its class in `clamp3d.baselines`, which imports it on first use."""


def contact_model(
    name: str,
    parts: Mapping[str, Solid] | None = None,
    *,
    unit_angle: float | None = None,
    threshold: float | None = None,
    mesh_error: float | None = None,
    progress: bool | None = None,
    time_limit: float = 300.0,
) -> ContactModel:
    """Make the contact model of a name.

    Parameters
    ----------
    name : {"cas", "chords", "wedges", "hulls", "mesh"}
        Exact arcs; chords in the section; convex wedges, CoACD's hulls or triangle meshes in 3D, measured by FCL.
    parts : mapping of str to Solid, optional
        Grooved parts by name, in their own frames, mm, for wedges, hulls and mesh; cut or meshed when first measured.
    unit_angle : float, optional
        Largest angle of a chord in rad, for chords and wedges; 5 degrees by default.
    threshold : float, optional
        Concavity in mm that CoACD may leave, for hulls; 2 mm by default.
    mesh_error : float, optional
        Chord error in mm of the meshes, for hulls and mesh; 0.05 mm by default.
    progress : bool, optional
        Whether CoACD's progress is shown on stderr; by default only on a terminal.
    time_limit : float
        Seconds that CoACD may take for a part.

    Raises
    ------
    InputError
        If the name is unknown, a setting does not go with it, or the parts are missing.

    Examples
    --------
    >>> contact_model("chords", unit_angle=0.1).limits
    ('parallel axes only', 'groove too tight by the chord error')
    >>> contact_model("cas", unit_angle=0.1)
    Traceback (most recent call last):
    clamp3d.errors.InputError: unit_angle goes with method chords or wedges, got method 'cas'
    """
    if name not in METHODS:
        raise InputError(f"unknown method {name!r}; available: {', '.join(METHODS)}")
    all_settings = {"unit_angle": unit_angle, "threshold": threshold, "mesh_error": mesh_error}
    settings: dict[str, Any] = {key: value for key, value in all_settings.items() if value is not None}
    for setting in settings:
        if setting not in METHODS[name]:
            takers = " or ".join(method for method, accepted in METHODS.items() if setting in accepted)
            raise InputError(f"{setting} goes with method {takers}, got method {name!r}")
    if name not in ("cas", "chords"):
        if parts is None:
            raise InputError(f"method {name!r} needs the parts that it is to measure, got none")
        settings["parts"] = parts
    if name == "hulls":
        settings |= {"progress": progress, "time_limit": time_limit}
    from clamp3d import baselines

    model: ContactModel = getattr(baselines, _CLASSES[name])(**settings)
    return model
