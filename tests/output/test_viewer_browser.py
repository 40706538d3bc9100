"""The viewer in a real browser: the served page, the page as a file, and a meshcat server that was there before.

The scene is looked at in two ways: the poses in the browser's scene tree against the run's, and the pixels at points of
the cut faces, found with the browser's own camera, against the part's colour.
"""

import io
import itertools
import json
import math
import os
import re
import shutil
from dataclasses import replace

import numpy as np
import pytest
import skimage.color

import clamp3d.output.viewer
from clamp3d import Motion, Scene, check, fit_mesh, measure, shapes, view
from clamp3d.geometry.pose import nearest_rigid, translation
from clamp3d.output.fit_report import fit_to_html
from clamp3d.output.groups import grouped
from clamp3d.output.palette import PART_COLOURS
from clamp3d.output.serving import PageServer
from clamp3d.output.viewer import Viewer, check_to_html
from clamp3d.output.viewer_story import ClampStory
from tests.kinds import faceted_shape

playwright_api = pytest.importorskip(
    "playwright.sync_api", reason="browser tests need playwright: pip install 'clamp3d[dev]'"
)
Image = pytest.importorskip("PIL.Image")

SOFTWARE = ["--use-gl=angle", "--use-angle=swiftshader", "--enable-unsafe-swiftshader", "--ignore-gpu-blocklist"]
ARGUMENTS = ["--no-sandbox", "--disable-gpu-compositing", *SOFTWARE]
COARSE = {"device_scale_factor": 0.5}
"""The page is laid out as before, on a quarter of the pixels: the processor draws every one of them."""
CUT = {"P1": (110.0, 8.0), "P2": (-36.0, 30.0), "P3": (-16.5, 57.0), "P6": (-9.0, 0.0), "P7": (-4.5, 0.0)}
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
def opened(browser):
    """Opens pages; no error may come up in any of them."""
    pages = []

    def open_page(url, **options):
        options = {"viewport": {"width": 900, "height": 560}, "reduced_motion": "reduce"} | COARSE | options
        page = browser.new_context(**options).new_page()
        page.problems = []
        page.on("pageerror", lambda error: page.problems.append(str(error)))
        page.on("console", lambda message: page.problems.append(message.text) if message.type == "error" else None)
        page.goto(url)
        pages.append(page)
        return page

    yield open_page
    for page in pages:
        assert page.problems == []
        page.context.close()


@pytest.fixture(scope="module")
def saved(opened, tmp_path_factory):
    """Opens what is shown as a saved page, without a network."""
    files = {}

    def save(shown, fragment="", **options):
        if id(shown) not in files:
            path = tmp_path_factory.mktemp("page") / "page.html"
            view(shown, serve=False, mesh_error=0.1).save_html(path)
            files[id(shown)] = path, shown
        page = opened(files[id(shown)][0].as_uri() + fragment, offline=True, **options)
        wait_for(page, "document.querySelector('.part')")
        settle(page)
        return page

    return save


@pytest.fixture(scope="module")
def hinge():
    """A pin 1 mm in leaf-a; leaf-b goes through the pin's top and back, over leaf-a: a clash as it sets out again."""
    scene = Scene(name="hinge", clearance=2.5).add("leaf-a", shapes.box((20, 20, 20)))
    scene = scene.add("leaf-b", shapes.box((6, 6, 6)), translation(24, 0, 15))
    scene = scene.add("pin", shapes.cylinder(3, 30), translation(12, 0, 0))
    ways = (Motion.translate((way, 0, 0), parts="leaf-b", name=name) for name, way in (("fold", -18.3), ("back", 18.3)))
    return check(replace(scene, motions=tuple(ways)))


@pytest.fixture(scope="module")
def hinge_page(saved, hinge):
    return saved(hinge, viewport={"width": 1200, "height": 700})


@pytest.fixture(scope="module")
def turned(hinge_page, hinge):
    """The last finding, picked on that page by its address, seen from elsewhere: identifier, camera, address."""
    group, page = grouped(hinge)[-1], hinge_page
    page.evaluate("id => { location.hash = 'finding=' + id; }", group.id)
    wait_for(page, f"document.querySelector('.finding.now')?.dataset.id === '{group.id}'")
    settle(page)
    page.mouse.move(800, 300)
    page.mouse.down()
    page.mouse.move(900, 340)
    page.mouse.up()
    settle(page)
    return group.id, camera(page), page.evaluate("location.hash")


@pytest.fixture(scope="module")
def dark_phone(saved, hinge, turned):
    """A phone that has opened this address, and what it showed first."""
    size = {"viewport": {"width": 390, "height": 844}, "is_mobile": True, "has_touch": True}
    page = saved(hinge, turned[2], color_scheme="dark", **size)
    page.first = page.get_attribute(".finding.now", "data-id"), camera(page)
    return page


@pytest.fixture(scope="module")
def sliding():
    """A box that slides 25 mm along X, from a gap of 20 mm to an overlap of 5 mm."""
    cube = shapes.box((10, 10, 10))
    scene = Scene().add("still", cube).add("slider", cube, translation(30, 0, 0))
    return check(scene.with_motion(Motion.translate((-25.0, 0.0, 0.0), parts="slider", name="push")), distances=True)


@pytest.fixture(scope="module")
def sliding_tab(saved, sliding):
    return saved(sliding)


@pytest.fixture
def sliding_page(sliding_tab):
    """Its page at rest, with nothing picked and nothing cut."""
    page = sliding_tab
    page.keyboard.press("Escape")
    page.select_option("#section-axis", "")
    go_to(page, 0)
    return page


def wait_for(page, condition):
    page.wait_for_function(f"() => {condition}", timeout=30_000)


def settle(page):
    """Lets the page do what it puts off by up to 50 ms, then draw: only a drawn picture has turned its camera."""
    page.evaluate("new Promise((d) => setTimeout(() => requestAnimationFrame(() => requestAnimationFrame(d)), 60))")


def poses_in_browser(page, names):
    """Pose (4, 4) in mm of each part, from the browser's world matrices."""
    values = page.evaluate(
        """names => {
            const root = viewer.scene_tree.find(["clamp3d"]).object;
            root.updateMatrixWorld(true);
            const inverse = root.matrixWorld.clone().invert();
            const matrix = (name) => viewer.scene_tree.find(["clamp3d", "parts", name]).object.matrixWorld;
            return names.map((name) => inverse.clone().multiply(matrix(name)).elements);
        }""",
        list(names),
    )
    return {name: np.reshape(matrix, (4, 4)).T for name, matrix in zip(names, values, strict=True)}


def visible(page, *path):
    return page.evaluate("path => viewer.scene_tree.find(['clamp3d', ...path]).object.visible", list(path))


def pixels(page):
    page.evaluate("window.viewer?.render()")
    return np.asarray(Image.open(io.BytesIO(page.screenshot(scale="css"))).convert("RGB")).astype(int)


def on_screen(page, points):
    """Pixel (column, row) of each world point (n, 3) mm."""
    settle(page)
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


def assert_drawn(page, poses):
    """The points of CUT are seen in the colours of their parts."""
    points = [(x, 0.0, -y) for x, y in (poses[name].point(*uv) for name, uv in CUT.items())]
    wanted = np.array([[int(PART_COLOURS[name][i : i + 2], 16) for i in (1, 3, 5)] for name in CUT])
    for _ in range(30):  # a busy machine draws the frame later, or hands parts to the page after the first look
        image = pixels(page)
        off = np.abs([image[round(y), round(x)] for x, y in on_screen(page, points)] - wanted)
        if off.max() <= 3:
            return
        page.wait_for_timeout(100)
    pytest.fail(f"colours of {list(CUT)} are off by {off.tolist()}")


def go_to(page, number):
    wait_for(page, f"document.getElementById('marks').children.length > {number}")
    page.evaluate("n => document.getElementById('marks').children[n].click()", number)
    settle(page)


def seek(page, seconds):
    page.evaluate("viewer.animator.pause()")
    page.locator("#time").fill(f"{seconds:.3f}")
    page.evaluate("document.activeElement.blur()")


def opacity(page, part):
    return page.evaluate(
        "path => viewer.scene_tree.find(path).object.material.opacity", ["clamp3d", "parts", part, "solid", "<object>"]
    )


def camera(page):
    return np.array(page.evaluate("viewer.camera.position.toArray()"))


def test_findings_of_a_check_lead_to_their_places(hinge_page, hinge):
    page = hinge_page
    assert page.title().startswith(hinge.scene.name)
    assert re.match(r"\d+ clash", page.inner_text("#headline"))
    rows = [row for group in grouped(hinge) for row in group.rows]
    assert len(page.query_selector_all(".finding")) == len(rows)
    assert page.get_attribute(".finding", "aria-current") == "true"  # the worst is shown at once
    page.keyboard.press("Escape")
    for row in rows:
        page.keyboard.press("n")
        settle(page)
        label = page.inner_text("#label")
        assert ("first contact" in label) == (row.contact_at is not None and row.contact_at > 0.0)
        assert (row.motion or "at rest") in label
        (a, b), others = (row.a, row.b), {"leaf-a", "leaf-b", "pin"} - {row.a, row.b}
        seen_into = row.verdict.value in ("clash", "contained", "duplicate")
        assert all((opacity(page, name) < 0.6) == seen_into and opacity(page, name) > 0.4 for name in (a, b))
        assert all(opacity(page, name) < 0.2 for name in others)
        if row.motion is None:
            ((x, y),) = on_screen(page, [row.distance.point_a])
            assert (400 < x < 1200, 0 < y < 620) == (True, True)
            image = pixels(page)
            red = (image[..., 0] > 150) & (image[..., 1] < 110) & (image[..., 2] < 110)
            assert red[:, 370:].sum() > 100


def test_play_halts_at_first_contact_and_goes_on_when_asked(hinge_page):
    page = hinge_page
    place = page.get_attribute("#marks .halts", "style")
    contact = float(re.search(r"([\d.]+)%", place)[1]) / 100.0 * float(page.get_attribute("#time", "max"))
    seek(page, contact - 0.4)
    page.click("#play")
    wait_for(page, f"!viewer.animator.playing && viewer.animator.time > {contact}")
    assert page.evaluate("viewer.animator.time") == pytest.approx(contact, abs=0.02)
    assert "first contact at t = " in page.inner_text("#label")
    page.keyboard.press(" ")
    wait_for(page, f"viewer.animator.time > {contact + 0.3}")
    page.keyboard.press(" ")
    assert not page.evaluate("viewer.animator.playing")


def test_page_on_a_phone(dark_phone):
    page = dark_phone
    assert page.evaluate("document.documentElement.scrollWidth <= innerWidth")
    pane = page.query_selector("#meshcat-pane").bounding_box()
    assert pane["width"] == 390
    assert pane["height"] > 250
    assert page.is_visible("#headline")
    for element in page.query_selector_all(".finding, #search, #play, #back, #forward"):
        box = element.bounding_box()
        assert min(box["width"], box["height"]) >= 36  # big enough for a finger
    page.tap(".finding")
    settle(page)
    assert page.query_selector(".finding.now")


def test_page_in_dark_mode_is_dark_and_readable(dark_phone):
    page = dark_phone
    page.keyboard.press("h")
    settle(page)
    image = pixels(page)
    assert image[5, -5].max() < 70  # behind the parts
    assert image[-5, 5].max() < 70  # the panel
    for selector in ("h1", "#headline", ".finding b", ".small", "td", "h2", "#search", "button.pair"):
        assert contrast(page, selector) > 4.5, selector  # WCAG 2.2, level AA


def test_a_screen_reader_can_name_everything(hinge_page):
    page = hinge_page
    tree = page.locator("body").aria_snapshot()
    controls = re.findall(r"- (button|checkbox|slider|searchbox|combobox|img)( \"[^\"]+\")?", tree)
    assert {role for role, _ in controls} == {"button", "checkbox", "slider", "searchbox", "combobox", "img"}
    assert [role for role, name in controls if not name] == []
    assert "3D view of hinge" in tree
    page.keyboard.press("/")
    for _ in range(2):
        page.keyboard.press("Tab")
    page.keyboard.press("Enter")  # the second finding, by keys alone
    assert page.evaluate("document.activeElement.classList.contains('now')")


def test_page_of_a_fit_follows_the_scheme(opened, tmp_path):
    path = tmp_path / "fit.html"
    path.write_text(fit_to_html(fit_mesh(faceted_shape(shapes.cylinder(5.0, 20.0), 0.1).mesh)), encoding="utf-8")
    page = opened(path.as_uri(), offline=True, color_scheme="light")
    for scheme in ("light", "dark"):
        page.emulate_media(color_scheme=scheme)
        settle(page)
        corner = page.locator("#view").bounding_box()
        image = pixels(page)
        for x, y in ((5, 5), (int(corner["x"]) + 5, int(corner["y"]) + 5)):  # the page, and behind the part
            assert image[y, x].min() > 200 if scheme == "light" else image[y, x].max() < 70
        for selector in ("h1", "p", "td", "th", "dd", ".pm"):
            assert contrast(page, selector) > 4.5, (scheme, selector)
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
    dark, light = sorted(skimage.color.rgb2xyz(np.array(colours) / 255.0)[:, 1])  # relative luminance
    return (light + 0.05) / (dark + 0.05)


def test_findings_can_be_read_without_webgl_or_script(browser, hinge, tmp_path):
    path = tmp_path / "check.html"
    path.write_text(check_to_html(hinge), encoding="utf-8")
    blind = browser.browser_type.launch(executable_path=chromium(), args=["--no-sandbox", "--disable-3d-apis"])
    for javascript in (True, False):
        page = blind.new_context(offline=True, java_script_enabled=javascript).new_page()
        page.goto(path.as_uri())
        words = page.inner_text("body")
        assert ("cannot draw 3D" in words, "Scripts are off" in words) == (javascript, not javascript)
        assert not page.is_visible("#stage")
        for group in grouped(hinge):
            assert f"{group.a} and {group.b}" in words
    blind.close()


@pytest.fixture(scope="module")
def served(opened, run):
    """The viewer of the reference clamp and its page, which was open before the clamp was assembled; and the run."""
    with Viewer(ClampStory(run.clamp), PageServer(), mesh_error=0.1) as viewer:
        viewer.show(run.path[0])
        page = opened(viewer.url)
        wait_for(page, f'document.getElementById("headline").textContent.includes("{run.path[0].label}")')
        assert not page.is_visible("#timeline")
        page.emulate_media(reduced_motion="no-preference")
        viewer.finish(run)
        wait_for(page, 'document.getElementById("headline").textContent === "clamped"')
        wait_for(page, "viewer.animator.playing")
        yield viewer, page, run
    page.wait_for_timeout(500)
    assert page.is_visible("#timeline")  # the page stays when nothing is served any more
    page.context.close()


def test_served_page_measures_between_the_stops(served):
    viewer, page, run = served
    for k in (1, 5):  # on a straight way, and while the nut is turned
        before, stop = viewer.story["stops"][k - 1 : k + 1]
        seek(page, 0.4 * before["leave"] + 0.6 * stop["arrive"])
        seconds = page.evaluate("viewer.animator.time")  # to a thousandth
        rows = viewer.answer({"time": str(seconds)})["rows"]
        gaps = json.dumps({f"{row['a']}\u2013{row['b']}": row["gap"] for row in rows})
        cells = "[...document.querySelectorAll('#now tr')].map((tr) => [1, 2].map((k) => tr.cells[k].textContent))"
        same = "(shown, gaps) => shown.length === 21 && shown.every(([pair, gap]) => gaps[pair] === gap)"
        wait_for(page, f"({same})({cells}, {gaps})")  # what was measured while it played comes first
        poses = poses_in_browser(page, run.poses)  # three.js: single precision
        truth = measure(run.scene.moved({name: nearest_rigid(T[None])[0] for name, T in poses.items()}))
        for row in rows:
            assert row["distance_mm"] == pytest.approx(truth[row["a"], row["b"]].upper, abs=1e-3)


def test_page_steps_through_the_sequence(served):
    _, page, run = served
    page.emulate_media(reduced_motion="reduce")
    go_to(page, 0)
    groups = [f"{number} {waypoint.label}" for number, waypoint in enumerate(run.path, 1)]
    for number, waypoint in enumerate(run.path):
        assert waypoint.label in page.inner_text("#label")
        for name, T in poses_in_browser(page, waypoint.poses).items():
            pose = waypoint.poses[name].T()
            np.testing.assert_allclose(T[:3, 3], pose[:3, 3], atol=2e-4)
            if name != "P5":  # the nut also turns
                np.testing.assert_allclose(T[:3, :3], pose[:3, :3], atol=1e-5)
        marks = [e.bounding_box() for e in page.query_selector_all("#marks button") if e.inner_text()]
        spans = sorted((box["x"], box["x"] + box["width"]) for box in marks if box["width"] > 8)
        assert spans
        assert all(right <= left for (_, right), (left, _) in itertools.pairwise(spans))  # names never cover each other
        for kind in ("contacts", "gaps"):
            assert [visible(page, kind, group) for group in groups] == [group == groups[number] for group in groups]
        page.click("#forward")
        settle(page)
    assert_drawn(page, run.poses)  # cut open as it is opened
    before = camera(page)
    page.click(".stop:not([hidden]) tr[data-a=P1][data-b=P2] button")
    settle(page)
    assert np.linalg.norm(camera(page) - before) > 0.5
    assert opacity(page, "P6") < 0.2
    assert opacity(page, "P1") == 1.0
    page.click("#home")
    page.click("#back")
    assert run.path[-2].label in page.inner_text("#label")
    assert opacity(page, "P6") == 1.0


def test_a_served_page_lists_verdicts_as_they_come_and_keeps_what_is_picked(opened, sliding, monkeypatch):
    monkeypatch.setattr(clamp3d.output.viewer, "_PAUSE", 0.0)
    scene = sliding.scene.add("deep", shapes.box((4, 4, 4)), translation(0, 0, 6))
    with Viewer(scene, PageServer()) as viewer:
        page = opened(viewer.url)
        wait_for(page, "document.getElementById('headline').textContent === 'checking ...'")
        viewer.show_row(check(replace(scene, motions=()), depths=False).pairs[0])
        wait_for(page, "document.querySelectorAll('.finding').length === 1")
        assert "the check is running" in page.inner_text("#headline")
        assert "still and deep clash: overlap at least" in page.inner_text(".finding")
        page.click(".finding")
        viewer.finish(check(scene))
        wait_for(page, "document.querySelectorAll('#findings > li').length === 3")
        assert "still and deep clash: overlap 1.000000 mm" in page.inner_text(".finding.now")
        page.click(".finding >> nth=-1")  # in a motion: its curve is measured now
        wait_for(page, "(document.querySelector('#curve polygon')?.points.length || 0) >= 40")
        page.context.close()


def test_report_shows_its_pictures_and_links(opened, odd_page, tmp_path):
    (tmp_path / "report.html").write_text(odd_page, encoding="utf-8")
    page = opened((tmp_path / "report.html").as_uri(), offline=True)
    widths = page.evaluate("Promise.all([...document.images].map((i) => i.decode().then(() => i.naturalWidth)))")
    assert len(widths) >= 5
    assert min(widths) > 100
    page.click(".matrix a[href='#P2-P7']")
    assert page.evaluate("document.querySelector('tr:target').id") == "P2-P7"
    assert page.evaluate("document.documentElement.scrollWidth <= window.innerWidth + 1")


def test_meshcat_server_that_was_there_before(browser, sliding):
    from meshcat.servers.zmqserver import start_zmq_server_as_subprocess

    server, zmq_url, web_url = start_zmq_server_as_subprocess()
    try:
        with view(sliding, mesh_error=0.1, url=zmq_url) as viewer:
            assert viewer.url == web_url
        page = browser.new_page(**COARSE)
        page.goto(web_url)  # meshcat's own page, after we have left
        wait_for(page, "viewer.animator.duration > 0")
        for seconds, x in (("0", 30.0), ("viewer.animator.duration", 5.0)):
            page.evaluate(f"viewer.animator.pause(); viewer.animator.seek({seconds})")
            poses = poses_in_browser(page, ["still", "slider"])
            np.testing.assert_allclose(poses["still"], np.eye(4), atol=2e-4)
            np.testing.assert_allclose(poses["slider"], translation(x, 0, 0), atol=2e-4)
        assert visible(page, "caption")  # the mesh error, in the picture itself
        page.close()
    finally:
        server.kill()
        server.communicate()


def test_a_section_hides_what_is_before_it(sliding_page):
    page = sliding_page
    middles = on_screen(page, [(0.0, -5.0, 0.0), (30.0, -5.0, 0.0)])

    def named():
        for x, y in middles:
            page.mouse.click(x, y)
            yield page.inner_text("#identity b") if page.is_visible("#identity") else None

    assert [*named()] == ["still", "slider"]
    page.select_option("#section-axis", "X")
    assert page.inner_text("#section-place") == "X 15.00 mm"
    assert [*named()] == ["still", None]
    image = pixels(page)
    x, y = middles[1]
    assert image[round(y), round(x)].min() > 200  # the ground, no part
    page.click("#section-flip")
    assert [*named()] == [None, "slider"]
    page.locator("#section-at").fill("1")
    assert page.inner_text("#section-place") == "X 35.00 mm"
    assert [*named()] == [None, None]
    page.select_option("#section-axis", "")
    assert [*named()] == ["still", "slider"]


def test_two_clicks_measure_also_on_a_cut(sliding_page):
    page, pixel = sliding_page, 0.2

    def measured(first, second):
        page.keyboard.press("Escape")
        page.keyboard.press("m")
        for point in on_screen(page, [first, second]):
            page.mouse.click(*point)
        wait_for(page, "document.getElementById('measured').textContent.includes('the parts')")
        words = page.inner_text("#measured")
        found = re.fullmatch(
            r"still to slider: ([\d.]+) mm between the points, within 0.20 mm \(X ([\d.]+), Y (.*), Z ([\d.]+)\); "
            r"the parts: gap 20.0000 mm",
            words,
        )
        assert found, words
        return [float(x) for x in found.groups()]

    length = math.hypot(30.0, 2.0)
    np.testing.assert_allclose(measured((0, -5, 0), (30, -5, 2)), [length, 30.0, 0.0, 2.0], atol=pixel)
    page.select_option("#section-axis", "Y")  # at Y = 0
    np.testing.assert_allclose(measured((0, 0, 0), (30, 0, 2)), [length, 30.0, 0.0, 2.0], atol=pixel)
    page.keyboard.press("Escape")
    assert not page.is_visible("#measured")


def test_a_part_can_be_named_isolated_ghosted_and_hidden(sliding_page):
    page = sliding_page
    ((x, y),) = on_screen(page, [(30.0, -5.0, 0.0)])
    page.mouse.click(x, y)
    assert page.inner_text("#identity b") == "slider"
    page.click("#identity [data-do=isolate]")
    assert (opacity(page, "still") < 0.2, opacity(page, "slider")) == (True, 1.0)
    page.keyboard.press("g")
    assert opacity(page, "slider") < 0.2
    page.keyboard.press("Escape")
    assert opacity(page, "still") == opacity(page, "slider") == 1.0
    page.click(".part[data-part=still]")
    page.click("#identity [data-do=hide]")
    assert opacity(page, "still") == 0.0


def test_the_address_names_the_finding_and_the_camera(turned, dark_phone):
    (finding, seen), (finding_there, seen_there) = turned[:2], dark_phone.first
    assert finding_there == finding
    np.testing.assert_allclose(seen_there, seen, atol=1e-3)


def test_the_list_holds_the_findings_of_a_part(hinge_page, hinge):
    page, pairs = hinge_page, [(row.a, row.b) for group in grouped(hinge) for row in group.rows]
    listed = "[...document.querySelectorAll('#findings > li')].filter((e) => !e.hidden).map((e) => e.innerText)"

    def assert_listed(rule):
        found, expected = page.evaluate(listed), [pair for pair in pairs if any(map(rule, pair))]
        assert len(found) == len(expected)
        assert all(a in row and b in row for row, (a, b) in zip(found, expected, strict=True))

    page.click(".part[data-part=leaf-a]")
    with_leaf = sum("leaf-a" in pair for pair in pairs)
    assert page.inner_text("#filtered").strip() == f"- {with_leaf} with leaf-a, of {len(pairs)}"
    assert_listed("leaf-a".__eq__)
    page.keyboard.press("Escape")
    for text in ("PIN", "f-b", "z", ""):
        page.fill("#search", text)
        assert_listed(lambda name, text=text: text.lower() in name)
    assert page.inner_text("#filtered") == ""


def test_labels_never_cover_each_other(hinge_page):
    """Rays through a grid of pixels, by three.js: none meets two labels that are drawn; some labels always are."""
    page = hinge_page
    go_to(page, 2)  # two labels close together, a third one outside the picture until it is zoomed out
    page.locator("#switch-labels").check()
    for zoom, least in ((1.0, 2), (0.5, 3), (0.1, 1)):
        most, drawn = page.evaluate(
            f"viewer.camera.zoom = {zoom};"
            + """(() => {
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
        assert most == 1
        assert drawn >= least


def test_a_picked_finding_of_a_motion_shows_its_curve(sliding_page):
    page = sliding_page
    assert not page.is_visible("#curve")
    page.click(".finding")
    go_to(page, 0)
    wait_for(page, "document.querySelector('#curve figcaption').textContent.includes('t = 0.000')")
    assert re.search(r"(19.9999|20.0000) to 20.000[01] mm$", page.inner_text("#curve figcaption"))
    seek(page, 3.0)
    wait_for(page, "document.getElementById('now').textContent.includes('listed at the stops')")
    assert page.query_selector(".stop:not([hidden])") is None  # on the way nothing is said of another moment
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
