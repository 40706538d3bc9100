"""A run as text for the terminal and as plain data for JSON."""

from __future__ import annotations

import math
from typing import Any

from clamp3d import __version__
from clamp3d.clamp.dimensions import PARTS, TITLES
from clamp3d.clamp.result import Assembly


def run_to_dict(run: Assembly) -> dict[str, Any]:
    """The run as JSON data; lengths in mm, angles in degrees, ``T_world`` as rows."""
    return {
        "clamp3d": __version__,
        "clamp": run.clamp.name,
        "line": run.clamp.line.label,
        "jumper": run.clamp.jumper.label,
        "method": run.method,
        "solver": run.solver,
        "limits": list(run.limits),
        "status": run.status,
        "distance_mm": run.distance,
        "closing_mm": run.closing,
        "tilt_deg": math.degrees(run.tilt),
        "nut_turns": run.turns,
        "parts": {
            name: {
                "title": TITLES[name],
                "T_world": run.T_world(name).tolist(),
                "section": {"x": pose.x, "y": pose.y, "angle_deg": math.degrees(pose.angle)},
            }
            for name, pose in run.poses.items()
        },
        "contacts": [
            {
                "a": c.a,
                "b": c.b,
                "type": c.type,
                "relation": c.relation,
                "distance_mm": c.distance if math.isfinite(c.distance) else None,
                "point": c.point.tolist(),
                "normal": c.normal.tolist(),
                "feature": c.feature,
            }
            for c in run.contacts
        ],
        "seats": [
            {"splint": s.splint, "wire": s.wire, "seated": s.seated, "gap_mm": s.gap, "detail": s.detail}
            for s in run.seats
        ],
        "events": [
            {
                "step": e.step,
                "a": e.a,
                "b": e.b,
                "relation": e.relation,
                "point": e.point.tolist(),
                "travel_mm": e.travel,
            }
            for e in run.events
        ],
        "undeclared": [str(u) for u in run.undeclared],
        "residuals": {"largest_violated_gap_mm": run.violation, "optimality_mm": run.optimality},
        "other_ends": None
        if run.others is None
        else [
            {
                "distance_mm": e.distance,
                "closing_mm": e.closing,
                "tilt_deg": math.degrees(e.tilt),
                "status": e.status,
                "detail": e.detail,
                "rests": e.rests,
            }
            for e in run.others
        ],
        "work": {
            "parts": run.work.parts,
            "pairs": run.work.pairs,
            "contact_queries": run.work.contact_queries,
            "motion_steps": run.work.motion_steps,
            "meshes_built": run.work.meshes_built,
        },
    }


def run_to_text(run: Assembly) -> str:
    """The run as lines for a terminal, numbers to the paper's printed digits."""
    clamp = run.clamp
    lines = [
        f"clamp {clamp.name}: line {clamp.line.label} ({2 * clamp.line.radius:g} mm), "
        f"jumper {clamp.jumper.label} ({2 * clamp.jumper.radius:g} mm); method {run.method}, {run.solver}"
        + (f" ({'; '.join(run.limits)})" if run.limits else ""),
        f"{run.status}; distance between the splints {run.distance:.3f} mm, tilt {math.degrees(run.tilt):.2f} deg, "
        f"nut turned {run.turns:.2f} times from open",
        *(
            f"{'another equilibrium:' if e.rests else 'put together otherwise it ends at'} "
            f"{e.distance:.3f} mm, tilt {_tidy(math.degrees(e.tilt), 2)} deg" + (f": {e.detail}" if e.detail else "")
            for e in run.others or ()
        ),
        "",
        "final state (mm; x right, y down from the power line's centre, angle counter-clockwise)",
        f"  {'part':18s} {'x':>10s} {'y':>10s} {'angle_deg':>10s}",
    ]
    for name in PARTS:
        pose = run.poses[name]
        title = f"{name} {TITLES[name]}"
        lines.append(
            f"  {title:18s} {_tidy(pose.x, 3):>10s} {_tidy(pose.y, 3):>10s} {_tidy(math.degrees(pose.angle), 2):>10s}"
        )
    lines += ["", "contacts (gap in mm; x, y of the point)"]
    for c in run.contacts:
        lines.append(
            f"  {c.a}-{c.b}  type {c.type}  {c.relation:26s} {_gap(c.distance):>10s}  "
            f"at {_tidy(float(c.point[0]), 3):>8s}, {_tidy(-float(c.point[2]), 3):>8s}  on {c.feature}"
        )
    lines += ["", "grooves"]
    for s in run.seats:
        lines.append(f"  {s.splint}-{s.wire}  seated {'yes' if s.seated else 'no ':3s}  {s.detail}")
    lines += ["", "events (mm travelled in the step)"]
    for e in run.events:
        lines.append(f"  {e.step:14s} {e.a}-{e.b}  {e.relation:26s} after {e.travel:8.3f}")
    if run.undeclared:
        lines += ["", "met although the connection matrix says otherwise"]
        lines += [f"  {u}" for u in run.undeclared]
    lines.append("")
    if run.violation is not None and run.optimality is not None:
        lines.append(f"proof: largest violated gap {run.violation:.1e} mm, optimality {run.optimality:.1e} mm")
    work = run.work
    lines.append(
        f"work: {work.parts} parts, {work.pairs} pairs, {work.contact_queries} contact queries, "
        f"{work.motion_steps} motion steps, {work.meshes_built} meshes built"
    )
    return "\n".join(lines)


def _tidy(value: float, digits: int) -> str:
    """Fixed digits without a negative zero."""
    return f"{round(value, digits) + 0.0:.{digits}f}"


def _gap(value: float) -> str:
    return "0" if abs(value) < 5e-10 else f"{value:.3g}" if abs(value) < 1e-3 else f"{value:.3f}"
