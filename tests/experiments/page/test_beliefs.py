"""What the page says of sets of regions and of controls, by beliefs whose numbers are known."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from page_answers import CIRCLE, answer_of

from experiments.belief_lines import Beliefs, belief_lines
from experiments.page.beliefs import belief_sentences
from experiments.page.document import page
from mlci.actuation.inference import ControlInference
from mlci.actuation.ranges import ControlRanges
from mlci.areas.belief import AreaBelief
from mlci.evidence import Rates
from mlci.grids import Grid
from mlci.regions import Regions
from mlci.sets.chains import ChainCheck
from mlci.sets.posterior import SetPosterior

NAMES = ("a", "b", "c")
MEMBERS = np.array([[0, 0, 0], [1, 0, 0], [1, 0, 1]], dtype=bool)
RANGES = ControlRanges([[1.0], [2.0]], [[np.inf], [np.inf]])


def sets(probability: list[float], check: ChainCheck | None = None) -> SetPosterior:
    order = np.argsort(probability)[::-1]
    shares = np.array(probability)[order]
    return SetPosterior(MEMBERS[order], shares, np.zeros(3), np.log(shares), check)


def controls(avoidance: list[float], applied: list[bool]) -> ControlInference:
    """Of one demonstration, with a prior of a half that nothing is forbidden."""
    shares = np.array([0.4, 0.2])
    rows = np.array([avoidance]), np.array([applied])
    return ControlInference(RANGES, ("x",), *rows, shares, 0.5, Rates(0.0))


def test_sets_are_told_as_their_most_probable_one_and_their_regions() -> None:
    none, one, two = (
        belief_sentences(Beliefs(NAMES, sets(each), None, None))
        for each in ([0.5, 0.3, 0.2], [0.2, 0.5, 0.3], [0.2, 0.3, 0.5])
    )
    assert none[0].endswith("the likeliest answer is that nothing is avoided: 50.0 of 100.")
    assert one[0].endswith("the likeliest answer is region a alone: 50.0 of 100.")
    assert two[0].endswith("the likeliest answer is regions a, c together: 50.0 of 100.")
    assert one[1].endswith("region a: 80.0 of 100; region c: 30.0 of 100; region b: 0 of 100.")
    assert len(one) == 2
    assert belief_sentences(Beliefs(NAMES)) == []


def test_sampled_sets_say_whether_their_chains_agree() -> None:
    for r_hat, word in ((1.0, "which agree"), (3.0, "which DISAGREE")):
        check = ChainCheck(np.full(4, r_hat), np.full(4, 1000.0), np.full(4, 0.01), 0.5)
        found = sets([0.5, 0.3, 0.2], check)
        assert word in belief_sentences(Beliefs(NAMES, found, None, None))[-1]


def test_controls_are_told_with_what_is_assumed() -> None:
    # Likelihoods 5 and 1.25 at a prior of 0.25 each, against 1 at 0.5.
    likely = belief_sentences(Beliefs(NAMES, None, controls([0.2, 0.8], [False, False]), None))
    assert likely[0] == (
        "Controls that are not applied, the likeliest first: control 1 above 1: 60.6 of 100; "
        "control 1 above 2: 15.2 of 100. That all are in use: 24.2 of 100."
    )
    assert "at most one range is forbidden, and no region" in likely[1]
    applied = belief_sentences(Beliefs(NAMES, None, controls([0.2, 0.8], [True, True]), None))
    assert applied[0].startswith("Controls: no range stands out")
    assert applied[0].endswith("How likely that is: 100 of 100.")


def test_an_area_is_told_by_its_parts_and_by_how_far_it_can_be_trusted() -> None:
    raster = Grid(CIRCLE, (4, 4))
    area = np.arange(16) == 5
    sizes, chance = np.array([0.25, 0.25, 0.5]), np.where(area, 0.6, 0.1)
    belief = AreaBelief(raster, sizes, chance, area, 0.4, (0,), 0.3, 900)
    none, part, overlap = belief_sentences(Beliefs(NAMES, area=belief))
    assert none.endswith("nothing is avoided, 25.0 of 100.")
    assert part.endswith("avoided somewhere there: at least 60.0 of 100.")
    assert overlap.endswith("are expected to share 0.40 of all that is in either.")
    nowhere = replace(belief, area=np.zeros(16, bool), overlap=np.nan)
    (entered,) = belief_sentences(Beliefs(NAMES, area=nowhere))
    assert "demonstrations enter each of the 900 shapes" in entered
    assert "warning" not in " ".join(belief_lines(Beliefs(NAMES, area=belief), 5))
    text = " ".join(" ".join(belief_lines(Beliefs(NAMES, area=nowhere), 5)).split())
    assert "each of the 900 shapes that were drawn" in text
    assert "nan" not in text
    few = Beliefs(NAMES, area=replace(belief, drawn=10))
    assert "10 shapes were drawn, too few to tell an area" in belief_sentences(few)[-1]
    assert "10 shapes were drawn, too few" in " ".join(" ".join(belief_lines(few, 5)).split())


def test_beliefs_stand_below_the_answer_and_are_text() -> None:
    answer, paths = answer_of(Regions.from_grid(CIRCLE, (2, 2)), ["a", "b"])
    text = page(answer, paths, title="A page", beliefs=["More <b>likely</b> things."])
    inferred, _ = text.split('<section id="map"')[0], text
    assert "<p>More &lt;b&gt;likely&lt;/b&gt; things.</p>" in inferred
