"""The viewer in a real browser: the live page, the page as a file, and a meshcat server that was there before.

The scene is looked at in two ways: the poses in the browser's scene tree against the run's, and the pixels at points of
the cut faces, found with the browser's own camera, against the part's colour.
"""

import io
import math
import os
import re
import shutil
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from clamp3d.clamp.assemble import assemble
from clamp3d.engine.check import check
from clamp3d.engine.scene import Scene
from clamp3d.fit.fit import fit_mesh
from clamp3d.geometry import shapes
from clamp3d.geometry.mesh import make_mesh
from clamp3d.geometry.meshing import mesh
from clamp3d.geometry.motion import Motion
from clamp3d.geometry.pose import translation
from clamp3d.output.fit_report import fit_to_html
from clamp3d.output.groups import grouped
from clamp3d.output.palette import PART_COLOURS
from clamp3d.output.viewer import Viewer, check_to_html, view

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
EXAMPLES = Path(__file__).resolve().parents[2] / "examples"
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
    return assemble("reference")


@pytest.fixture(scope="module")
def page(browser, run, tmp_path_factory):
    """The page as a file, opened without a network."""
    path = tmp_path_factory.mktemp("page") / "run.html"
    with view(run, serve=False) as viewer:
        viewer.save_html(path)
    page = open_page(browser, path.as_uri(), offline=True)
    wait_for(page, "viewer.animator.duration > 0 && viewer.scene.getObjectByName('clamp3d') !== undefined")
    yield page
    assert page.problems == []


@pytest.fixture(scope="module")
def hinge(tmp_path_factory):
    """The page of ``check`` for the hinge with its pin out of place: a clash at rest, and one in a motion."""
    from clamp3d.scenefile.load import load

    scene = load(str(EXAMPLES / "hinge" / "scene.toml")).moved({"pin": translation(0.4, 0.0, 0.0)})
    result = check(scene)
    path = tmp_path_factory.mktemp("hinge") / "check.html"
    path.write_text(check_to_html(result), encoding="utf-8")
    return path, result


@pytest.fixture(scope="module")
def hinge_page(browser, hinge):
    page = open_page(browser, hinge[0].as_uri(), offline=True)
    wait_for(page, "viewer.animator.duration > 0")
    yield page
    assert page.problems == []


def open_page(browser, url, *, offline=False, **options):
    options = {"viewport": {"width": 1200, "height": 700}, "reduced_motion": "reduce"} | options
    context = browser.new_context(offline=offline, **options)
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


def assert_drawn(page, poses, seek=""):
    wanted = {name: [int(PART_COLOURS[name][i : i + 2], 16) for i in (1, 3, 5)] for name in CUT}
    for _ in range(30):  # a busy machine draws the frame later, or hands parts to the page after the first look
        if seek:
            page.evaluate(seek)
        seen = cut_colours(page, poses)
        if all(np.allclose(seen[name], wanted[name], rtol=0.0, atol=3) for name in CUT):
            break
        page.wait_for_timeout(100)
    for name, colour in wanted.items():
        np.testing.assert_allclose(seen[name], colour, atol=3, err_msg=name)


def go_to(page, number):
    wait_for(page, f"document.getElementById('marks').children.length > {number}")  # a live page asks for them
    page.evaluate("n => document.getElementById('marks').children[n].click()", number)
    page.wait_for_timeout(100)


def test_page_steps_through_the_sequence(page, run):
    go_to(page, 0)
    for number, waypoint in enumerate(run.path):
        assert waypoint.label in page.inner_text("#label")
        assert waypoint.step in page.inner_text("#step") or waypoint.label.startswith(waypoint.step)
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


def test_row_of_a_pair_flies_to_it_and_fades_the_others(page, run):
    go_to(page, len(run.path) - 1)
    before = page.evaluate("viewer.camera.position.toArray()")
    page.click(".stop:not([hidden]) tr[data-a=P1][data-b=P2]")
    page.wait_for_timeout(100)
    assert np.linalg.norm(np.subtract(page.evaluate("viewer.camera.position.toArray()"), before)) > 0.5
    assert opacity(page, "P6 power line") < 0.2
    assert opacity(page, "P1 up splint") == 1.0
    page.click("#home")
    page.wait_for_timeout(100)
    assert opacity(page, "P6 power line") == 1.0
    assert_drawn(page, run.poses)


def opacity(page, part, tree="cutaway"):
    return page.evaluate(
        "path => viewer.scene_tree.find(path).object.material.opacity", ["clamp3d", tree, part, "solid", "<object>"]
    )


def test_findings_of_a_check_lead_to_their_places(hinge_page, hinge):
    page, (_, result) = hinge_page, hinge
    assert page.title().startswith(result.scene.name)
    assert re.match(r"\d+ clash", page.inner_text("#headline"))
    rows = [row for group in grouped(result) for row in group.rows]
    findings = page.query_selector_all(".finding")
    assert len(findings) == len(rows)
    for k, row in enumerate(rows):
        findings[k].click()
        page.wait_for_timeout(100)
        label = page.inner_text("#label")
        assert ("first contact" in label) == (row.contact_at is not None and row.contact_at > 0.0)
        assert (row.motion or "at rest") in label
        (a, b), others = (row.a, row.b), {"leaf-a", "leaf-b", "pin"} - {row.a, row.b}
        assert opacity(page, a, "whole") == opacity(page, b, "whole") == 1.0
        assert all(opacity(page, name, "whole") < 0.2 for name in others)
        point = row.distance.point_a
        if row.motion is None and point is not None:
            ((x, y),) = on_screen(page, [point])
            assert 400 < x < 1200
            assert 0 < y < 620
    at_rest = next(k for k, row in enumerate(rows) if row.motion is None)
    findings[at_rest].click()
    page.wait_for_timeout(100)
    image = pixels(page)
    red = (image[..., 0] > 150) & (image[..., 1] < 110) & (image[..., 2] < 110)
    assert red[:, 370:].sum() > 200


def test_play_halts_at_first_contact_and_goes_on_when_asked(hinge_page):
    page = hinge_page
    stops = page.evaluate("viewer.scene_tree.find(['clamp3d']).object.story.stops")
    contact = next(k for k, stop in enumerate(stops) if stop["halts"])
    page.evaluate(f"viewer.animator.seek({stops[contact]['arrive'] - 0.4})")
    page.evaluate("viewer.animator.play()")
    wait_for(page, "!viewer.animator.playing")
    assert page.evaluate("viewer.animator.time") == pytest.approx(stops[contact]["arrive"], abs=0.02)
    assert "first contact at t = " in page.inner_text("#label")
    page.click("#play")
    wait_for(page, f"viewer.animator.time > {stops[contact]['arrive'] + 0.3}")
    page.evaluate("viewer.animator.pause()")


PHONE = {"viewport": {"width": 390, "height": 844}, "is_mobile": True, "has_touch": True, "device_scale_factor": 2}


def test_page_on_a_phone(browser, hinge):
    page = open_page(browser, hinge[0].as_uri(), offline=True, **PHONE)
    wait_for(page, "viewer.animator.duration > 0")
    assert page.evaluate("document.documentElement.scrollWidth <= innerWidth")
    pane = page.query_selector("#meshcat-pane").bounding_box()
    assert pane["width"] == 390
    assert pane["height"] > 250
    assert page.is_visible("#headline")
    for element in page.query_selector_all(".finding, #play, #back, #forward"):
        box = element.bounding_box()
        assert min(box["width"], box["height"]) >= 36  # big enough for a finger
    page.tap(".finding")
    page.wait_for_timeout(200)
    assert page.query_selector(".finding.now")
    assert page.problems == []
    page.context.close()


def test_page_in_dark_mode_is_dark_and_readable(hinge_page):
    page = hinge_page
    page.keyboard.press("h")
    page.emulate_media(color_scheme="dark")
    page.wait_for_timeout(300)
    image = pixels(page)
    assert image[5, -5].max() < 70  # behind the parts
    assert image[-5, 5].max() < 70  # the panel
    for selector in ("h1", "#headline", ".finding b", ".small", "td", "h2"):
        assert contrast(page, selector) > 4.5, selector  # WCAG 2.2, level AA
    page.emulate_media(color_scheme="light")


@pytest.mark.parametrize(("scheme", "dark"), [("dark", True), ("light", False)])
def test_page_of_a_fit_follows_the_scheme(browser, tmp_path, scheme, dark):
    path = tmp_path / "fit.html"
    tube = mesh(shapes.cylinder(5.0, 20.0))
    path.write_text(fit_to_html(fit_mesh(make_mesh(tube.vertices, tube.faces))), encoding="utf-8")
    page = open_page(browser, path.as_uri(), offline=True, color_scheme=scheme)
    page.wait_for_timeout(300)
    image = np.asarray(Image.open(io.BytesIO(page.screenshot())).convert("RGB")).astype(int)
    corner = page.locator("#view").bounding_box()
    for x, y in ((5, 5), (int(corner["x"]) + 5, int(corner["y"]) + 5)):  # the page, and behind the part
        assert (image[y, x].max() < 70) == dark
        assert (image[y, x].min() > 200) == (not dark)
    for selector in ("h1", "p", "td", "th", "dd", ".pm"):
        assert contrast(page, selector) > 4.5, selector
    assert page.problems == []
    page.context.close()


def contrast(page, selector):
    colours = page.evaluate(
        """selector => {
            let e = document.querySelector(selector);
            const text = getComputedStyle(e).color;
            while (e.parentElement && getComputedStyle(e).backgroundColor === "rgba(0, 0, 0, 0)") e = e.parentElement;
            return [text, getComputedStyle(e).backgroundColor].map((c) => c.match(/[\\d.]+/g).slice(0, 3).map(Number));
        }""",
        selector,
    )
    light = []
    for colour in colours:
        c = np.array(colour) / 255.0
        linear = np.where(c <= 0.04045, c / 12.92, ((c + 0.055) / 1.055) ** 2.4)
        light.append(float(linear @ [0.2126, 0.7152, 0.0722]))
    return (max(light) + 0.05) / (min(light) + 0.05)


@pytest.mark.parametrize("javascript", [True, False])
def test_findings_can_be_read_without_webgl_or_script(hinge, javascript):
    path, result = hinge
    import subprocess
    import sys

    # A browser of its own: its WebGL is switched off for good, and playwright's loop runs in this process already.
    code = f"""
from playwright.sync_api import sync_playwright
with sync_playwright() as playwright:
    arguments = ["--no-sandbox", "--disable-gpu", "--disable-3d-apis"]
    browser = playwright.chromium.launch(executable_path={chromium()!r}, args=arguments)
    page = browser.new_context(offline=True, java_script_enabled={javascript}).new_page()
    page.on("pageerror", lambda error: print("error:", error))
    page.goto({path.as_uri()!r})
    page.wait_for_timeout(500)
    print(page.inner_text("body"))
    print("stage:", page.is_visible("#stage"))
"""
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert "error:" not in done.stdout
    assert "stage: False" in done.stdout
    assert ("cannot draw 3D" in done.stdout) == javascript
    assert ("Scripts are off" in done.stdout) != javascript
    for group in grouped(result):
        assert f"{group.a} and {group.b}" in done.stdout


def test_served_page_follows_the_run_until_it_is_done(browser, run):
    with Viewer(run.clamp, mesh_error=0.1) as viewer:
        viewer.show(run.path[0])
        page = open_page(browser, viewer.url)
        wait_for(page, f'document.getElementById("headline").textContent.includes("{run.path[0].label}")')
        assert not page.is_visible("#timeline")
        page.emulate_media(reduced_motion="no-preference")
        viewer.finish(run)
        wait_for(page, 'document.getElementById("headline").textContent === "clamped"')  # it loads itself again
        wait_for(page, "viewer.animator.playing")
        go_to(page, len(run.path) - 1)
        assert_drawn(page, run.poses)
    page.wait_for_timeout(1500)
    assert page.is_visible("#timeline")  # the page stays when nothing is served any more
    assert page.problems == []
    page.context.close()


def test_report_shows_its_pictures_and_links(browser, odd_page, tmp_path):
    (tmp_path / "report.html").write_text(odd_page, encoding="utf-8")
    page = open_page(browser, (tmp_path / "report.html").as_uri(), offline=True)
    widths = page.evaluate("Promise.all([...document.images].map((i) => i.decode().then(() => i.naturalWidth)))")
    assert len(widths) >= 5
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
        with Viewer(run.clamp, mesh_error=0.1, url=zmq_url) as viewer:
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
        assert_drawn(page, run.poses, seek="viewer.animator.seek(viewer.animator.duration)")
        assert visible(page, "caption")  # the mesh error, in the picture itself
        page.context.close()
    finally:
        server.kill()
        server.communicate()


@pytest.fixture
def boxes_page(browser, tmp_path):
    scene = Scene().add("left", shapes.box((10, 10, 10))).add("right", shapes.box((10, 10, 10)), translation(30, 0, 0))
    view(scene, serve=False).save_html(tmp_path / "two.html")
    page = open_page(browser, (tmp_path / "two.html").as_uri(), offline=True)
    wait_for(page, "document.querySelector('.part')")
    page.locator("#switch-cutaway").uncheck()
    page.wait_for_timeout(200)
    yield page
    assert page.problems == []


def test_a_section_hides_what_is_before_it(boxes_page):
    page = boxes_page
    middles = on_screen(page, [(0.0, -5.0, 0.0), (30.0, -5.0, 0.0)])

    def named():
        found = []
        for x, y in middles:
            page.mouse.click(x, y)
            found.append(page.evaluate("document.getElementById('identity').hidden") or page.inner_text("#identity b"))
        return found

    assert named() == ["left", "right"]
    page.select_option("#section-axis", "X")
    assert page.inner_text("#section-place") == "X 15.00 mm"
    assert named() == ["left", True]
    image = pixels(page)
    x, y = middles[1]
    assert image[round(y), round(x)].min() > 200  # the ground, no part
    page.click("#section-flip")
    assert named() == [True, "right"]
    page.locator("#section-at").fill("1")
    assert page.inner_text("#section-place") == "X 35.00 mm"
    assert named() == [True, True]
    page.select_option("#section-axis", "")
    assert named() == ["left", "right"]


def test_two_clicks_measure(boxes_page):
    page = boxes_page
    page.keyboard.press("m")
    for point in on_screen(page, [(0.0, -5.0, 0.0), (30.0, -5.0, 2.0)]):
        page.mouse.click(*point)
    words = page.inner_text("#measured")
    found = re.fullmatch(
        r"left to right: ([\d.]+) mm between the points, within 0.02 mm \(X ([\d.]+), Y 0.00, Z ([\d.]+)\); "
        r"the parts: gap 20.0000 mm",
        words,
    )
    assert found, words
    pixel = 0.2
    np.testing.assert_allclose([float(x) for x in found.groups()], [math.hypot(30.0, 2.0), 30.0, 2.0], atol=pixel)
    page.keyboard.press("Escape")
    assert not page.is_visible("#measured")


def test_a_part_can_be_named_isolated_ghosted_and_hidden(boxes_page):
    page = boxes_page
    ((x, y),) = on_screen(page, [(30.0, -5.0, 0.0)])
    page.mouse.click(x, y)
    assert page.inner_text("#identity b") == "right"
    page.click("#identity [data-do=isolate]")
    assert (opacity(page, "left", "whole") < 0.2, opacity(page, "right", "whole")) == (True, 1.0)
    page.click("#identity [data-do=ghost]")
    assert opacity(page, "right", "whole") < 0.2
    page.keyboard.press("Escape")
    assert opacity(page, "left", "whole") == opacity(page, "right", "whole") == 1.0
    page.click(".part[data-part=left]")
    page.click("#identity [data-do=hide]")
    assert not page.evaluate(
        "viewer.scene_tree.find(['clamp3d', 'whole', 'left', 'solid', '<object>']).object.material.visible"
    )


def test_the_address_can_name_a_finding(browser, hinge):
    path, result = hinge
    group = grouped(result)[-1]
    page = open_page(browser, f"{path.as_uri()}#finding={group.id}", offline=True)
    wait_for(page, "document.querySelector('.finding.now')")
    assert page.evaluate("document.querySelector('.finding.now').dataset.id") == group.id
    assert page.problems == []


def test_the_list_of_findings_holds_those_of_the_part_that_is_picked(browser, tmp_path):
    scene = Scene()
    for k, x in enumerate((0.0, 9.0, 50.0, 58.0)):
        scene = scene.add("abcd"[k], shapes.box((10, 10, 10)), translation(x, 0, 0))
    page = open_scene(browser, check(scene), tmp_path)
    rows = "[...document.querySelectorAll('#findings > li')].filter((e) => !e.hidden).map((e) => e.innerText)"
    assert len(page.evaluate(rows)) == 2
    page.click(".part[data-part=c]")
    assert page.inner_text("#filtered").strip() == "- 1 with c, of 2"
    (row,) = page.evaluate(rows)
    assert re.search("c.*d", row)
    page.keyboard.press("Escape")
    assert len(page.evaluate(rows)) == 2
    assert page.inner_text("#filtered") == ""
    assert page.problems == []


def test_labels_never_cover_each_other(browser, tmp_path):
    """Rays through a grid of pixels, by three.js: none meets two labels that are drawn; some labels always are."""
    scene = Scene()
    for k in range(12):
        scene = scene.add(f"washer_number_{k}", shapes.box((3, 3, 0.05)), translation(0.4 * k, 0, 0.1 * k))
    page = open_scene(browser, check(scene), tmp_path)
    page.locator("#switch-labels").check()
    for path in ("viewer.camera.zoom = 1", "viewer.camera.zoom = 3"):
        seen = page.evaluate(
            path
            + """; (() => {
                viewer.camera.updateProjectionMatrix();
                viewer.render();
                const T = MeshCat.THREE, ray = new T.Raycaster(), labels = [], drawn = new Set();
                viewer.scene.traverseVisible((o) => { if (o.isSprite && o.material.visible) labels.push(o); });
                let most = 0;
                for (let x = -1; x < 1; x += 0.01) for (let y = -1; y < 1; y += 0.01) {
                    ray.setFromCamera(new T.Vector2(x, y), viewer.camera);
                    const hits = ray.intersectObjects(labels, false);
                    for (const hit of hits) drawn.add(hit.object.uuid);
                    most = Math.max(most, hits.length);
                }
                return [most, drawn.size];
            })()"""
        )
        assert seen[0] == 1
        assert seen[1] >= 4
    assert page.problems == []


@pytest.fixture(scope="module")
def sliding():
    """A box that slides 25 mm along X, from a gap of 20 mm to an overlap of 5 mm."""
    cube = shapes.box((10, 10, 10))
    scene = Scene().add("still", cube).add("slider", cube, translation(30, 0, 0))
    return check(scene.with_motion(Motion.translate((-25.0, 0.0, 0.0), parts="slider", name="push")))


def test_the_curve_of_a_finding_holds_its_distance(sliding):
    """At every moment the bounds hold the distance calculated by hand, on the time line in the right place."""
    with view(sliding, serve=False) as viewer:
        (curve,), stops = viewer.story["curves"], viewer.story["stops"]
    assert {curve["a"], curve["b"]} == {"still", "slider"}
    t, bounds = np.array(curve["t"]), np.array(curve["bounds"], dtype=float)
    assert (t[0], t[-1]) == (0.0, 1.0)
    assert 20 <= len(t) <= 30
    np.testing.assert_allclose(bounds, np.column_stack([20.0 - 25.0 * t] * 2), atol=1e-6)
    seconds = {stop["label"]: (stop["arrive"], stop["leave"]) for stop in stops}
    (rest, first, end) = seconds.values()
    drawn = np.array(curve["seconds"])
    np.testing.assert_allclose(drawn[[0, -1]], [rest[1], end[0]])
    (meeting,) = t[np.isclose(drawn, first[0])]
    assert 0.8 - 0.01 / 25.0 - 1e-6 <= meeting <= 0.8  # contact is a gap of 0.01 mm
    late = t > meeting
    np.testing.assert_allclose(drawn[late], first[1] + (t[late] - meeting) / (1.0 - meeting) * (end[0] - first[1]))


def test_a_picked_finding_of_a_motion_shows_its_curve(browser, sliding, tmp_path):
    page = open_scene(browser, sliding, tmp_path)
    assert not page.is_visible("#curve")
    page.click(".finding")
    page.evaluate("document.getElementById('marks').children[0].click()")
    wait_for(page, "document.querySelector('#curve figcaption').textContent.includes('t = 0.000')")
    assert re.search(r"(19.9999|20.0000) to 20.000[01] mm$", page.inner_text("#curve figcaption"))
    page.evaluate("document.getElementById('marks').lastChild.click()")
    wait_for(page, "document.querySelector('#curve figcaption').textContent.includes('t = 1.000')")
    assert re.search(r"-5.000[01] to -(5.0000|4.9999) mm$", page.inner_text("#curve figcaption"))
    heights = page.evaluate(
        "[...document.querySelectorAll('#curve polygon')[0].points].map((p) => p.y)"
        ".concat(document.querySelector('#curve line').y1.baseVal.value)"
    )
    # 25 mm from the highest to the lowest point, 5 of them under the line at 0
    assert (max(heights) - heights[-1]) / (max(heights) - min(heights)) == pytest.approx(0.2, abs=1e-3)
    page.keyboard.press("Escape")
    assert not page.is_visible("#curve")
    assert page.problems == []


def test_a_served_page_lists_findings_before_their_depths(browser, sliding):
    scene = sliding.scene.add("deep", shapes.box((4, 4, 4)), translation(0, 0, 6))
    with Viewer(scene, serve=True) as viewer:
        viewer.preview(check(replace(scene, motions=()), depths=False))
        page = open_page(browser, viewer.url)
        wait_for(page, "document.querySelectorAll('.finding').length === 1")
        assert "depths and motions follow" in page.inner_text("#headline")
        assert "still and deep clash: overlap at least 0.9999 mm" in page.inner_text(".finding")
        viewer.finish(check(scene))
        wait_for(page, "document.querySelectorAll('#findings > li').length === 3")
        assert "still and deep clash: overlap 1.000000 mm" in page.inner_text("#findings")
        assert "follow" not in page.inner_text("#headline")
        assert page.problems == []


def open_scene(browser, result, folder):
    (folder / "check.html").write_text(check_to_html(result), encoding="utf-8")
    page = open_page(browser, (folder / "check.html").as_uri(), offline=True)
    wait_for(page, "document.querySelector('.part')")
    page.wait_for_timeout(200)
    return page
