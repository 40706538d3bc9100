"""Contacts: measured in 3D by the engine, on the parts, and compared with the declared matrix in both directions."""

import json
import math
from dataclasses import replace

import numpy as np
import pytest
import shapely

from clamp3d import assemble, load_clamp, measure
from clamp3d.baselines import Chords, contact_model
from clamp3d.clamp.contact import measure_contacts, overlap, surfaces_at
from clamp3d.clamp.dimensions import GrooveDimensions
from clamp3d.clamp.parts import parts
from clamp3d.geometry.pose import SectionPose
from clamp3d.geometry.profile import Arc
from tests.clamp.random_clamps import changed

WIRES = [("LJ-630", "LJ-120"), ("LJ-16", "LJ-16"), (46.0, 14.0)]


@pytest.mark.parametrize(("line", "jumper"), WIRES)
def test_wires_and_splints_on_the_way_are_as_far_apart_as_their_outlines(line, jumper):
    """A section through the middle shows the distance: shapely measures the outlines, chords are within 1e-5 mm."""
    assembly = assemble(line=line, jumper=jumper)
    for waypoint in assembly.path:
        outline = {}
        for name, solid in parts(assembly.clamp).items():
            if name in ("P1", "P2", "P6", "P7"):
                u, v = (solid.bodies[0].profile.polygon(1e-5) @ solid.bodies[0].frame[:, :2].T)[:, [0, 2]].T
                corners = np.column_stack([u, 0.0 * u, v, 1.0 + 0.0 * u])
                outline[name] = shapely.Polygon(corners @ waypoint.T_world(name)[[0, 2]].T)
        pairs = [(a, b) for a in ("P1", "P2") for b in ("P6", "P7")]
        for (a, b), d in measure(assembly.scene_at(waypoint), pairs).items():
            assert d.value == pytest.approx(outline[a].distance(outline[b]), abs=3e-5), (waypoint.label, a, b)


def test_the_last_waypoint_has_the_contacts_of_the_final_state(run):
    assert {(c.a, c.b): c.gap for c in run.contacts_at(run.path[-1])} == {(c.a, c.b): c.gap for c in run.contacts}
    assert {pair: c.type for pair, c in run.matrix.items()} == {
        ("P1", "P5"): 2, ("P1", "P6"): 3, ("P1", "P7"): 3, ("P2", "P3"): 3,
        ("P2", "P6"): 3, ("P2", "P7"): 3, ("P3", "P4"): 2, ("P4", "P5"): 1,
    }  # fmt: skip


def test_every_difference_from_the_declared_matrix_is_named():
    clamp = load_clamp()
    wrong = {"P1": {"P3": 2}, "P2": {"P5": 2, "P7": 2}, "P3": {"P4": 0}, "P4": {"P5": 2}}
    rows = {a: {**clamp.connections.get(a, {}), **wrong.get(a, {})} for a in {*clamp.connections, *wrong}}
    assembly = assemble(replace(clamp, connections=rows))
    found = {f"{d.a}-{d.b}": d for d in assembly.matrix_differences}
    assert {pair: (d.declared, d.measured) for pair, d in found.items()} == {
        "P1-P3": (2, 0), "P1-P4": (2, 0), "P2-P4": (2, 0), "P2-P5": (2, 0), "P2-P7": (2, 3), "P3-P4": (0, 2),
        "P4-P5": (2, 1),
    }  # fmt: skip
    convex, end = "2 (convex object collision)", "in the final state"
    said = {
        "P1-P3": f"P1-P3 (up splint, saddle washer) declared {convex} but does not touch: 36.085 mm apart {end}",
        "P1-P4": f"P1-P4 (up splint, bolt) declared {convex} but does not touch: 1.000 mm apart {end}",
        "P2-P7": f"P2-P7 (down splint, jumper) declared {convex} but met as 3 (concave arc surface collision) {end}",
        "P3-P4": f"P3-P4 (saddle washer, bolt) declared 0 (no connection) but met as {convex} {end}",
        "P4-P5": f"P4-P5 (bolt, nut) declared {convex} but met as 1 (screw joint) {end}",
    }
    assert said.items() <= {pair: str(difference) for pair, difference in found.items()}.items()
    written = found["P1-P4"].to_dict()
    assert (written["gap_mm"], written["text"]) == (pytest.approx(1.0), said["P1-P4"])
    assert written["point"] == found["P1-P4"].place.tolist()
    assert assembly.clamped
    (undeclared,) = assembly.undeclared
    assert str(undeclared) == said["P3-P4"].replace("the final state", "P5|P3P4")
    assert undeclared.gap == pytest.approx(0.0, abs=1e-9)  # of the final state, not only somewhere on the way
    assert (assembly.findings[0].severity, assembly.findings[0].text) == ("error", str(undeclared))
    severity = {f.text[:5]: f.severity for f in assembly.findings if f.severity != "error"}
    assert severity == dict.fromkeys(("P1-P3", "P1-P4", "P2-P4", "P2-P5"), "note") | {
        "P2-P7": "warning",
        "P4-P5": "warning",
    }


def against_the_bolt():
    """Thick wires on narrow grooves near the bolt: in their middle they would reach 6 mm into its shank."""
    clamp = load_clamp(line=52, jumper=52)
    values = {"down_splint.slot_width": 30.0, "down_splint.max_tilt_deg": 5.0, "bolt.shank_length": 220.0}
    for splint, depth in (("up", clamp.up_splint.thickness + 5.0), ("down", clamp.down_splint.face_depth - 5.0)):
        groove = GrooveDimensions(radius=15.0, offset=30.0, centre_depth=depth)
        values |= dict.fromkeys((f"{splint}_splint.line_groove", f"{splint}_splint.jumper_groove"), groove)
    return changed(clamp, values)


def test_the_bolt_stops_wires_and_is_named():
    assembly = assemble(against_the_bolt())
    gaps = {(c.a, c.b): c.gap for c in assembly.contacts}
    assert min(gaps.values()) > -1e-8
    assert gaps["P4", "P6"] == pytest.approx(0.0, abs=1e-8)
    assert gaps["P4", "P7"] == pytest.approx(0.0, abs=1e-8)
    assert {(d.a, d.b) for d in assembly.undeclared} == {("P4", "P6"), ("P4", "P7")}
    assert {(f.a, f.b) for f in assembly.findings if f.severity == "error"} == {("P4", "P6"), ("P4", "P7")}
    assert {(f.a, f.b) for f in assembly.forces if f.force > 0.1} >= {("P4", "P6"), ("P4", "P7")}


def test_the_overlap_that_a_status_tells_of_is_one_finding_and_every_other_one_more(run):
    deep = {("P1", "P3"): -0.5, ("P4", "P6"): -1.2, ("P4", "P7"): -1e-7}

    def changed(c):
        gap = deep.get((c.a, c.b))
        return c if gap is None else replace(c, distance=replace(c.distance, lower=gap, upper=gap))

    status = replace(run.closing_status, clamped=False, text="not clamped: P4 overlaps P6 by 1.2 mm")
    made = replace(run, contacts=tuple(map(changed, run.contacts)), closing_status=status)
    errors = [(f.text, f.a, f.b) for f in made.findings if f.severity == "error"]
    assert errors == [(status.text, "P4", "P6"), ("P1 overlaps P3 by 0.5 mm", "P1", "P3")]
    assert run.passed
    assert not replace(made, closing_status=run.closing_status).passed


def test_plain_data_and_frame(run):
    pandas = pytest.importorskip("pandas")
    data = json.loads(json.dumps(run.to_dict(), allow_nan=False))
    assert len(data["contacts"]) == 21
    assert {"status", "distance_mm", "parts", "contacts", "seats", "events", "residuals", "work"} <= set(data)
    assert data["parts"]["P2"]["T_world"][0][3] == pytest.approx(run.poses["P2"].x)
    assert data["tilt_deg"] == data["path"][-1]["parts"]["P2"]["angle_deg"] == pytest.approx(12.0, abs=0.01)
    down = run.poses["P2"]
    section = {"x": down.x, "y": down.y, "angle_deg": math.degrees(down.angle)}
    assert data["parts"]["P2"]["section"] == data["path"][-1]["parts"]["P2"] == section
    assert data["residuals"] == {"largest_violated_gap_mm": run.violation, "optimality_mm": run.optimality}
    assert [event["travel_mm"] for event in data["events"]] == [event.travel for event in run.events]
    assert [seat["gap_mm"] for seat in data["seats"]] == [seat.gap for seat in run.seats]
    assert [contact["point"] for contact in data["contacts"]] == [c.point.tolist() for c in run.contacts]
    assert (data["other_ends"], data["with_play_mm"]) == (None, None)
    up, line, jumper = (run.path[4].poses[name] for name in ("P1", "P6", "P7"))
    start = [pytest.approx((wire.x - up.x, wire.y - up.y)) for wire in (line, jumper)]
    assert [data["start"]["line"], data["start"]["jumper"]] == start
    begins = run.path[4].poses["P2"].y - up.y, 0.0
    assert (data["start"]["closing_mm"], data["start"]["tilt_deg"]) == pytest.approx(begins, abs=1e-9)
    frame = run.frame()
    assert isinstance(frame, pandas.DataFrame)
    assert frame["distance_mm"].tolist() == [c.gap for c in run.contacts]
    assert "P1-P2" in run._repr_html_()


def test_a_contact_model_measures_its_own_contacts():
    assembly = assemble(model=Chords(math.radians(20.0)))
    assert assembly.clamped
    assert {(d.a, d.b) for d in assembly.matrix_differences} == {("P1", "P4"), ("P2", "P4")}
    arcs = [c for c in assembly.contacts if c.declared == 3]
    assert all(abs(c.gap) <= 1e-9 and c.distance.method == "chords" for c in arcs)
    assert all(c.distance.lower <= c.gap <= c.distance.upper for c in arcs)
    saddle = [c.gap for c in assembly.contacts_at(assembly.path[4]) if (c.a, c.b) == ("P2", "P3")]
    assert saddle == [pytest.approx(0.0, abs=1e-9)]  # drawn up to its chords from the outset


def test_moved_parts_are_named_in_the_papers_words(run):
    """Bolt and hole as in Table 2, an arc and its wire as in Table 3; what the paper has no word for is plain."""
    clamp, home = load_clamp(), {name: replace(pose, along=0.5) for name, pose in run.poses.items()}
    up, down, one_side = clamp.up_splint, clamp.down_splint, "two points on one side"
    face = home["P1"].y + up.thickness
    level, tilt = face - home["P2"].y - down.face_depth, home["P2"].angle  # where the splints' faces meet untilted
    lip = home["P1"].x + 68.5 - 46.0349 - math.sqrt(23.8012**2 - (48.7901 - up.thickness) ** 2)

    def slot(side, t):  # the nearest corner of the tilted slot on the bolt
        corners = (21.0 * math.cos(t) + side * v * math.sin(t) for v in (down.face_depth, down.slot_bottom))
        return {"x": side * (10.0 - min(corners)), "angle": t - tilt}

    cases = [
        ("P1-P4", {"x": 0.5}, 0, "none", "hole", 0.5),
        ("P1-P4", {"x": -1.0, "y": 100.0}, 2, one_side, "hole", 0.0),
        ("P1-P4", {"x": 1.01}, 2, "overlap", "hole", -0.01),
        ("P1-P4", {"along": 1.0}, 2, "contact", "hole", 0.0),
        *(("P4-P2", slot(side, 0.0), 2, one_side, "hole", 0.0) for side in (-1, 1)),
        *(("P4-P2", slot(side, t), 2, "one point", "hole", 0.0) for side in (-1, 1) for t in (-0.05, 0.05)),
        ("P4-P5", {"x": 1e-7}, 1, "screw joint", "thread", 0.0),
        *(("P4-P5", by, 2, "overlap", "hole", -0.1) for by in ({"x": 0.1}, {"along": -0.1})),
        *(("P4-P5", {"y": y}, 0, "none", None, None) for y in (160.0, -90.0)),
        ("P3-P4", {"x": 0.5 * clamp.saddle.hole_diameter - 10.0, "y": 0.5}, 2, "contact", "hole", 0.0),
        ("P1-P6", {"x": lip - 0.05, "y": face + 16.335}, 2, "contact", "flat face", 0.0),
        *((pair, {"y": 0.5}, 0, "inside", "arc", None) for pair in ("P1-P6", "P2-P3")),
        *((pair, {"y": -0.5}, 3, "intersect", "arc", None) for pair in ("P1-P6", "P2-P3")),
        ("P1-P2", {"y": level, "angle": -tilt}, 2, "seat", None, 0.0),
        ("P1-P2", {"y": level + 0.5e-7 * down.width, "angle": 1e-7 - tilt}, 2, "contact", None, 0.0),
        ("P1-P2", {"y": level - 0.1, "angle": -tilt}, 2, "overlap", None, -0.1),
    ]
    for names, by, kind, relation, feature, gap in cases:
        moved = replace(home[names[3:]], **{key: getattr(home[names[3:]], key) + value for key, value in by.items()})
        (c,) = measure_contacts(clamp, {**home, names[3:]: moved}, pairs=[tuple(sorted(names.split("-")))])
        assert (c.type, c.relation) == (kind, relation), (names, by)
        assert feature in (None, c.feature)
        assert gap is None or c.gap == pytest.approx(gap, abs=2e-7)
        sure = "at least " * (names not in ("P1-P2", "P1-P4"))  # else only one bound is attested
        assert overlap(c) == (f"{c.a} overlaps {c.b} by {sure}{-c.gap:.4g} mm" if c.gap < -1e-6 else "")


@pytest.mark.parametrize(("by", "kind"), [({}, (3, "arc")), ({"x": -12.4, "y": 2.687}, (2, "flat face"))])
def test_points_of_meshes_are_of_the_surfaces_that_they_approximate(run, by, kind):
    wire = run.poses["P6"]
    poses = {**run.poses, "P6": replace(wire, **{key: getattr(wire, key) + value for key, value in by.items()})}
    (c,) = measure_contacts(run.clamp, poses, contact_model("mesh", parts(run.clamp)), pairs=[("P1", "P6")])
    assert (c.type, c.feature) == kind


@pytest.mark.parametrize("part", ["P1", "P2", "P3", "P5", "P6"])
def test_surfaces_at_a_point_are_those_that_sampling_finds_nearest(part):
    """Points along each outline; the ends of a body are planes. On an arc's end it is a lip."""
    solid, rng, T, rows = parts(load_clamp())[part], np.random.default_rng(8), SectionPose(7.0, -9.0, 0.3).T(), []
    body = solid.bodies[0]
    for drawn, edge in [(extrusion, edge) for extrusion in (body, *solid.holes) for edge in extrusion.profile.edges]:
        points, name = np.linspace(edge.start, edge.end, 2001), "flat face"
        if isinstance(edge, Arc):
            points = np.array([edge.at(t) for t in np.linspace(edge.start_angle, edge.end_angle, 2001)])
            name = "round face" if edge.sweep > 0.0 else "arc"
        rows.append((name if drawn is body else "hole", drawn.frame, points))
    for _ in range(120):
        name, frame, points = rows[rng.integers(len(rows))]
        ab = points[rng.choice([0, 2000, rng.integers(2001)])] + rng.choice([0.0, 2.0]) * rng.normal(size=2)
        local = frame @ (*ab, rng.choice([0.5 * (body.start + body.end), body.start, body.end + 0.01, body.end - 3.0]))
        name = "end face" if body.axis == "Y" else "flat face"
        near = [(abs(local @ body.frame[:, 2] - end), name) for end in (body.start, body.end)]
        for kind, axes, outline in rows:
            away = np.hypot(*(outline - (local @ axes)[:2]).T)
            near.append((away.min(), "lip" if kind == "arc" and min(away[0], away[-1]) < 1e-7 else kind))
        found = {surface.name for surface in surfaces_at(solid, T, T[:3, :3] @ local + T[:3, 3], 0.02)}
        sure, may = ({name for away, name in near if away <= min(near)[0] + reach} for reach in (0.015, 0.025))
        assert sure <= found <= may
