"""Image measurement: closed forms for marks, pixel truth for pictures, the paper's five values for the errors."""

import json
import math

import numpy as np
import pytest
from click.testing import CliRunner
from PIL import Image

from clamp3d import InputError, assemble, load_clamp
from clamp3d.baselines import Cas
from clamp3d.bench.image import FITTING_ERROR, PX_PER_MM, image_study, measure_image
from clamp3d.bench.picture import find_end_points, picture, snap_marks
from clamp3d.bench.published import ACTUAL_DISTANCE, IMAGE_DISTANCES
from clamp3d.cli.bench import MeasureImage
from tests.refusals import refusals


@pytest.fixture(scope="module")
def shown(run):
    return picture(run, PX_PER_MM)


def test_perfect_marks_give_the_exact_distance(run, shown):
    left, right, below = shown.end_points
    measured = measure_image([left, below], [left, right], shown.reference)
    assert measured.distance == pytest.approx(run.distance, abs=1e-12)
    assert measured.mm_per_px == pytest.approx(1.0 / PX_PER_MM, abs=1e-15)
    # P2's corner is half a width along the splint and face_depth below its origin, tilted by 12 degrees.
    t, down = run.poses["P2"].angle, run.clamp.down_splint
    sideways = run.clamp.up_splint.width / 2 - (down.width / 2 * math.cos(t) - down.face_depth * math.sin(t))
    assert measured.straight == pytest.approx(math.hypot(run.distance, sideways), abs=1e-9)
    assert measured.straight - measured.height == pytest.approx(0.684, abs=1e-3)


@pytest.mark.parametrize(("scale", "line", "jumper"), [(2.0, "LJ-630", "LJ-120"), (3.3, "LJ-500", "LJ-500")])
def test_found_end_points_are_the_drawn_ones(scale, line, jumper):
    closed = assemble(load_clamp(line=line, jumper=jumper), Cas())
    drawn = picture(closed, scale)
    error = find_end_points(drawn.image) - drawn.end_points
    assert np.abs(error).max() < 0.15
    assert error.std() < 2.0 * FITTING_ERROR


def test_study(run):
    study = image_study(run, count=20_000, seed=7)
    assert study.trials == pytest.approx(study.exact + study.errors[:5])
    rms = np.sqrt(np.mean(study.errors**2))
    assert study.median_error == pytest.approx(0.6745 * rms, rel=0.03)  # normal errors
    published = np.array(IMAGE_DISTANCES) - ACTUAL_DISTANCE
    assert rms == pytest.approx(np.sqrt(np.mean(published**2)), rel=0.03)  # the default errors scatter as the paper's
    assert abs(study.automatic.distance - run.distance) < 4.0 * study.automatic.uncertainty < 0.12


def test_snapping_finds_the_corner(shown):
    rng = np.random.default_rng(5)
    marks = shown.end_points + rng.uniform(-4.0, 4.0, (3, 2))
    assert np.abs(snap_marks(shown.image, marks, 10.0) - shown.end_points).max() < 0.3
    with pytest.raises(InputError, match="no corner within 5 px"):
        snap_marks(shown.image, np.array([[10.0, 10.0]]), 5.0)


GOOD = [(0.0, 0.0), (3.0, 4.0)]
test_bad_values = refusals(
    (lambda: measure_image([(0, 0)], GOOD, 1.0), "points must have shape"),
    (lambda: measure_image([(0, 0), (0, math.nan)], GOOD, 1.0), "points must be finite"),
    (lambda: measure_image(GOOD, [(1, 1), (1.5, 1)], 1.0), "reference must be two marks at least 1 px apart"),
    (lambda: measure_image(GOOD, GOOD, 0.0), "reference_mm must be finite and > 0, got 0.0"),
    (lambda: measure_image(GOOD, "ab", 1.0), "reference must be an array of numbers"),
    (lambda: measure_image(GOOD, GOOD, 1.0, marking_error=-1.0), "marking_error"),
    (lambda: find_end_points(np.full((50, 50, 3), 236, dtype=np.uint8)), "no region of the colour of P1"),
)


def test_the_command_measures_a_photograph(shown, tmp_path):
    file, out = tmp_path / "clamp.png", tmp_path / "out.json"
    Image.fromarray(shown.image).save(file)
    (tmp_path / "text.png").write_text("not a picture")
    left, right, below = (f"{x:.3f},{y:.3f}" for x, y in shown.end_points)
    options = ["--points", f"{left} {below}", "--reference", f"{left} {right}", "--scale", "137"]
    result = CliRunner().invoke(MeasureImage, [str(file), *options, "--json", str(out)])
    assert result.exit_code == 0, result.output
    assert "31.530 mm +- 1.597 mm" in result.stdout
    assert json.loads(out.read_text())["distance"] == pytest.approx(shown.distance, abs=1e-3)
    for arguments, message in (
        ([str(tmp_path / "none.png"), *options], "No such file"),
        ([str(tmp_path / "text.png"), *options], "not a picture"),
        ([str(file), *options[:1], "1,2 3", *options[2:]], "must be two positions"),
        ([str(file), *options[:1], "1,2 30,99999", *options[2:]], "must lie in the picture, which is 637 x 754 px"),
    ):
        result = CliRunner().invoke(MeasureImage, arguments)
        assert result.exit_code != 0
        assert message in result.output + str(result.exception)
