"""The public way in: `assemble` and what it answers."""

from pathlib import Path

import numpy as np

from clamp3d import assemble, load_clamp


def test_a_clamp_is_given_by_name_by_file_or_loaded(tmp_path):
    copy = tmp_path / "copy.toml"
    copy.write_text((Path(__file__).parents[2] / "clamp3d/clamp/data/reference.toml").read_text())
    found = [assemble(clamp, line="LJ-500", jumper=16) for clamp in ("reference", copy, load_clamp())]
    assert len({(a.status, a.distance) for a in found}) == 1
    assert repr(found[0]) == f"<Assembly reference: clamped, {found[0].distance:.3f} mm>"


def test_scenes_are_the_parts_at_their_poses():
    assembly = assemble()
    for waypoint in (assembly.path[0], assembly.path[-1]):
        scene = assembly.scene_at(waypoint)
        assert [part.name for part in scene.parts] == ["P1", "P2", "P3", "P4", "P5", "P6", "P7"]
        for part in scene.parts:
            assert np.array_equal(part.T_world, waypoint.T_world(part.name))
    assert all(np.array_equal(part.T_world, assembly.T_world(part.name)) for part in assembly.scene.parts)
