"""The reference clamp as STL with 0.05 mm chord error, read back: its final state from nothing but the meshes."""

from dataclasses import replace

import numpy as np
import pytest

from clamp3d.baselines.cas import Cas
from clamp3d.clamp.assemble import assemble
from clamp3d.clamp.dimensions import Wire
from clamp3d.clamp.loader import load_clamp
from clamp3d.clamp.parts import parts
from clamp3d.fit.fit import fit_file
from clamp3d.geometry.meshing import mesh


@pytest.fixture(scope="module")
def fits(tmp_path_factory):
    folder = tmp_path_factory.mktemp("stl")
    out = {}
    for name, part in parts(load_clamp()).items():
        mesh(part, 0.05).export(folder / f"{name}.stl")
        out[name] = fit_file(folder / f"{name}.stl")
    return out


def test_every_round_surface_is_found_and_no_other(fits):
    found = {n: (len(f.grooves), len(f.cylinders), len(f.holes)) for n, f in fits.items()}
    assert found == {
        "P1": (2, 0, 1),
        "P2": (2, 1, 0),
        "P3": (1, 0, 1),
        "P4": (0, 1, 0),
        "P5": (0, 0, 1),
        "P6": (0, 1, 0),
        "P7": (0, 1, 0),
    }


def test_final_state_from_the_meshes(fits):
    clamp = load_clamp()

    def groove(part, side):
        """Radius, offset from the bolt axis and depth of the arc's centre, from the fit alone."""
        g = max(fits[part].grooves, key=lambda g: side * g.T_part_feature[0, 3])
        x, _, z = g.T_part_feature[:3, 3]
        bolt = fits["P1"].holes[0].T_part_feature[0, 3] if part == "P1" else 0.0
        assert abs(g.T_part_feature[1, 2]) == pytest.approx(1.0, abs=1e-9)
        return {"radius": g.radius, "offset": side * (x - bolt), "centre_depth": -z}

    def splint(part, base):
        return replace(
            base,
            line_groove=replace(base.line_groove, **groove(part, -1)),
            jumper_groove=replace(base.jumper_groove, **groove(part, 1)),
        )

    fitted = replace(
        clamp,
        line=Wire(diameter=2 * fits["P6"].cylinders[0].radius),
        jumper=Wire(diameter=2 * fits["P7"].cylinders[0].radius),
        up_splint=splint("P1", clamp.up_splint),
        down_splint=replace(splint("P2", clamp.down_splint), back_radius=fits["P2"].cylinders[0].radius),
        saddle=replace(clamp.saddle, radius=fits["P3"].grooves[0].radius),
    )
    run, true = assemble(fitted, Cas()), assemble(clamp, Cas())
    bound = sum(f.fit_error for part in ("P1", "P2", "P6", "P7") for f in (*fits[part].grooves, *fits[part].cylinders))
    assert abs(run.distance - true.distance) < 1e-3
    assert abs(run.distance - 31.5298) < 0.01
    # Six surfaces lie between the splints; the levers of this clamp stay below 5.
    assert abs(run.distance - true.distance) < 5 * bound
    assert np.isfinite(run.distance)
