"""Sentences of the page about sets of regions, controls and areas."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from experiments.belief_lines import (
    JOINT_ASSUMED,
    Beliefs,
    all_entered,
    area_concern,
    controls_assumed,
)
from experiments.console import bounds
from experiments.page.words import of_100
from mlci.actuation.inference import ControlInference
from mlci.actuation.joint import NOTHING, JointInference
from mlci.areas.belief import AreaBelief
from mlci.misfit import listed
from mlci.sets.posterior import SetPosterior

_AREAS, _NAMED = 3, 5  # parts of an area; regions, or ranges


def belief_sentences(beliefs: Beliefs) -> list[str]:
    """What is believed beside the ranking of regions, where that is asked."""
    return [
        *_set_sentences(beliefs.sets, beliefs.names),
        *_control_sentences(beliefs.controls),
        *_joint_sentences(beliefs.joint),
        *_area_sentences(beliefs.area),
    ]


def _area_sentences(belief: AreaBelief | None) -> list[str]:
    """What is believed of an area of one or two shapes; nothing where that is not asked."""
    if belief is None:
        return []
    if not np.isfinite(belief.overlap):
        return [f"An area of one or two shapes: {all_entered(belief)}."]
    none = of_100(float(belief.sizes[0]))
    sentences = [
        "If what is avoided has the form of one or two of the shapes that were asked for: that "
        f"nothing is avoided, {none}."
    ]
    space = belief.raster.space
    sentences += [
        f"The area that fits it best lies at {bounds(part.hull, space)}; avoided somewhere there: "
        f"at least {of_100(part.probability)}."
        for part in belief.parts[:_AREAS]
    ]
    if belief.parts:
        sentences.append(
            "This area and what is avoided are expected to share "
            f"{belief.overlap:.2f} of all that is in either."
        )
    if concern := area_concern(belief):
        sentences.append(f"Do not rely on this area: {concern}.")
    return sentences


def _set_sentences(sets: SetPosterior | None, names: Sequence[str]) -> list[str]:
    """What is believed of several regions at once; nothing where that is not asked."""
    if sets is None:
        return []
    best, marginal = sets.most_probable(), sets.marginal
    chance = of_100(sets.probability_of(best))
    members = [names[i] for i in best]
    if not best:
        answer = "that nothing is avoided"
    elif len(best) == 1:
        answer = f"region {members[0]} alone"
    else:
        answer = f"regions {listed(members)} together"
    likely = np.argsort(-marginal, kind="stable")[:_NAMED]
    each = "; ".join(f"region {names[i]}: {of_100(marginal[i])}" for i in likely)
    sentences = [
        f"If several regions may be avoided at once, the likeliest answer is {answer}: {chance}.",
        f"How likely it is that a region is avoided, alone or with others: {each}.",
    ]
    if sets.check is not None:
        agree = "which agree" if sets.check.agrees else "which DISAGREE: do not rely on it"
        sentences.append(f"This is estimated from a sample by several chains, {agree}.")
    return sentences


def _joint_sentences(joint: JointInference | None) -> list[str]:
    """What is believed of a region and controls at once; nothing where that is not asked."""
    if joint is None:
        return []
    nothing, region, controls, both = map(of_100, joint.of_kinds.tolist())
    first, limit = joint.most_probable
    answers = {
        (True, True): "that neither a region nor controls are avoided",
        (False, True): f"region {first} alone",
        (True, False): f"that {limit} is not applied, and no region is avoided",
        (False, False): f"region {first}, and that {limit} is not applied",
    }
    answer = answers[first == NOTHING, limit == NOTHING]
    chance = of_100(float(joint.posterior.max()))
    return [
        f"If a region and controls may be avoided at once, the likeliest answer is {answer}: "
        f"{chance}. Nothing: {nothing}; a region alone: {region}; controls alone: {controls}; "
        f"both: {both}. That takes for granted: {JOINT_ASSUMED}."
    ]


def _control_sentences(controls: ControlInference | None) -> list[str]:
    """What is believed of controls; nothing where that is not asked."""
    if controls is None:
        return []
    ranking, names = controls.ranking, controls.hypotheses.names
    none, first = of_100(ranking.posterior_none), ranking.order[0]
    if not ranking.gain[first] > 0:
        sentences = [
            "Controls: no range stands out; none is more likely to be out of use than that all are "
            f"in use. How likely that is: {none}."
        ]
    else:
        likely = [i for i in ranking.order[:_NAMED].tolist() if ranking.gain[i] > 0]
        each = "; ".join(f"{names[i]}: {of_100(ranking.posterior[i])}" for i in likely)
        sentences = [
            f"Controls that are not applied, the likeliest first: {each}. That all are in use: "
            f"{none}."
        ]
    return [*sentences, f"That takes for granted: {controls_assumed(controls)}."]
