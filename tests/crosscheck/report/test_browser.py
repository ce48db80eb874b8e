"""The report as a reader sees it: in a browser without a window, wide and narrow, light and dark.

Skipped where there is no Chromium (or Chrome) with its driver, or no selenium: `test_site.py` holds the main facts.
"""

import base64
import io
import shutil
import time
from collections.abc import Iterator
from pathlib import Path

import matplotlib.image
import numpy as np
import pytest

import flexmb as fm
from crosscheck.judging.outcome import SessionOutcome
from crosscheck.library.find import resolve, shipped_folder
from crosscheck.report import write_all
from crosscheck.report.measured import write_measured
from crosscheck.running.scheduler import Limits
from crosscheck.running.sweep import sweep
from crosscheck.validation.budget import budget
from crosscheck.validation.measured_set import read_set
from tests.crosscheck.report.sessions import MANY, session
from tests.crosscheck.validation.test_budget import made

webdriver = pytest.importorskip("selenium.webdriver", reason="selenium is not installed: the extra `browser` has it")
BROWSER = next(filter(None, map(shutil.which, ("chromium", "chromium-browser", "google-chrome", "chrome"))), None)
DRIVER = shutil.which("chromedriver")
pytestmark = pytest.mark.skipif(not (BROWSER and DRIVER), reason="there is no Chromium with chromedriver on the path")

WIDE, USUAL, NARROW = (1400, 900), (1280, 800), (390, 800)
PATIENCE_S = 30.0
HIGHEST = {WIDE: 7000, NARROW: 12000}  # of a page, in pixels; the report of one file was 274000 high
CONTRASTS = (Path(__file__).parent / "contrasts.js").read_text(encoding="utf-8")
FOCUSED = """
const e = document.activeElement;
return [e.tagName, e.tagName === "SUMMARY" && !e.parentElement.open, e === document.body];
"""
PAGES = Path(__file__).parents[3] / "docs" / "_static"
VIEW = "document.querySelector('.animation').view"
DISTANCE = f"return {VIEW}.camera.position.distanceTo({VIEW}.controls.target)"
MIDDLE = """
const box = document.querySelector(arguments[0]).getBoundingClientRect();
return [box.x + box.width / 2, box.y + box.height / 2];
"""
BOX = """
const box = document.querySelector(arguments[0]).getBoundingClientRect();
return [box.left, box.top, box.right, box.bottom];
"""
FIND = """
const search = document.getElementById("search"), filter = document.getElementById("filter");
search.value = arguments[0]; search.oninput(); filter.value = arguments[1]; filter.onchange();
return document.getElementById("shown").textContent;
"""
SWITCHES = ("headless=new", "no-sandbox", "use-angle=swiftshader", "enable-unsafe-swiftshader", "disable-dev-shm-usage")


class Reader:
    """A browser with a window of some size, that opens pages from the disk."""

    def __init__(self) -> None:
        options = webdriver.ChromeOptions()
        options.binary_location = BROWSER
        for word in SWITCHES:
            options.add_argument(f"--{word}")
        options.set_capability("goog:loggingPrefs", {"browser": "ALL"})
        self.driver = webdriver.Chrome(options=options, service=webdriver.ChromeService(DRIVER))

    def open(
        self, file: Path, size: tuple[int, int] = WIDE, part: str = "", dark: bool = False, calm: bool = True
    ) -> None:
        media = {
            "prefers-color-scheme": "dark" if dark else "light",
            "prefers-reduced-motion": "reduce" if calm else "",
        }
        self.tell(
            "Emulation.setDeviceMetricsOverride", width=size[0], height=size[1], deviceScaleFactor=1, mobile=False
        )
        self.tell(
            "Emulation.setEmulatedMedia", features=[{"name": key, "value": value} for key, value in media.items()]
        )
        self.driver.get("about:blank")
        self.errors()
        self.driver.get(file.resolve().as_uri() + (f"#{part}" if part else ""))

    def tell(self, command: str, **words: object) -> object:
        return self.driver.execute_cdp_cmd(command, words)

    def run(self, script: str, *words: object) -> object:
        return self.driver.execute_script(script, *words)

    def wait(self, script: str) -> None:
        """Until the script returns what is true."""
        end = time.monotonic() + PATIENCE_S
        while not self.run(script):
            assert time.monotonic() < end, f"in vain: {script}; {self.errors()}"
            time.sleep(0.05)

    def press(self, key: str, shift: bool = False) -> None:
        text = {" ": " ", "Enter": "\r"}.get(key, "")
        for kind in ("keyDown", "keyUp"):
            words = {"text": text} if text and kind == "keyDown" else {}
            code = {"Tab": 9, "Enter": 13, " ": 32, "ArrowRight": 39, "ArrowLeft": 37}[key]
            self.tell(
                "Input.dispatchKeyEvent", type=kind, key=key, windowsVirtualKeyCode=code, modifiers=8 * shift, **words
            )

    def errors(self) -> list[str]:
        """What the console has had to say since it was last asked."""
        return [entry["message"] for entry in self.driver.get_log("browser") if entry["level"] in ("SEVERE", "WARNING")]

    def picture(self, selector: str) -> np.ndarray:
        """What is seen of an element: pixels (rows, columns, 3)."""
        place = self.run(
            "const e = document.querySelector(arguments[0]); e.scrollIntoView({block: 'center'});"
            "const r = e.getBoundingClientRect(); return [r.x + scrollX, r.y + scrollY, r.width, r.height];",
            selector,
        )
        clip = dict(zip(("x", "y", "width", "height"), place, strict=True)) | {"scale": 1}
        answer = self.tell("Page.captureScreenshot", clip=clip, captureBeyondViewport=True)
        return matplotlib.image.imread(io.BytesIO(base64.b64decode(answer["data"])))[..., :3]


@pytest.fixture(scope="module")
def reader() -> Iterator[Reader]:
    found = Reader()
    yield found
    found.driver.quit()


@pytest.fixture(scope="module")
def many(tmp_path_factory: pytest.TempPathFactory) -> tuple[SessionOutcome, Path]:
    """A session with many verdicts, of which some are not as expected."""
    return session(tmp_path_factory.mktemp("browser"), MANY)


@pytest.fixture(scope="module")
def mechanism(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The page of the rigid four-bar, run by the library's own engine."""
    folder = tmp_path_factory.mktemp("mechanism")
    sweep(resolve(("closed_chains/four_bar",)), ("native",), folder / "records.jsonl", limits=Limits(workers=1))
    _, index = write_all(folder / "records.jsonl", folder)
    return index.parent / "closed_chains" / "four_bar.html"


@pytest.fixture
def page(many: tuple[SessionOutcome, Path]) -> Path:
    return many[1].parent / "pendulum" / "single.html"


@pytest.mark.parametrize("size", [WIDE, NARROW])
def test_pages_fit_their_width_and_are_not_long(
    reader: Reader, many: tuple[SessionOutcome, Path], page: Path, size
) -> None:
    for file in (many[1], page):
        reader.open(file, size)
        assert reader.run("return document.documentElement.scrollWidth") <= size[0]
        assert reader.run("return document.documentElement.scrollHeight") < HIGHEST[size]
        reader.run("scrollTo(0, 600)")
        assert reader.run("return document.querySelector('nav').getBoundingClientRect().top") == 0
        assert reader.errors() == []


@pytest.mark.parametrize("size", [WIDE, NARROW])
def test_charts_are_drawn(reader: Reader, page: Path, size) -> None:
    reader.open(page, size)
    for kind, colours in ((".panels", 2), (".drifts", 2), (".work", 2)):
        plot = f"{kind} .plot"
        reader.run("document.querySelector(arguments[0]).scrollIntoView({block: 'center'})", plot)
        reader.wait(f"return document.querySelector('{plot}.drawn') !== null")
        seen = reader.picture(plot)
        assert len(hues(seen)) >= colours, kind
        assert np.mean(seen.min(axis=2) < 0.75) > 0.004, kind
        assert reader.run("return document.querySelector(arguments[0]).ariaLabel", plot).startswith("Chart: ")
    assert reader.errors() == []


def test_all_charts_are_drawn_without_being_looked_at_so_that_they_are_printed(reader: Reader, page: Path) -> None:
    reader.open(page)
    reader.wait("return document.querySelectorAll('.plot').length > 2")
    reader.wait("return [...document.querySelectorAll('.plot')].every(p => !p.clientWidth || p.matches('.drawn'))")
    assert reader.run("return scrollY") == 0
    assert reader.errors() == []


@pytest.mark.parametrize("size", [WIDE, NARROW])
@pytest.mark.parametrize("dark", [False, True], ids=["light", "dark"])
def test_the_index_shows_speed_against_accuracy_and_leads_to_the_case(
    reader: Reader, many: tuple[SessionOutcome, Path], size, dark: bool
) -> None:
    reader.open(many[1], size, dark=dark)
    reader.run("document.querySelector('.overall').scrollIntoView()")
    reader.wait("return document.querySelector('.overall .plot.drawn') !== null")
    assert len(hues(reader.picture(".overall .plot"))) >= 2
    assert "1 charts, by fine" in reader.run("return document.querySelector('.overall .plot').ariaLabel")
    reader.run("const c = document.getElementById('speed-cases'); c.value = '0'; c.onchange()")
    reader.wait("return document.querySelector('.overall .xtitle').textContent.endsWith('solve, s')")
    for title in (".xtitle", ".ytitle"):  # whole, and not over the numbers of the axis
        left, top, right, bottom = reader.run(BOX, f".overall {title}")
        ticks = [reader.run(BOX, f".overall .{title[1]}axislayer-above")]
        assert left >= 0 and right <= size[0] and bottom > top
        assert not any(left < r and l < right and top < b and t < bottom for l, t, r, b in ticks)
    reader.run("document.querySelector('.overall .plot').emit('plotly_click', {points: [{customdata: arguments[0]}]})",
               "pendulum/single.html#case-0-speed")  # fmt: skip
    reader.wait("return location.hash === '#case-0-speed' && document.readyState === 'complete'")
    assert reader.errors() == []


@pytest.mark.parametrize("where", [".overall", ".work"])
def test_axis_legend_and_names_of_lines_are_seen_at_once(
    reader: Reader, many: tuple[SessionOutcome, Path], page: Path, where: str
) -> None:
    """In a window of 1280 x 800 pixels whose upper edge is at the heading."""
    heading = {".overall": "speed", ".work": "case-0-speed"}[where]
    reader.open(many[1] if where == ".overall" else page, USUAL)
    reader.run("document.getElementById(arguments[0]).scrollIntoView()", heading)
    reader.wait(f"return document.querySelector('{where} .plot.drawn') !== null")
    reader.run("document.getElementById(arguments[0]).scrollIntoView()", heading)
    for part in (".xtitle", ".ytitle", ".legend"):
        left, top, right, bottom = reader.run(BOX, f"{where} {part}")
        assert 0 <= left < right <= USUAL[0] and 0 <= top < bottom <= USUAL[1], part
    names = reader.run("return [...document.querySelectorAll(arguments[0])].map(each => each.textContent)",
                       f"{where} .annotation-text")  # fmt: skip
    assert {"fine", "stepper"} <= {name.split(" ")[0] for name in names}
    assert reader.errors() == []


@pytest.mark.parametrize("size", [WIDE, NARROW])
def test_every_body_moves(reader: Reader, mechanism: Path, size) -> None:
    reader.open(mechanism, size)
    reader.run("document.querySelector('.animation').scrollIntoView()")
    reader.wait("return Boolean(document.querySelector('.animation').view)")
    still = reader.picture(".animation canvas")
    assert len(hues(still)) >= 3  # crank, coupler and rocker
    assert 0.01 < np.mean(still.max(axis=2) - still.min(axis=2) > 0.15) < 0.7
    reader.run("const v = document.querySelector('.animation').view; v.phase = 0.4; v.draw()")
    assert np.mean(np.abs(reader.picture(".animation canvas") - still) > 0.1) > 0.01
    assert "Four-bar" in reader.run("return document.querySelector('.animation canvas').ariaLabel")
    assert reader.errors() == []


def test_keys_play_and_step_and_motion_waits_where_less_is_wanted(reader: Reader, mechanism: Path) -> None:
    playing, phase = f"return {VIEW}.playing", f"return {VIEW}.phase"
    reader.open(mechanism, calm=False)
    reader.wait("return document.querySelector('.animation').view?.playing")
    reader.open(mechanism)
    reader.wait("return Boolean(document.querySelector('.animation').view)")
    assert not reader.run(playing)
    reader.run("document.querySelector('.animation canvas').focus()")
    reader.press("ArrowRight")
    assert reader.run(phase) > 0.0
    reader.press("ArrowLeft")
    assert reader.run(phase) == 0.0
    reader.press(" ")
    assert reader.run(playing)
    reader.press(" ")
    assert not reader.run(playing)


def test_the_wheel_scrolls_the_page_until_the_picture_is_selected(reader: Reader, mechanism: Path) -> None:
    reader.open(mechanism)
    reader.wait("return Boolean(document.querySelector('.animation').view)")
    before = reader.run(DISTANCE)
    turn_wheel_over(reader, ".animation canvas")
    reader.wait("return scrollY > 50")
    assert reader.run(DISTANCE) == pytest.approx(before)
    reader.run("scrollTo(0, 0); document.querySelector('.animation canvas').focus()")
    turn_wheel_over(reader, ".animation canvas")
    reader.wait(f"return Math.abs((() => {{ {DISTANCE} }})() - {before}) > {before} / 50")
    assert reader.run("return scrollY") == 0
    reader.run("document.activeElement.blur(); document.querySelector('.work .plot').scrollIntoView({block: 'center'})")
    reader.wait("return document.querySelector('.work .plot.drawn') !== null")
    at = reader.run("return scrollY")
    turn_wheel_over(reader, ".work .plot", -200)
    reader.wait(f"return scrollY < {at} - 50")


def test_the_keyboard_reaches_every_verdict(reader: Reader, many: tuple[SessionOutcome, Path], page: Path) -> None:
    """Tab goes on, Enter opens; at the end every verdict is to be seen."""
    reader.open(page, NARROW)
    shown = "return [...document.querySelectorAll('tr.verdict')].filter(row => row.checkVisibility()).length"
    assert reader.run(shown) == 0
    stops = 0
    while stops < 250:
        reader.press("Tab")
        tag, closed, body = reader.run(FOCUSED)
        if body:
            break
        stops += 1
        if tag == "SUMMARY" and closed:
            reader.press("Enter")
    assert reader.run(shown) == len(many[0].all)
    assert stops < 200


@pytest.mark.parametrize("dark", [False, True], ids=["light", "dark"])
def test_text_stands_out(reader: Reader, many: tuple[SessionOutcome, Path], page: Path, dark: bool) -> None:
    for file in (many[1], page):
        reader.open(file, dark=dark)
        reader.run("document.querySelectorAll('details').forEach(each => { each.open = true; })")
        if file is page:
            reader.run("document.querySelector('.work').scrollIntoView()")
            reader.wait("return document.querySelector('.work .plot.drawn') !== null")
        ratios = reader.run(CONTRASTS)
        assert len(ratios) > 60
        assert [ratio for ratio in ratios if ratio[0] < 4.5] == []
        reader.press("Tab")
        assert reader.run("return getComputedStyle(document.activeElement).outlineStyle") == "solid"


def test_a_link_opens_the_verdict_it_names(reader: Reader, many: tuple[SessionOutcome, Path], page: Path) -> None:
    reader.open(many[1])
    reader.run("document.querySelector('.findings a').click()")
    reader.wait("return document.readyState === 'complete' && location.hash.includes('verdict')")
    reader.wait("const row = document.querySelector('tr:target'); return row !== null && row.checkVisibility()")
    assert "bad" in reader.run("return document.querySelector('tr:target .look').className")


def test_cases_are_searched_and_filtered(reader: Reader, many: tuple[SessionOutcome, Path]) -> None:
    reader.open(many[1])
    assert reader.run(FIND, "PENDULUM single", "") == reader.run(FIND, "", "bad") == "1 of 1 cases"
    assert reader.run(FIND, "elbow", "") == reader.run(FIND, "", "good") == "0 of 1 cases"


def test_the_single_file_shows_as_much(reader: Reader, mechanism: Path, tmp_path: Path) -> None:
    _, file = write_all(mechanism.parents[2] / "records.jsonl", tmp_path, single_file=True)
    reader.open(file)
    reader.run("document.querySelector('.animation').scrollIntoView()")
    reader.wait("return Boolean(document.querySelector('.animation').view)")
    reader.run("document.querySelector('.work').scrollIntoView()")
    reader.wait("return document.querySelector('.work .plot.drawn') !== null")
    assert reader.run("return performance.getEntriesByType('resource').length") == 0
    assert reader.errors() == []


def turn_wheel_over(reader: Reader, selector: str, by: int = 200) -> None:
    x, y = reader.run(MIDDLE, selector)
    reader.tell("Input.dispatchMouseEvent", type="mouseWheel", x=x, y=y, deltaX=0, deltaY=by)


def hues(picture: np.ndarray) -> list[int]:
    """Sixths of the circle of colours that are seen on at least one pixel in two thousand."""
    high, low = picture.max(axis=2), picture.min(axis=2)
    vivid = picture[(high - low) > 0.2]
    if not len(vivid):
        return []
    spread = vivid.max(axis=1) - vivid.min(axis=1)
    r, g, b = vivid.T
    angle = np.select(
        [vivid.argmax(axis=1) == 0, vivid.argmax(axis=1) == 1],
        [((g - b) / spread) % 6, (b - r) / spread + 2],
        (r - g) / spread + 4,
    )
    counts = np.bincount(np.round(angle * 2).astype(int) % 12, minlength=12)
    return [i for i in range(12) if counts[i] > high.size / 2000]


@pytest.mark.parametrize("size", [WIDE, NARROW])
def test_a_measured_set_is_drawn(reader: Reader, tmp_path: Path, size: tuple[int, int]) -> None:
    """Its three charts, with bars and bands, fit the window; nothing is complained of."""
    index = write_measured([budget(read_set(made(tmp_path)))], "one set", tmp_path / "out")
    reader.open(next(file for file in index.parent.glob("*.html") if file != index), size)
    for i in range(3):
        reader.run("document.querySelectorAll('.plot')[arguments[0]].scrollIntoView({block: 'center'})", i)
        reader.wait(f"return document.querySelectorAll('.plot')[{i}].classList.contains('drawn')")
    assert reader.run("return document.querySelectorAll('.errorbar').length") == 3
    assert reader.run("return document.querySelectorAll('.bars .point').length") == 2
    assert reader.run("return document.documentElement.scrollWidth") <= size[0]
    assert not reader.errors()


def test_a_view_of_a_run_moves_and_shows_its_loads(reader: Reader, tmp_path: Path) -> None:
    """The page of `Trajectory.view`, which loads nothing."""
    file = tmp_path / "view.html"
    fm.simulate(fm.load_scene(shipped_folder() / "pendulums" / "double" / "scene.toml"), 1.0).view(file)
    reader.open(file)
    reader.wait("return Boolean(document.querySelector('.animation').view)")
    still = reader.picture(".animation canvas")
    assert len(hues(still)) >= 2
    reader.run("const v = document.querySelector('.animation').view; v.phase = 0.4; v.draw()")
    moved = reader.picture(".animation canvas")
    assert np.mean(np.abs(moved - still) > 0.1) > 0.005
    reader.run("const c = document.querySelector('.loads'); c.value = ''; c.onchange()")
    without = reader.picture(".animation canvas")
    assert np.count_nonzero(np.any(np.abs(without - moved) > 0.1, axis=2)) > 50  # pixels of the arrows, which are gone
    reader.run("document.querySelector('.animation').view.draw()")
    assert np.array_equal(reader.picture(".animation canvas"), without)
    assert reader.run("return performance.getEntriesByType('resource').length") == 0
    assert reader.errors() == []


@pytest.mark.parametrize("size", [WIDE, NARROW])
def test_a_page_that_computes_moves_and_takes_numbers(reader: Reader, size: tuple[int, int]) -> None:
    """That of the site, which `flexmb export --page` has made: it runs by itself, from a slider on otherwise."""
    reader.open(PAGES / "yoke_array.html", size, calm=False)
    reader.wait(f"return {VIEW}?.model.time > 0.3")
    assert reader.run(f"return {VIEW}.playing && {VIEW}.said.textContent === ''")
    assert len(hues(reader.picture(".animation canvas"))) >= 2
    # From the start to the same time, with the number of the scene and with another one: other angles.
    script = f"""
        const v = {VIEW}, slider = document.querySelectorAll(".numbers input")[arguments[0]];
        v.play(false); slider.value = arguments[1]; slider.oninput(); v.restart(); v.model.advance(0.5);
        return Array.from(v.model.state);
    """
    first, other, again = (np.array(reader.run(script, 0, value)) for value in (2.0, 4.0, 2.0))
    assert np.all(np.isfinite(first)) and np.array_equal(first, again)
    assert np.max(np.abs(first - other)) > 1e-3
    assert "Computed here" in reader.run("return document.querySelector('.hint:not(.notes)').textContent")
    assert reader.run("return document.documentElement.scrollWidth") <= size[0]
    assert reader.run("return performance.getEntriesByType('resource').length") == 0
    assert reader.errors() == []


@pytest.mark.parametrize("size", [WIDE, NARROW])
def test_the_charts_of_a_run_are_drawn(reader: Reader, tmp_path: Path, size: tuple[int, int]) -> None:
    """The page of `Trajectory.plot`, which loads nothing."""
    file = tmp_path / "charts.html"
    fm.simulate(fm.load_scene(shipped_folder() / "pendulums" / "double" / "scene.toml"), 1.0).plot(file)
    reader.open(file, size)
    reader.wait("return document.querySelectorAll('.js-plotly-plot').length === 4")
    for number in range(4):
        reader.run("document.querySelectorAll('.js-plotly-plot')[arguments[0]].id = 'shown' + arguments[0]", number)
        assert len(hues(reader.picture(f"#shown{number}"))) >= 2
    assert HIGHEST[size] > reader.run("return document.documentElement.scrollHeight")
    assert reader.run("return document.documentElement.scrollWidth") <= size[0]
    assert reader.run("return performance.getEntriesByType('resource').length") == 0
    assert reader.errors() == []


def test_a_model_that_runs_away_is_not_shown_first(reader: Reader, tmp_path: Path) -> None:
    """The first bending variant is, unless it travels far beyond the calmer ones; a rigid one is passed over."""
    file = tmp_path / "view.html"
    fm.simulate(fm.load_scene(shipped_folder() / "pendulums" / "double" / "scene.toml"), 0.1).view(file)
    reader.open(file)
    script = """
        const series = arguments[0].map(([, far]) => [[0, far], [0, 0], [0, 0]]);
        return firstShown(arguments[0].map(([kind], i) => ({ lines: [{ kind }], markers: [{ position: i }] })), series);
    """
    alike = [["solid", 1.0], ["beam", 1.3], ["beam", 1.2], ["beam", 1.0]]
    assert reader.run(script, alike) == 1
    assert reader.run(script, [alike[0], ["beam", 90.0], *alike[2:]]) == 2
    assert reader.run(script, [["solid", 1.0], ["solid", 1.1]]) == 0
