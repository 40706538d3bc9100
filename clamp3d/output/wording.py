"""Distances, verdicts and findings in words: the terminal, the page and the viewer say the same."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Mapping, Sequence

from clamp3d.engine.answer import Distance
from clamp3d.engine.depth import LONG
from clamp3d.engine.result import BAD, CheckResult, PairResult
from clamp3d.engine.scene import Scene
from clamp3d.engine.verdict import Verdict
from clamp3d.engine.where import Overlap
from clamp3d.output.groups import Group, grouped


def gap_text(lower: float, upper: float, *, digits: int = 6) -> str:
    """The signed distance between two bounds (mm) as a gap or an overlap, with no digit that is not certain.

    One number if two of its digits are, else both bounds.

    >>> gap_text(-0.0707106782, -0.0707106781), gap_text(-110.0, -56.2341), gap_text(0.13352, 0.2)
    ('overlap 0.070711 mm', 'overlap 56.23 to 110 mm', 'gap 0.1335 to 0.2 mm')
    >>> gap_text(0.2439, 0.2441), gap_text(0.2399, 0.2451)
    ('gap 0.244 mm', 'gap 0.2399 to 0.2451 mm')
    >>> gap_text(-math.inf, -7.7512), gap_text(2.5, math.inf), gap_text(-math.inf, 0.25)
    ('overlap at least 7.751 mm', 'gap at least 2.5 mm', 'gap at most 0.25 mm')
    >>> gap_text(0.0, 0.0), gap_text(-0.02, 0.003)
    ('gap 0.000000 mm', 'gap or overlap at most 0.02 mm')
    """
    if math.isfinite(lower) and math.isfinite(upper):
        for places in range(digits, 0, -1):
            low, high = round(lower, places) + 0.0, round(upper, places) + 0.0
            certain = abs(high) >= 10.0 ** (1 - places) or places == digits or (high == 0.0 and upper - lower <= 2e-6)
            if low == high and certain:
                return f"{'overlap' if high < 0.0 else 'gap'} {abs(high):.{places}f} mm"
    for kind, least, most in (("overlap", -upper, -lower), ("gap", lower, upper)):
        if least > 0.0 and math.isinf(most):
            return f"{kind} at least {_rounded(least, math.floor)} mm"
        if least > 0.0:
            return f"{kind} {_rounded(least, math.floor)} to {_rounded(most, math.ceil)} mm"
    if math.isinf(upper):
        return "unknown"
    if math.isinf(lower):
        return f"gap at most {_rounded(upper, math.ceil)} mm"
    return f"gap or overlap at most {_rounded(max(upper, -lower), math.ceil)} mm"


def distance_text(*distances: Distance, digits: int = 6) -> str:
    """`gap_text` of bounds that hold the distances; of pins in holes the interference, and the move that ends it.

    >>> distance_text(Distance(-13.2, -0.03, interference=(0.03, 0.03)))
    'interference 0.030000 mm, apart after a move of up to 13.2 mm'
    >>> distance_text(Distance(-0.37, -0.37), Distance(-0.32, -0.32))
    'overlap 0.32 to 0.37 mm'
    """
    bounds = [shown_bounds(distance) for distance in distances]
    text = gap_text(min(low for low, _ in bounds), max(high for _, high in bounds), digits=digits)
    if any(bound == (d.lower, d.upper) for bound, d in zip(bounds, distances, strict=True)):
        return text
    way = -min(distance.lower for distance in distances)
    out = "" if math.isinf(way) else f", apart after a move of up to {_rounded(way, math.ceil)} mm"
    return text.replace("overlap", "interference") + out


def shown_bounds(distance: Distance) -> tuple[float, float]:
    """Bounds of the signed distance, or of minus the interference where the move that separates is far longer."""
    inside = distance.interference
    if inside is not None and inside[0] > 0.0 and LONG * inside[1] < -distance.lower:
        return -inside[1], -inside[0]
    return distance.lower, distance.upper


def _rounded(value: float, towards: Callable[[float], int], digits: int | None = None) -> str:
    """Four significant digits, six decimals at most, or so many decimals, rounded to the safe side."""
    if digits is None:
        digits = 0 if value == 0.0 else min(6, max(0, 3 - math.floor(math.log10(abs(value)))))
    # The last bit of a float is no digit of a length: 0.3 is 0.3, not a little less.
    text = f"{towards(round(value * 10**digits, 6)) / 10**digits:.{digits}f}"
    return text.rstrip("0").rstrip(".") if digits else text


def titles(scene: Scene) -> dict[str, str]:
    """Each part's name with what it is, where the name does not say it.

    >>> from clamp3d.geometry import shapes
    >>> titles(Scene().add("wire", shapes.cylinder(6.5, 80.0)))
    {'wire': 'wire'}
    """
    words = {part.name: getattr(part.shape, "title", "") for part in scene.parts}
    return {name: name if title.lower() in name.lower() else f"{name} {title}" for name, title in words.items()}


def meanings(scene: Scene) -> dict[str, str]:
    """What each verdict means in this scene."""
    contact, clearance = scene.thresholds.contact, scene.thresholds.clearance
    return {
        "duplicate": "the same part twice in one place",
        "contained": "one part lies inside the other",
        "clash": f"parts overlap by more than {contact:g} mm",
        "failed": "could not be computed",
        "uncertain": "could not be decided",
        "contact": f"parts touch (within {contact:g} mm)",
        "clearance": f"gap smaller than {clearance:g} mm",
        "allowed": "contact that is meant to be",
        "clear": f"gap larger than {max(contact, clearance):g} mm",
    }


def counted(number: int, one: str, many: str = "") -> str:
    """A number of things in words.

    >>> counted(1, "pair"), counted(2, "clash", "clashes")
    ('1 pair', '2 clashes')
    """
    return f"{number} {one if number == 1 else many or one + 's'}"


def headline(result: CheckResult) -> str:
    """The result in one line. Without a clash it says "No clash" only where every pair was decided."""
    groups = grouped(result)
    rows = [row for group in groups for row in group.rows]
    count = {verdict: sum(row.verdict is verdict for row in rows) for verdict in Verdict}
    clashes = [row for row in rows if row.verdict in BAD]
    phrases = [_clashes(clashes, sum(group.verdict in BAD for group in groups))] if clashes else []
    for verdict, one, many in (
        (Verdict.FAILED, "pair failed", "pairs failed"),
        (Verdict.UNCERTAIN, "pair undecided", "pairs undecided"),
        (Verdict.CLEARANCE, "gap too small", "gaps too small"),
        (Verdict.CONTACT, "contact", "contacts"),
    ):
        if count[verdict]:
            phrases.append(counted(count[verdict], one, many))
    checked = counted(result.work.pairs, "pair")
    if result.scene.motions:
        checked += f" and {counted(len(result.scene.motions), 'motion')}"
    if not result.work.pairs:
        return "Nothing checked: fewer than two parts"
    if not phrases:
        return f"Clean: {checked} checked, nothing clashes"
    decided = not count[Verdict.FAILED] and not count[Verdict.UNCERTAIN]
    opening = "No clash: " if decided and not clashes else ""
    return f"{opening}{'; '.join(phrases)} ({checked} checked)"


def _clashes(rows: Sequence[PairResult], n_groups: int) -> str:
    """How many clashes there are, how many of them in motion, and how deep the deepest is."""
    lower, upper = map(min, zip(*(shown_bounds(row.distance) for row in rows), strict=True))
    moving = sum(row.motion is not None for row in rows)
    where = "" if not moving else " in motion" if moving == len(rows) else f" ({moving} in motion)"
    causes = f" in {n_groups} groups" if 1 < n_groups < len(rows) else " of one kind" if n_groups < len(rows) else ""
    depth = f", deepest {gap_text(lower, upper).removeprefix('overlap ')}" if upper < 0.0 else ""
    return counted(len(rows), "clash", "clashes") + causes + where + depth


def severity(result: CheckResult) -> str:
    """How a result is to be read: "found" (a clash or a failure), "note" (undecided, or with findings) or "clean"."""
    if any(row.verdict in BAD or row.verdict is Verdict.FAILED for row in result.rows):
        return "found"
    return "clean" if result.clean and not result.findings else "note"


def sentence(rows: Sequence[PairResult], names: Mapping[str, str], a: str = "", b: str = "") -> str:
    """Findings of one verdict in words; ``a``, ``b``: what they are of, if not the two parts of the first.

    >>> rows = (PairResult("pin", "plate_1", Verdict.CLASH, Distance(-0.2, -0.2)),) * 3
    >>> sentence(rows, {}, "pin", "plate")
    'pin and plate clash, 3 times: overlap 0.200000 mm'
    """
    a, b = (names.get(name, name) for name in (a or rows[0].a, b or rows[0].b))
    often = f", {len(rows)} times" if len(rows) > 1 else ""
    gap = distance_text(*(row.distance for row in rows))
    phrases = {
        Verdict.DUPLICATE: f"{a} and {b} are the same part twice in one place{often}",
        Verdict.CONTAINED: f"{a} and {b}: one lies inside the other{often}, {gap}",
        Verdict.CLASH: f"{a} and {b} clash{often}: {gap}",
        Verdict.FAILED: f"{a} and {b}: failed{often}, no answer",
        Verdict.UNCERTAIN: f"{a} and {b}: undecided{often}, {gap}",
        Verdict.CONTACT: f"{a} and {b} touch{often}" + ("" if gap == "gap 0.000000 mm" else f": {gap}"),
        Verdict.CLEARANCE: f"{a} and {b} are too close{often}: {gap}",
    }
    return phrases.get(rows[0].verdict, f"{a} and {b}{often}: {gap}")


def circumstances(row: PairResult) -> str:
    """Where a finding is: when in a motion, and where in space parts overlap; or why there is no verdict."""
    details = []
    if row.motion is not None:
        first = "" if row.contact_at is None else f"first contact at t = {contact_text(row)}, "
        kind = "deepest" if row.verdict in BAD else "nearest"
        details.append(f"in motion {row.motion!r}" + ("" if row.t is None else f": {first}{kind} at t = {row.t:.4f}"))
    if row.where is not None:
        details.append(where_text(row.where))
    return "; ".join([*details, row.reason] if row.reason else details)


def contact_text(row: PairResult) -> str:
    """The time of a first contact, or from when to when it may be; empty where there is none.

    >>> contact_text(PairResult("a", "b", Verdict.CLASH, Distance(-1.0, -1.0), "push", 0.5, 0.12341, 0.25001))
    '0.1234 to 0.2501'
    """
    if row.contact_at is None:
        return ""
    first, seen = _time(row.contact_at, math.floor), touching_at(row)
    return first if seen == row.contact_at else f"{first} to {_time(seen, math.ceil)}"


def touching_at(row: PairResult) -> float:
    """A time at which parts touch that do so in a motion: that of the first contact, if it is certain as printed."""
    at, by = row.contact_at or 0.0, row.contact_by
    return at if by is None or by - at <= 1e-4 else by


def _time(t: float, towards: Callable[[float], int]) -> str:
    """A time of a motion, rounded to the safe side.

    >>> _time(0.12349, math.floor), _time(0.9, math.floor), _time(1.0, math.floor)
    ('0.1234', '0.9000', '1.0000')
    """
    return f"{towards(round(t * 1e4, 6)) / 1e4:.4f}"


def group_text(group: Group, names: Mapping[str, str]) -> str:
    """A group of findings in words, and where it is; of several findings, where the worst one is."""
    worst = f"worst {group.worst.a} and {group.worst.b}" if len(group.rows) > 1 else ""
    said = sentence(group.rows, names, group.a, group.b)
    return "; ".join(filter(None, (said, worst, circumstances(group.worst))))


def where_text(where: Overlap) -> str:
    """The volume that two parts share, with certain digits only, and the box around it.

    >>> import numpy as np
    >>> where_text(Overlap((12.3412, 12.3419), np.array([[0.0, 1.0, 2.0], [3.0, 4.0, 5.04]])))
    'shared volume 12.34 mm3, within X 0 to 3, Y 1 to 4, Z 2 to 5.1 mm'
    >>> where_text(Overlap((0.2, 12.0), np.array([[0.0, 1.0, 2.0], [3.0, 4.0, 5.0]]), of_facets=True))
    'shared volume of the facets 0.2 to 12 mm3, within X 0 to 3, Y 1 to 4, Z 2 to 5 mm'
    """
    low, high = where.volume
    shown = ((f"{low:#.{digits}g}", f"{high:#.{digits}g}") for digits in (5, 4, 3, 2))
    certain = (least.rstrip(".") for least, most in shown if least == most)
    volume = next(certain, f"{_rounded(low, math.floor)} to {_rounded(high, math.ceil)}")
    ends = (
        [_rounded(round(x, 6) + 0.0, towards, digits=1) for x in corner]
        for corner, towards in zip(where.box.tolist(), (math.floor, math.ceil), strict=True)
    )
    box = ", ".join(f"{axis} {least} to {most}" for axis, least, most in zip("XYZ", *ends, strict=True))
    return f"shared volume{' of the facets' if where.of_facets else ''} {volume} mm3, within {box} mm"


def by_group(result: CheckResult, rows: Iterable[PairResult]) -> list[PairResult]:
    """Rows in the order of the groups of findings, then the others by verdict and distance."""
    place = {id(row): k for k, row in enumerate(row for group in grouped(result) for row in group.rows)}
    order = list(Verdict)
    return sorted(rows, key=lambda row: (place.get(id(row), len(place)), order.index(row.verdict), row.distance.upper))
