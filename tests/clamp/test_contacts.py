"""Contacts: measured in 3D by the engine, on the parts, and compared with the declared matrix in both directions."""

import json
import math
from dataclasses import replace

import numpy as np
import pytest
import shapely

from clamp3d import assemble, load_clamp, measure
from clamp3d.baselines import Chords
from clamp3d.clamp.dimensions import GrooveDimensions
from clamp3d.clamp.parts import parts
from clamp3d.clamp.surfaces import SURFACES, surfaces_at

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


def test_reference_differs_from_its_matrix_where_the_bolt_has_play():
    assembly = assemble()
    assert [(d.a, d.b, d.declared, d.measured) for d in assembly.matrix_differences] == [
        ("P1", "P4", 2, 0),
        ("P2", "P4", 2, 0),
    ]
    assert "P1-P4 (up splint, bolt) declared 2 (convex object collision) but does not touch: 1.000 mm apart" in str(
        assembly.matrix_differences[0]
    )
    assert {pair: c.type for pair, c in assembly.matrix.items()} == {
        ("P1", "P5"): 2, ("P1", "P6"): 3, ("P1", "P7"): 3, ("P2", "P3"): 3,
        ("P2", "P6"): 3, ("P2", "P7"): 3, ("P3", "P4"): 2, ("P4", "P5"): 1,
    }  # fmt: skip
    found = {(c.a, c.b): c for c in assembly.contacts}
    assert found["P1", "P5"].relation == found["P3", "P4"].relation == "seat"
    assert found["P4", "P5"].relation == "screw joint"
    # Measured on the exported STEP by Open CASCADE; the slot is 1 mm longer than the bolt.
    assert found["P1", "P2"].gap == pytest.approx(3.729354, abs=1e-6)
    for pair in (("P1", "P4"), ("P2", "P4")):
        assert found[pair].gap == pytest.approx(1.0, abs=1e-6)
        assert (found[pair].relation, found[pair].feature) == ("none", "hole")


def test_every_difference_from_the_declared_matrix_is_named():
    clamp = load_clamp()
    wrong = {"P1": {"P3": 2}, "P2": {"P5": 2, "P7": 2}, "P3": {"P4": 0}}
    rows = {a: {**clamp.connections.get(a, {}), **wrong.get(a, {})} for a in {*clamp.connections, *wrong}}
    assembly = assemble(replace(clamp, connections=rows))
    found = {f"{d.a}-{d.b}": d for d in assembly.matrix_differences}
    assert {pair: (d.declared, d.measured) for pair, d in found.items()} == {
        "P1-P3": (2, 0), "P1-P4": (2, 0), "P2-P4": (2, 0), "P2-P5": (2, 0), "P2-P7": (2, 3), "P3-P4": (0, 2),
    }  # fmt: skip
    assert "does not touch: 36.085 mm apart" in str(found["P1-P3"])
    assert "does not touch: 41.490 mm apart" in str(found["P2-P5"])
    assert assembly.clamped
    (undeclared,) = assembly.undeclared
    assert (undeclared.a, undeclared.b, undeclared.declared, undeclared.measured) == ("P3", "P4", 0, 2)
    assert undeclared.gap == pytest.approx(0.0, abs=1e-9)  # of the final state, not only somewhere on the way
    assert (assembly.findings[0].severity, assembly.findings[0].text) == ("error", str(undeclared))
    assert "warning" in {f.severity for f in assembly.findings if "P2-P7" in f.text}


def against_the_bolt():
    """Thick wires on narrow grooves near the bolt: in their middle they would reach 6 mm into its shank."""
    clamp = load_clamp(line=52, jumper=52)

    def grooves(depth):
        groove = GrooveDimensions(radius=15.0, offset=30.0, centre_depth=depth)
        return {"line_groove": groove, "jumper_groove": groove}

    up, down = clamp.up_splint, clamp.down_splint
    return replace(
        clamp,
        up_splint=replace(up, **grooves(up.thickness + 5.0)),
        down_splint=replace(down, **grooves(down.face_depth - 5.0), slot_width=30.0, max_tilt_deg=5.0),
        bolt=replace(clamp.bolt, shank_length=220.0),
    )


def test_the_bolt_stops_wires_and_is_named():
    assembly = assemble(against_the_bolt())
    gaps = {(c.a, c.b): c.gap for c in assembly.contacts}
    assert min(gaps.values()) > -1e-8
    assert gaps["P4", "P6"] == pytest.approx(0.0, abs=1e-8)
    assert gaps["P4", "P7"] == pytest.approx(0.0, abs=1e-8)
    assert {(d.a, d.b) for d in assembly.undeclared} == {("P4", "P6"), ("P4", "P7")}
    assert {(f.a, f.b) for f in assembly.findings if f.severity == "error"} == {("P4", "P6"), ("P4", "P7")}
    assert {(f.a, f.b) for f in assembly.forces if f.force > 0.1} >= {("P4", "P6"), ("P4", "P7")}


def test_plain_data_and_frame():
    pandas = pytest.importorskip("pandas")
    assembly = assemble()
    data = json.loads(json.dumps(assembly.to_dict(), allow_nan=False))
    assert len(data["contacts"]) == 21
    assert {"status", "distance_mm", "parts", "contacts", "seats", "events", "residuals", "work"} <= set(data)
    assert data["parts"]["P2"]["T_world"][0][3] == pytest.approx(assembly.poses["P2"].x)
    frame = assembly.frame()
    assert isinstance(frame, pandas.DataFrame)
    assert frame["distance_mm"].tolist() == [c.gap for c in assembly.contacts]
    assert "P1-P2" in assembly._repr_html_()


def test_a_contact_model_measures_its_own_contacts():
    assembly = assemble(model=Chords(math.radians(20.0)))
    assert assembly.clamped
    assert {(d.a, d.b) for d in assembly.matrix_differences} == {("P1", "P4"), ("P2", "P4")}
    arcs = [c for c in assembly.contacts if c.declared == 3]
    assert all(abs(c.gap) <= 1e-9 and c.distance.method == "chords" for c in arcs)
    assert all(c.distance.lower <= c.gap <= c.distance.upper for c in arcs)


@pytest.mark.parametrize(
    ("part", "point", "name"),
    [
        ("P1", (10.0, 30.0, -10.0), "end face"),
        ("P1", (0.0, 0.0, -10.0), "flat face"),
        ("P1", (79.5, 0.0, -10.0), "hole"),
        ("P6", (0.0, 0.0, 16.335), "round face"),
        ("P5", (0.0, 14.0, 0.0), "flat face"),
    ],
)
def test_surfaces_have_their_names(part, point, name):
    names = [surface.name for surface in surfaces_at(parts(load_clamp())[part], np.eye(4), np.array(point))]
    assert min(names, key=SURFACES.index) == name
