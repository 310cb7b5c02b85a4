"""The page in a real browser: it is clicked, slid and typed on, and its numbers are read back.

Run by `make stress`; needs chromium and its driver, which Debian's packages bring. Python says what
each number must be. Whatever the browser's console reports as an error, such as what the page's
policy does not allow, is a failure.
"""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path

# The checkout comes first: tests/ has a folder experiments/ too.
TESTS = Path(__file__).resolve().parents[1]
sys.path[:0] = [str(TESTS.parent), str(TESTS)]

import numpy as np
from page_answers import CIRCLE, answer_of
from selenium import webdriver
from selenium.webdriver.common.by import By
from selenium.webdriver.common.keys import Keys
from selenium.webdriver.support.ui import Select

from experiments.page.document import page
from experiments.page.drawing import Frame, places
from experiments.page.words import where
from mlci.answers import Answer
from mlci.evidence import Rates
from mlci.forecasts import ForecastCurve, ForecastMap
from mlci.inference import Inference
from mlci.planes import planes
from mlci.regions import Regions
from mlci.spaces import Box, StateSpace

PACKAGES = {"chromium": "chromium", "chromedriver": "chromium-driver"}  # Debian's, by program
OPTIONS = (
    *("--headless", "--no-sandbox", "--disable-gpu", "--disable-quic", "--no-first-run"),
    *("--disable-background-networking", "--disable-component-update", "--disable-sync"),
)
EVIL = "</script><script>alert(1)</script><b>\"'&amp;"


def programs() -> dict[str, str]:
    """Where the browser and its driver are; installs what is missing where that is allowed."""
    missing = [package for name, package in PACKAGES.items() if not shutil.which(name)]
    if missing and os.geteuid() == 0 and shutil.which("apt-get"):
        subprocess.run(["apt-get", "update", "--quiet"], check=True)
        install = ["apt-get", "install", "--yes", "--quiet", "--no-install-recommends"]
        subprocess.run([*install, *missing], check=True)
    found = {name: shutil.which(name) or "" for name in PACKAGES}
    if not all(found.values()):
        sys.exit(
            f"the page is tested in a browser; {' and '.join(missing)} cannot be installed here: "
            f"as root on Debian, apt-get install {' '.join(PACKAGES.values())}"
        )
    return found


@contextmanager
def browser() -> Iterator[webdriver.Chrome]:
    """A browser with a profile of its own."""
    found = programs()
    with tempfile.TemporaryDirectory(ignore_cleanup_errors=True) as profile:
        options = webdriver.ChromeOptions()
        options.binary_location = found["chromium"]
        for word in (*OPTIONS, f"--user-data-dir={profile}"):
            options.add_argument(word)
        options.set_capability("goog:loggingPrefs", {"browser": "ALL"})
        service = webdriver.ChromeService(found["chromedriver"])
        driver = webdriver.Chrome(options=options, service=service)
        try:
            yield driver
        finally:
            driver.quit()


def show(driver: webdriver.Chrome, text: str, folder: Path, width: int = 1280) -> None:
    """Open a page in a window of some width."""
    path = folder / "page.html"
    path.write_text(text, encoding="utf-8")
    size = {"width": width, "height": 900, "deviceScaleFactor": 1, "mobile": width < 500}
    driver.execute_cdp_cmd("Emulation.setDeviceMetricsOverride", size)
    driver.get(path.as_uri())


def text(driver: webdriver.Chrome, name: str) -> str:
    """What the part of the page with an id says."""
    return driver.find_element(By.ID, name).text


def of_100(probability: float) -> str:
    """A probability as the page writes it; words of its own, so that Python checks the script."""
    if 0 < probability < 0.0005:
        return "under 0.1"
    return "over 99.9" if 0.9995 <= probability < 1 else f"{100 * probability:.1f}"


def nat(gain: float) -> str:
    """A gain as the page writes it."""
    return "ruled out" if gain == -np.inf else f"{gain:.3f}"


def place(rank: float) -> str:
    """A rank as the page writes it."""
    return f"{rank:.0f}" if rank == round(rank) else f"{rank:.1f}"


def same(shown: str, expected: str) -> bool:
    """Whether a number is as expected, but for a last digit that is rounded half way."""
    try:
        return abs(float(shown) - float(expected)) <= 10.0 ** -len(shown.partition(".")[2]) * 1.001
    except ValueError:
        return shown == expected


def check_table(driver: webdriver.Chrome, inference: Inference) -> None:
    """The table of regions is the ranking."""
    rows = driver.find_elements(By.CSS_SELECTOR, "#rows tr")
    assert len(rows) >= min(10, len(inference.hypotheses))
    for row, i in zip(rows[:10], inference.order, strict=False):
        cells = [cell.text for cell in row.find_elements(By.TAG_NAME, "td")]
        assert cells[0] == place(inference.ranking.rank[i]), (cells, i)
        assert cells[1] == inference.hypotheses.names[i], (cells, i)
        assert cells[2] == where(inference.hypotheses, int(i)), (cells, i)
        assert same(cells[3], of_100(inference.posterior[i])), (cells, inference.posterior[i])
        assert same(cells[4], nat(inference.gain[i])), (cells, inference.gain[i])
        assert cells[5] == str(int(inference.violated[:, i].sum())), (cells, i)


def check_slider(driver: webdriver.Chrome, inference: Inference) -> None:
    """The ranking after each number of demonstrations, from all of them to none."""
    slider = driver.find_element(By.ID, "count")
    names, count = inference.hypotheses.names, len(inference.names)
    for k in range(count, -1, -1):
        part = inference.of(slice(k))
        check_table(driver, part)
        words, first = text(driver, "after"), part.order[0]
        none = words.rpartition("is avoided: ")[2].removesuffix(" of 100.")
        assert same(none, of_100(part.posterior_none)), (k, words)
        if part.gain[first] > 0:
            assert f"region {names[first]} comes first" in words, (k, words)
        else:
            assert "no region stands out" in words, (k, words)
        drawn = driver.find_elements(By.CSS_SELECTOR, ".map:not([hidden]) .paths > .path:not(.off)")
        assert len(drawn) == k
        slider.send_keys(Keys.ARROW_LEFT)
    assert "After the first 0 of" in text(driver, "after")
    slider.send_keys(Keys.END)
    check_table(driver, inference)


def check_region(driver: webdriver.Chrome, answer: Answer, i: int) -> None:
    """What is told of the selected region: its numbers, and who speaks for and against it."""
    inference, regions = answer.inference, answer.inference.hypotheses
    assert text(driver, "region-title") == f"Region {regions.names[i]}"
    facts = text(driver, "facts")
    assert f"Place {place(inference.ranking.rank[i])} of {len(regions)}" in facts, facts
    assert where(regions, i)[1:] in facts
    shown = facts.partition("how likely: ")[2].partition(" of 100")[0]
    assert same(shown, of_100(inference.posterior[i])), facts
    driver.execute_script("document.querySelectorAll('details').forEach((d) => { d.open = true; })")
    seen = {}
    for row in driver.find_elements(By.CSS_SELECTOR, "#reasons tr[data-demonstration]"):
        seen[int(row.get_attribute("data-demonstration"))] = [
            cell.text for cell in row.find_elements(By.TAG_NAME, "td")
        ]
    assert sorted(seen) == list(range(len(inference.names)))
    for j, cells in seen.items():
        assert cells[0] == inference.names[j]
        if inference.violated[j, i]:
            assert cells[-1] == "enters the region"
            assert same(cells[-2], nat(inference.evidence[j, i]))
        elif not inference.reachable[j]:
            assert cells[-1] == "the model cannot reach its goal"
        elif inference.decided_by_cell[j, i]:
            assert "only the cell" in cells[-1]
        elif inference.evidence[j, i] > 0:
            assert same(cells[1], of_100(inference.phi[j, i])), (i, j, cells)
            assert same(cells[-1], nat(inference.evidence[j, i])), (i, j, cells)
            if inference.calibration is not None:
                assert same(cells[2], of_100(1 - inference.forecast[j, i])), (i, j, cells)
        else:
            assert cells[-1] == "the region is not on the way of its task", (i, j, cells)


def check_map(driver: webdriver.Chrome, answer: Answer) -> None:
    """Each region can be clicked, and reached and selected by keys."""
    shapes = driver.find_elements(By.CSS_SELECTOR, ".map:not([hidden]) .place")
    count = len(answer.inference.hypotheses)
    assert len(shapes) == count
    for i in range(0, count, 3):
        driver.execute_script(
            "arguments[0].dispatchEvent(new MouseEvent('click', {bubbles: true}))", shapes[i]
        )
        check_region(driver, answer, i)
        name = shapes[i].find_element(By.TAG_NAME, "title").get_attribute("textContent")
        assert name.startswith(f"Region {answer.inference.hypotheses.names[i]}; "), name
        assert shapes[i].get_attribute("aria-pressed") == "true"
    shapes[0].click()  # by the mouse itself
    check_region(driver, answer, 0)
    moves = [(Keys.ARROW_RIGHT, 1, 0), (Keys.ARROW_UP, 0, 1), (Keys.ARROW_LEFT, -1, 0)]
    lower, at = answer.inference.hypotheses.lower, 0
    for key, *way in moves:
        focused = driver.switch_to.active_element
        focused.send_keys(key)
        to = int(driver.switch_to.active_element.get_attribute("data-regions"))
        assert np.sign(lower[to] - lower[at]).tolist() == way, (key, at, to)
        ring = driver.find_element(By.CSS_SELECTOR, ".map:not([hidden]) .ring.focused")
        shape = driver.switch_to.active_element.find_element(By.TAG_NAME, "path")
        assert ring.get_attribute("d") == shape.get_attribute("d") != ""
        driver.switch_to.active_element.send_keys(Keys.ENTER)
        check_region(driver, answer, to)
        at = to


def check_planes(driver: webdriver.Chrome, folder: Path) -> None:
    """Three dimensions: each pair has a map, and a place lists all regions that lie there."""
    space = StateSpace(Box([0] * 3, [1] * 3), [False] * 3, ("a", "b", "c"), ("m", "m", "m"))
    regions = Regions.from_grid(space, (2, 3, 4))
    answer, paths = answer_of(regions, ["one", "two", "three"])
    show(driver, page(answer, paths, title="Three dimensions"), folder)
    rank = answer.inference.ranking.rank
    for number, plane in enumerate(planes(regions)):
        Select(driver.find_element(By.ID, "plane")).select_by_index(number)
        shapes = driver.find_elements(By.CSS_SELECTOR, ".map:not([hidden]) .place")
        for shape, members in zip(shapes, places(Frame(plane), regions).values(), strict=True):
            driver.execute_script(
                "arguments[0].dispatchEvent(new MouseEvent('click', {bubbles: true}))", shape
            )
            best = min(members, key=lambda i: (rank[i], i))
            check_region(driver, answer, best)
            others = Select(driver.find_element(By.ID, "other"))
            assert len(others.options) == len(members)
            others.select_by_index(len(members) - 1)
            check_region(driver, answer, max(members, key=lambda i: (rank[i], i)))
    check_slider(driver, answer.inference)


def check_looks(driver: webdriver.Chrome, shown: str, folder: Path) -> None:
    """On a phone nothing is wider than the screen; on paper there are no controls."""
    show(driver, shown, folder, width=360)
    assert driver.execute_script("return document.documentElement.scrollWidth") <= 360
    tiny = driver.execute_script(
        "return [...document.querySelectorAll('.map:not([hidden]) svg text')]"
        ".filter((t) => t.getBoundingClientRect().height < 8).map((t) => t.textContent)"
    )
    assert not tiny, tiny
    driver.execute_cdp_cmd("Emulation.setEmulatedMedia", {"media": "print"})
    visible = driver.execute_script(
        "return [...document.querySelectorAll('input, select, button')]"
        ".filter((one) => one.checkVisibility() && !one.closest('td')).length"
    )
    assert visible == 0
    driver.execute_cdp_cmd("Emulation.setEmulatedMedia", {"media": ""})
    paper = driver.execute_cdp_cmd("Page.printToPDF", {"printBackground": True})
    assert len(paper["data"]) > 10_000


def no_errors(driver: webdriver.Chrome) -> None:
    """The console has nothing to say."""
    errors = driver.get_log("browser")
    assert not errors, errors


def main() -> None:
    """All pages, one after the other."""
    regions = Regions.from_grid(CIRCLE, (6, 5))
    names = [f"recording {j}" for j in range(8)]
    curve = ForecastCurve((0.01, 0.1), 180, 2000, 0.1, 0.9, 0.8, 0.9)
    with browser() as driver, tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        for rates in (Rates(0.1), Rates(0.1, 0.05)):
            answer, paths = answer_of(regions, names, rates)
            show(driver, page(answer, paths, title="By hand"), folder)
            check_slider(driver, answer.inference)
            check_map(driver, answer)
            no_errors(driver)
        print("clicked, slid and typed: numbers are Python's", flush=True)
        answer, paths = answer_of(regions, names)
        inference = replace(answer.inference, calibration=ForecastMap((curve,)))
        answer = replace(answer, inference=inference)
        shown = page(answer, paths, title="Calibrated", truth=regions.select(np.arange(30) == 3))
        show(driver, shown, folder)
        check_map(driver, answer)
        check_looks(driver, shown, folder)
        check_planes(driver, folder)
        no_errors(driver)
        print("calibrated, on a phone, on paper, in three dimensions", flush=True)
        evil = Regions(CIRCLE, regions.lower, regions.upper, tuple(f"{EVIL}{i}" for i in range(30)))
        answer, paths = answer_of(evil, [EVIL, f"{EVIL}2", f"{EVIL}3"])
        show(driver, page(answer, paths, title=EVIL, about=EVIL, doubtful=[EVIL]), folder)
        check_table(driver, answer.inference)
        assert len(driver.find_elements(By.TAG_NAME, "script")) == 2
        no_errors(driver)
        print("names that look like code are text", flush=True)


if __name__ == "__main__":
    main()
