"""What a tightening torque does: the bolt's preload, the force in each contact, and what pulls a wire out lengthwise.

The preload follows from VDI 2230 Part 1 (2015), step R13, the tightening torque of a metric thread of 60 degrees::

    torque = preload * (0.16 pitch + 0.58 pitch_diameter * friction + 0.5 bearing_diameter * friction)

with the pitch diameter of ISO 724, ``diameter - 0.649519 pitch``. Friction is the one number that nobody knows well, so
every answer is a range over it. Forces in the contacts are those of the frictionless final state, see `forces`.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

from clamp3d.checks import number
from clamp3d.clamp.dimensions import Clamp, PartName
from clamp3d.clamp.plain import plain
from clamp3d.clamp.result import HELD_ON_AXIS, Assembly, Force
from clamp3d.clamp.section import WIRES
from clamp3d.errors import InputError

THREAD_FRICTION = (0.10, 0.14, 0.20)
"""Friction of thread and nut face. Chosen from classes B and C of VDI 2230, table A5 (0.08 to 0.16, 0.14 to 0.24)."""
GROOVE_FRICTION = (0.10, 0.20)
"""Friction of a wire in its grooves. Chosen: aluminium strands on a cast clamp, oxide and grease unknown."""
PITCH_TERM = 0.16
"""VDI 2230, step R13: 1 / (2 pi), rounded."""
THREAD_TERM = 0.58
"""VDI 2230, step R13: 1 / (2 cos 30 deg), rounded."""
DEPTH_OF_PITCH_LINE = 0.649519
"""ISO 724: pitch diameter = diameter - 0.75 * cos 30 deg * pitch."""


@dataclass(frozen=True, slots=True)
class Coefficient:
    """A number that a result rests on: its ``value`` in words, and where it comes from."""

    name: str
    value: str
    source: str


class Range(NamedTuple):
    """From ``low`` to ``high``, in the unit that the owner says."""

    low: float
    high: float

    def times(self, low: float, high: float) -> Range:
        """The least end times ``low``, the greatest times ``high``; both > 0."""
        return Range(self.low * low, self.high * high)


@dataclass(frozen=True, slots=True)
class ContactLoad:
    """The force of one contact.

    Attributes
    ----------
    force : Force
        Per newton of bolt force.
    newton : Range
        N.
    length : float or None
        Length of the groove that a wire lies in, mm; None for other contacts.
    """

    force: Force
    newton: Range
    length: float | None

    @property
    def line_load(self) -> Range | None:
        """Force per mm of a wire, N/mm. Strands are no solid bar: this is not a Hertz pressure."""
        return None if self.length is None else self.newton.times(1.0 / self.length, 1.0 / self.length)


@dataclass(frozen=True, slots=True)
class Reached:
    """The torque in Nm at which a limit of the clamp file is reached, over the range of friction."""

    limit: str
    torque: Range


@dataclass(frozen=True, slots=True)
class Tightening:
    """What a torque does to a clamp.

    Attributes
    ----------
    torque : float
        Nm.
    preloads : tuple of (float, float)
        Friction of thread and nut face, and the preload it leaves, N.
    contacts : tuple of ContactLoad
        The force in each contact.
    slip : dict of Range
        The pull along each wire in N at which it slips through its grooves.
    limits : tuple of Reached
        The torque at which each limit of the clamp file is reached.
    coefficients : tuple of Coefficient
        What the numbers rest on.
    """

    torque: float
    preloads: tuple[tuple[float, float], ...]
    contacts: tuple[ContactLoad, ...]
    slip: dict[PartName, Range]
    limits: tuple[Reached, ...]
    coefficients: tuple[Coefficient, ...]

    @property
    def preload(self) -> Range:
        """From the highest friction to the lowest; N."""
        newtons = [newton for _, newton in self.preloads]
        return Range(min(newtons), max(newtons))

    def to_dict(self) -> dict[str, Any]:
        """Plain data for JSON; forces in N, torques in Nm."""
        return {
            "torque_nm": self.torque,
            "preloads": [{"friction": mu, "preload_n": newton} for mu, newton in self.preloads],
            "contacts": [
                {"a": load.force.a, "b": load.force.b, "feature": load.force.feature, "force_n": list(load.newton)}
                | ({} if load.line_load is None else {"line_load_n_per_mm": list(load.line_load)})
                for load in self.contacts
            ],
            "slip_n": {wire: list(pull) for wire, pull in self.slip.items()},
            "limits": [plain(limit, torque="torque_nm") for limit in self.limits],
            "coefficients": [plain(coefficient) for coefficient in self.coefficients],
        }


def torque_per_newton(clamp: Clamp, friction: float) -> float:
    """Tightening torque over preload, mm: VDI 2230 Part 1, step R13.

    >>> from clamp3d.clamp.loader import load_clamp
    >>> [round(80e3 / torque_per_newton(load_clamp(), mu) / 1e3, 1) for mu in (0.10, 0.14, 0.20)]
    [28.9, 21.6, 15.6]
    """
    bolt = clamp.bolt
    thread = THREAD_TERM * (bolt.diameter - DEPTH_OF_PITCH_LINE * bolt.pitch) * friction
    return PITCH_TERM * bolt.pitch + thread + 0.5 * _bearing_diameter(clamp) * friction


def tighten(
    assembly: Assembly,
    torque: float,
    *,
    friction: Sequence[float] = THREAD_FRICTION,
    groove_friction: Sequence[float] = GROOVE_FRICTION,
) -> Tightening:
    """What ``torque`` does to an assembled clamp.

    Parameters
    ----------
    assembly : Assembly
        A clamped one, of the exact solver.
    torque : float
        Nm, at the nut.
    friction : sequence of float
        Coefficients of thread and nut face.
    groove_friction : sequence of float
        Coefficients of the wires in their grooves.

    Raises
    ------
    InputError
        For values that are not > 0, and for a clamp that holds no forces.

    Examples
    --------
    >>> from clamp3d.clamp.assemble import assemble
    >>> tight = tighten(assemble(), 80.0)
    >>> f"{tight.preload.low / 1e3:.1f} to {tight.preload.high / 1e3:.1f} kN"
    '15.6 to 28.9 kN'
    """
    torque = number("torque", torque)
    if not 0.0 < torque <= 1e6:
        raise InputError(f"torque must be > 0 and at most 1e6 Nm, got {torque:g}")
    thread, groove = (coefficients(n, v) for n, v in (("friction", friction), ("groove friction", groove_friction)))
    if not (assembly.clamped and assembly.forces):
        raise InputError(f"torque: needs a clamp that the exact solver has closed, got {assembly.status!r}")
    clamp = assembly.clamp
    preloads = tuple((mu, 1e3 * torque / torque_per_newton(clamp, mu)) for mu in thread)
    preload = Range(preloads[-1][1], preloads[0][1])
    grooves = {"P1": clamp.up_splint.length, "P2": clamp.down_splint.length}
    contacts = tuple(
        ContactLoad(force, preload.times(force.force, force.force), grooves.get(force.a) if force.b in WIRES else None)
        for force in assembly.forces
        if force.feature != HELD_ON_AXIS
    )
    held = {wire: sum(load.force.force for load in contacts if wire == load.force.b) for wire in WIRES}
    slip = {wire: preload.times(groove[0] * share, groove[-1] * share) for wire, share in held.items()}
    low, high = (1e-3 * torque_per_newton(clamp, mu) for mu in (thread[0], thread[-1]))
    limits = [Reached(text, needed.times(low, high)) for text, needed in _limits(clamp, contacts, held, groove)]
    return Tightening(torque, preloads, contacts, slip, tuple(limits), _sources(clamp, thread, groove))


def coefficients(name: str, values: Sequence[float]) -> tuple[float, ...]:
    """Friction coefficients, from the least to the greatest. Raises InputError unless each is > 0 and at most 1."""
    checked = tuple(sorted(number(name, value) for value in values))
    if not checked or not (checked[0] > 0.0 and checked[-1] <= 1.0):
        raise InputError(f"{name} must be > 0 and at most 1, got {', '.join(f'{v:g}' for v in checked) or 'nothing'}")
    return checked


def _bearing_diameter(clamp: Clamp) -> float:
    """Mean diameter of the nut's face, between hole and flats; mm."""
    return 0.5 * (clamp.nut.across_flats + clamp.up_splint.hole_diameter)


def _limits(
    clamp: Clamp, contacts: Sequence[ContactLoad], held: dict[PartName, float], groove: Sequence[float]
) -> Iterator[tuple[str, Range]]:
    """Each limit of the file, and the preload in N at which it is reached: with the highest friction and the lowest."""
    limits = clamp.limits
    if (most := limits.bolt_force) is not None:
        yield f"bolt force {most:g} N", Range(most, most)
    if (line_load := limits.line_load) is not None:
        for load in contacts:
            if load.length is not None:
                preload = line_load * load.length / load.force.force
                yield f"line load {line_load:g} N/mm at {load.force.a}-{load.force.b}", Range(preload, preload)
    if (pull := limits.wire_pull) is not None:
        for wire, share in held.items():
            yield f"{wire} holds a pull of {pull:g} N", Range(pull / (groove[-1] * share), pull / (groove[0] * share))


def _sources(clamp: Clamp, thread: Sequence[float], groove: Sequence[float]) -> tuple[Coefficient, ...]:
    bolt = clamp.bolt
    pitch_diameter = bolt.diameter - DEPTH_OF_PITCH_LINE * bolt.pitch
    listed = [", ".join(f"{mu:g}" for mu in values) for values in (thread, groove)]
    usual = tuple(thread) == THREAD_FRICTION, tuple(groove) == GROOVE_FRICTION
    own = ["chosen" if is_usual else "given by the user" for is_usual in usual]
    return (
        Coefficient("pitch", f"{bolt.pitch:g} mm", "clamp file"),
        Coefficient("pitch diameter", f"{pitch_diameter:.3f} mm", "ISO 724, from the bolt's diameter and pitch"),
        Coefficient(
            "bearing diameter", f"{_bearing_diameter(clamp):g} mm", "mean of hole and nut's flats (chosen: no chamfer)"
        ),
        Coefficient("torque terms", f"{PITCH_TERM:g} and {THREAD_TERM:g}", "VDI 2230 Part 1, step R13"),
        Coefficient("friction of thread and nut face", listed[0], f"{own[0]}; VDI 2230, table A5: 0.04 to 0.35"),
        Coefficient("friction of wire and groove", listed[1], f"{own[1]}: not measured"),
    )
