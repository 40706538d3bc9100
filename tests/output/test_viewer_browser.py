"""The viewer in a real browser: the live page, the page as a file, and a meshcat server that was there before.

The scene is looked at in two ways: the poses in the browser's scene tree against the run's, and the pixels at points of
the cut faces, found with the browser's own camera, against the part's colour.
"""

import io
import os
import shutil
import time

import numpy as np
import pytest

from clamp3d.baselines.cas import Cas
from clamp3d.clamp.assemble import assemble
from clamp3d.clamp.loader import load_clamp
from clamp3d.output.palette import PART_COLOURS
from clamp3d.output.report import report
from clamp3d.output.report_page import write_report
from clamp3d.output.viewer import Viewer
from clamp3d.output.viewer_overlay import overlay

playwright_api = pytest.importorskip(
    "playwright.sync_api", reason="browser tests need playwright: pip install 'clamp3d[dev]'"
)
Image = pytest.importorskip("PIL.Image")

ARGUMENTS = [
    "--no-sandbox",
    "--use-gl=angle",
    "--use-angle=swiftshader",
    "--enable-unsafe-swiftshader",
    "--ignore-gpu-blocklist",
    "--disable-quic",
    "--no-first-run",
    "--disable-background-networking",
    "--disable-component-update",
    "--disable-sync",
]
CUT = {"P1": (110.0, 8.0), "P2": (-58.0, 30.0), "P3": (-16.5, 57.0), "P6": (-9.0, 0.0), "P7": (-4.5, 0.0)}
"""Points (u, v) of cut faces that no label, contact or other part covers in the final state."""


def chromium():
    named = os.environ.get("CLAMP3D_CHROMIUM")
    names = ("chromium", "chromium-browser", "google-chrome", "google-chrome-stable")
    return named or next((path for path in map(shutil.which, names) if path), None)


@pytest.fixture(scope="module")
def browser():
    with playwright_api.sync_playwright() as playwright:
        try:
            browser = playwright.chromium.launch(executable_path=chromium(), args=ARGUMENTS, timeout=60_000)
        except playwright_api.Error as error:
            if chromium() is not None:
                raise
            pytest.skip(f"no Chromium here (install it, or set CLAMP3D_CHROMIUM): {str(error).splitlines()[0]}")
        yield browser
        browser.close()


@pytest.fixture(scope="module")
def run():
    return assemble(load_clamp(), Cas())


@pytest.fixture(scope="module")
def page(browser, run, tmp_path_factory):
    """The page as a file, opened without a network."""
    path = tmp_path_factory.mktemp("page") / "run.html"
    with Viewer(run.clamp, Cas(), serve=False) as viewer:
        for waypoint in run.path:
            viewer.show(waypoint)
        viewer.finish(run)
        viewer.write(path)
    page = open_page(browser, path.as_uri(), offline=True)
    wait_for(page, "viewer.animator.duration > 0 && viewer.scene.getObjectByName('clamp3d') !== undefined")
    page.evaluate("viewer.animator.pause()")
    yield page
    assert page.problems == []


def open_page(browser, url, *, offline=False):
    context = browser.new_context(viewport={"width": 900, "height": 620}, offline=offline)
    page = context.new_page()
    page.problems = []
    page.on("pageerror", lambda error: page.problems.append(str(error)))
    page.on("console", lambda message: page.problems.append(message.text) if message.type == "error" else None)
    page.goto(url)
    return page


def wait_for(page, condition):
    page.wait_for_function(f"() => {condition}", timeout=30_000)


def pose_in_browser(page, path):
    """Pose (4, 4) in mm of a node below /clamp3d, from the browser's world matrices."""
    values = page.evaluate(
        """path => {
            const root = viewer.scene_tree.find(["clamp3d"]).object;
            root.updateMatrixWorld(true);
            const node = viewer.scene_tree.find(["clamp3d", ...path]).object;
            return root.matrixWorld.clone().invert().multiply(node.matrixWorld).elements;
        }""",
        path,
    )
    return np.reshape(values, (4, 4)).T


def visible(page, *path):
    return page.evaluate("path => viewer.scene_tree.find(['clamp3d', ...path]).object.visible", list(path))


def pixels(page):
    page.evaluate("viewer.render()")
    return np.asarray(Image.open(io.BytesIO(page.screenshot())).convert("RGB")).astype(int)


def on_screen(page, points):
    """Pixel (column, row) of each world point (n, 3) mm."""
    return page.evaluate(
        """points => {
            const root = viewer.scene_tree.find(["clamp3d"]).object;
            const box = viewer.renderer.domElement.getBoundingClientRect();
            viewer.scene.updateMatrixWorld(true);
            viewer.camera.updateMatrixWorld(true);
            return points.map((p) => {
                const v = new MeshCat.THREE.Vector3(...p).applyMatrix4(root.matrixWorld).project(viewer.camera);
                return [box.left + box.width * (v.x + 1) / 2, box.top + box.height * (1 - v.y) / 2];
            });
        }""",
        np.asarray(points).tolist(),
    )


def cut_colours(page, poses):
    """The colours (RGB) seen at the points of CUT."""
    points = [(x, 0.0, -y) for x, y in (poses[name].point(*uv) for name, uv in CUT.items())]
    image = pixels(page)
    return {name: image[round(y), round(x)] for name, (x, y) in zip(CUT, on_screen(page, points), strict=True)}


def assert_drawn(page, poses):
    for name, seen in cut_colours(page, poses).items():
        colour = [int(PART_COLOURS[name][i : i + 2], 16) for i in (1, 3, 5)]
        np.testing.assert_allclose(seen, colour, atol=3, err_msg=name)


def go_to(page, number):
    page.evaluate("n => document.getElementById('marks').children[n].click()", number)
    page.wait_for_timeout(100)


def test_page_draws_every_part_where_the_run_ends(page, run):
    go_to(page, len(run.path) - 1)
    assert_drawn(page, run.poses)


def test_page_steps_through_the_sequence(page, run):
    go_to(page, 0)
    for number, waypoint in enumerate(run.path):
        assert waypoint.label in page.inner_text("#label")
        assert waypoint.step in page.inner_text("#step")
        for name, pose in waypoint.poses.items():
            tree = "cutaway" if number % 2 else "whole"
            title = page.evaluate(
                """([tree, name]) => Object.keys(viewer.scene_tree.find(["clamp3d", tree]).children)
                    .find((key) => key.startsWith(name + " "))""",
                [tree, name],
            )
            T = pose_in_browser(page, [tree, title])
            np.testing.assert_allclose(T[:3, 3], pose.T()[:3, 3], atol=2e-4)
            if name != "P5":  # the nut also turns
                np.testing.assert_allclose(T[:3, :3], pose.T()[:3, :3], atol=1e-5)
        for other in range(len(run.path)):
            group = f"{other + 1} {run.path[other].label}"
            assert visible(page, "contacts", group) == (other == number)
            assert visible(page, "gaps", group) == (other == number)
        page.click("#forward")
        page.wait_for_timeout(50)
    page.click("#back")
    assert run.path[-2].label in page.inner_text("#label")


def test_parts_are_half_way_between_two_stops_at_half_time(page, run):
    page.evaluate(
        """() => {
            const slider = document.getElementById("time"), times = viewer.animator.actions[0]._clip.tracks[0].times;
            slider.value = (times[1] + times[2]) / 2;
            slider.dispatchEvent(new Event("input"));
        }"""
    )
    a, b = (w.poses["P1"].T()[:3, 3] for w in run.path[:2])
    T = pose_in_browser(page, ["whole", "P1 up splint"])
    np.testing.assert_allclose(T[:3, 3], (a + b) / 2, atol=0.1)  # the slider goes in thousandths of a second
    assert "on the way" in page.inner_text("#label")
    assert not any(
        visible(page, "contacts", f"{i + 1} {w.label}") for i, w in enumerate(run.path)
    )  # they would be stale


def test_grooves_take_the_colour_of_their_verdict(page):
    def seen(part, groove):
        return page.evaluate(
            """path => { const n = viewer.scene_tree.find(["clamp3d", "cutaway", ...path]);
                return Object.keys(n.children).filter((k) => n.children[k].object.visible); }""",
            [part, groove],
        )

    go_to(page, 0)
    assert seen("P1 up splint", "groove P6") == ["clear"]
    go_to(page, 2)
    assert seen("P1 up splint", "groove P6") == ["contact"]
    assert seen("P2 down splint", "groove P6") == ["clear"]
    go_to(page, 7)
    assert seen("P2 down splint", "groove P7") == ["contact"]


def test_cutaway_and_labels_switch(page, run):
    go_to(page, len(run.path) - 1)
    with_labels = pixels(page)
    page.click("#switch-labels")
    without = pixels(page)
    assert (np.abs(with_labels - without).sum(2) > 30).sum() > 1000
    page.click("#switch-cutaway")
    assert visible(page, "whole")
    assert not visible(page, "cutaway")
    whole = cut_colours(page, run.poses)
    assert any(
        np.abs(whole[name] - [int(PART_COLOURS[name][i : i + 2], 16) for i in (1, 3, 5)]).max() > 8 for name in whole
    )
    page.click("#switch-cutaway")
    page.click("#switch-labels")
    assert_drawn(page, run.poses)


def test_page_plays_by_itself_and_states_its_mesh_error(page, run):
    go_to(page, 0)
    page.click("#play")
    wait_for(page, "viewer.animator.time > 0.5")
    page.click("#play")
    assert not page.evaluate("viewer.animator.playing")
    assert "within 0.01 mm" in page.inner_text("#accuracy")
    assert f"{run.distance:.3f} mm" in page.inner_text("#facts")
    assert len(page.query_selector_all("#rows tr")) == len(run.contacts)


def test_live_page_follows_the_run(browser, run):
    with Viewer(run.clamp, Cas(), mesh_error=0.1) as viewer:
        page = open_page(browser, viewer.url)
        wait_for(page, "viewer.scene_tree.children.clamp3d && viewer.scene_tree.children.clamp3d.children.labels")
        wait_for(page, "Object.keys(viewer.scene_tree.find(['clamp3d', 'whole']).children).length === 7")
        for waypoint in run.path:
            viewer.show(waypoint)
            wait_for(page, f'document.getElementById("status").textContent.includes("{waypoint.label}")')
            T = pose_in_browser(page, ["whole", "P2 down splint"])
            np.testing.assert_allclose(T, waypoint.poses["P2"].T(), atol=2e-4)
        assert not page.is_visible("#timeline")
        viewer.finish(run)
        wait_for(page, "viewer.animator.playing")
        go_to(page, len(run.path) - 1)
        assert_drawn(page, run.poses)

        late = open_page(browser, viewer.url)
        wait_for(late, "viewer.animator.duration > 0")
        go_to(late, len(run.path) - 1)
        assert_drawn(late, run.poses)
        assert late.problems == []
        late.context.close()
        start = time.monotonic()
    assert time.monotonic() - start < 5.0  # open pages do not hold us up
    wait_for(page, 'document.getElementById("status").textContent.includes("has ended")')
    assert page.problems == []
    page.context.close()


def test_overlay_of_wedges_moves_with_its_part(browser, run, tmp_path):
    title, pieces = overlay(run.clamp, "wedges=20")
    with Viewer(run.clamp, Cas(), mesh_error=0.1, serve=False, overlays={title: pieces}) as viewer:
        for waypoint in run.path:
            viewer.show(waypoint)
        viewer.finish(run)
        viewer.write(tmp_path / "overlay.html")
    page = open_page(browser, (tmp_path / "overlay.html").as_uri(), offline=True)
    wait_for(page, "viewer.animator.duration > 0")
    go_to(page, len(run.path) - 1)
    assert not visible(page, f"overlay {title}")
    before = pixels(page)
    page.click("#switch-overlay-wedges-of-20-deg")
    assert visible(page, f"overlay {title}")
    assert (np.abs(pixels(page) - before).sum(2) > 30).sum() > 2000
    T = pose_in_browser(page, [f"overlay {title}", "P2"])
    np.testing.assert_allclose(T, run.poses["P2"].T(), atol=2e-4)
    assert page.problems == []
    page.context.close()


def test_report_shows_its_pictures_and_links(browser, run, tmp_path):
    write_report(report(run, Cas()), tmp_path)
    page = open_page(browser, (tmp_path / "report.html").as_uri(), offline=True)
    widths = page.evaluate("Promise.all([...document.images].map((i) => i.decode().then(() => i.naturalWidth)))")
    assert len(widths) == 11
    assert min(widths) > 100
    page.click(".matrix a[href='#P2-P7']")
    assert page.evaluate("document.querySelector('tr:target').id") == "P2-P7"
    assert page.evaluate("document.documentElement.scrollWidth <= window.innerWidth + 1")
    assert page.problems == []
    page.context.close()


def test_meshcat_server_that_was_there_before(browser, run):
    from meshcat.servers.zmqserver import start_zmq_server_as_subprocess

    server, zmq_url, web_url = start_zmq_server_as_subprocess()
    try:
        with Viewer(run.clamp, Cas(), mesh_error=0.1, url=zmq_url) as viewer:
            assert viewer.url == web_url
            for waypoint in run.path:
                viewer.show(waypoint)
            viewer.finish(run)
        page = open_page(browser, web_url)  # meshcat's own page, after we have left
        wait_for(page, "viewer.animator.duration > 0")
        page.evaluate("viewer.animator.pause(); viewer.animator.seek(0)")
        np.testing.assert_allclose(
            pose_in_browser(page, ["cutaway", "P1 up splint"]), run.path[0].poses["P1"].T(), atol=2e-4
        )
        page.evaluate("viewer.animator.seek(viewer.animator.duration)")
        page.wait_for_timeout(300)
        assert_drawn(page, run.poses)
        assert visible(page, "caption")  # the mesh error, in the picture itself
        page.context.close()
    finally:
        server.kill()
        server.communicate()
