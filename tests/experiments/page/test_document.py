"""The page: valid, complete in itself, small, and deaf to whatever names hold."""

from __future__ import annotations

import base64
import hashlib
import json
import re
from dataclasses import replace

import html5lib
import numpy as np
import pytest
from page_answers import CIRCLE, answer_of

from experiments.page.document import page
from experiments.page.drawing import Frame, places
from mlci.forecasts import ForecastCurve, ForecastMap
from mlci.planes import planes
from mlci.regions import Regions
from mlci.spaces import Box, StateSpace

REGIONS = Regions.from_grid(CIRCLE, (4, 5))
EVIL = "</script><script>alert(1)</script><b>&amp;\"'<!--\u2028"


def tree_of(text: str):
    """The document of a page; raises at the first thing that is no valid HTML."""
    return html5lib.HTMLParser(strict=True, namespaceHTMLElements=False).parse(text)


def text_of(text: str) -> str:
    return " ".join("".join(tree_of(text).itertext()).split())


def data_of(text: str) -> dict:
    (script,) = (
        each for each in tree_of(text).iter("script") if each.get("type") == "application/json"
    )
    return json.loads(script.text)


def test_a_page_is_valid_and_the_same_each_time() -> None:
    answer, paths = answer_of(REGIONS, ["a", "b", "c"])
    text = page(
        answer,
        paths,
        title="A page",
        about="From here.",
        truth=REGIONS.select(np.arange(20) == 7),
        doubtful=["something odd"],
        assumed=["something plain"],
    )
    assert text == page(
        *answer_of(REGIONS, ["a", "b", "c"]),
        title="A page",
        about="From here.",
        truth=REGIONS.select(np.arange(20) == 7),
        doubtful=["something odd"],
        assumed=["something plain"],
    )
    tree, words = tree_of(text), text_of(text)
    for phrase in ("From here.", "Something odd.", "Something plain.", "what is really forbidden"):
        assert phrase in words
    ids = [each.get("id") for each in tree.iter() if each.get("id")]
    assert len(ids) == len(set(ids))
    labelled = [each.get("aria-labelledby") for each in tree.iter() if each.get("aria-labelledby")]
    assert set(labelled) <= set(ids)
    assert len(list(tree.iter("h1"))) == 1


def test_names_are_text_wherever_they_stand() -> None:
    space = StateSpace(CIRCLE.bounds, CIRCLE.periodic, (EVIL, "b"), ("<i>", "m"))
    named = Regions(space, REGIONS.lower, REGIONS.upper, tuple(f"{EVIL}{i}" for i in range(20)))
    answer, paths = answer_of(named, [EVIL, f"{EVIL}2"])
    text = page(answer, paths, title=EVIL, about=EVIL, doubtful=[EVIL], assumed=[EVIL])
    tree = tree_of(text)
    assert len(list(tree.iter("script"))) == 2
    assert not list(tree.iter("b")) + list(tree.iter("i"))
    assert data_of(text)["names"] == [EVIL, f"{EVIL}2"]
    assert next(tree.iter("h1")).text.startswith("</script>")


def test_nothing_is_fetched_and_only_the_page_s_own_code_may_run() -> None:
    text = page(*answer_of(REGIONS, ["a", "b"]), title="A page")
    tree = tree_of(text)
    assert not [
        each.attrib
        for each in tree.iter()
        if {"src", "href", "xlink:href"} & set(each.attrib)
        and not str(each.get("href")).startswith("#")
    ]
    assert not re.search(r"@import|url\((?!#)", text)
    assert re.findall(r"https?://[^\"' ]*", text) == ["http://www.w3.org/2000/svg"]
    assert not [each for each in tree.iter() if {"style", "onclick"} & set(each.attrib)]
    (policy,) = (m.get("content") for m in tree.iter("meta") if m.get("http-equiv"))
    assert policy.startswith("default-src 'none'; ")
    style = next(tree.iter("style")).text
    script = next(each.text for each in tree.iter("script") if not each.get("type"))
    for part in (style, script):
        digest = base64.b64encode(hashlib.sha256(part.encode()).digest()).decode()
        assert f"'sha256-{digest}'" in policy


def test_as_many_as_the_paper_has_stay_under_a_megabyte() -> None:
    regions = Regions.from_grid(CIRCLE, (10, 10))
    answer, paths = answer_of(regions, [f"demonstration_{j}" for j in range(65)])
    assert len(page(answer, paths, title="Large").encode()) < 1_000_000


def test_regions_of_many_dimensions_lie_on_one_another() -> None:
    space = StateSpace(Box([0] * 3, [1] * 3), [False] * 3, ("a", "b", "c"))
    regions = Regions.from_grid(space, (2, 3, 4))
    text = page(*answer_of(regions, ["a", "b"]), title="Three")
    assert len(list(tree_of(text).iter("option"))) == 3
    for plane, count in zip(planes(regions), (6, 8, 12), strict=True):
        here = places(Frame(plane), regions)
        assert len(here) == count
        assert sorted(i for numbers in here.values() for i in numbers) == list(range(24))


def test_a_state_of_one_dimension_is_a_band() -> None:
    space = StateSpace(Box([0.0], [1.0]), [False], ("depth",), ("m",))
    text = page(*answer_of(Regions.from_grid(space, (5,)), ["a", "b"]), title="One")
    assert "depth [m]" in text_of(text)


def test_how_sure_it_is_comes_first() -> None:
    answer, paths = answer_of(REGIONS, ["a", "b", "c"])
    first = REGIONS.names[answer.support.region]
    unsure = text_of(page(answer, paths, title="A page"))
    assert "It is not clear that anything is avoided." in unsure
    assert answer.inference.posterior_none > answer.inference.posterior[answer.support.region]
    sure = replace(answer, inference=replace(answer.inference, prior_none=0.01))
    assert f"Region {first} is the most likely to be avoided" in text_of(
        page(sure, paths, title="A page")
    )
    nothing = replace(
        answer, inference=replace(answer.inference, avoidance=np.ones((3, len(REGIONS))))
    )
    assert "No region stands out" in text_of(page(nothing, paths, title="A page"))


def test_a_calibration_is_told_and_shown() -> None:
    answer, paths = answer_of(REGIONS, ["a", "b", "c"])
    curve = ForecastCurve((0.04, 0.06), 180, 2000, 0.1, 0.9, 0.8, 0.9)
    inference = replace(answer.inference, calibration=ForecastMap((curve,)))
    text = page(replace(answer, inference=inference), paths, title="A page")
    assert "for regions of 4 % to 6 % of all states" in text_of(text).replace("For", "for")
    assert "at most 2.30 nat" in text_of(text)
    data = data_of(text)
    assert data["forecast"][2][3] == pytest.approx(1000 * (1 - inference.forecast[2, 3]), abs=0.51)
