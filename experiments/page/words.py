"""Sentences of the page, for somebody who never saw the method: how likely, of 100, with units."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from experiments.console import NEXT_ASSUMED, bounds, sampled_words, task_words
from experiments.terminal import words
from mlci.answers import Answer
from mlci.misfit import listed
from mlci.regions import Regions
from mlci.spaces import Ints, middle_and_half

_AREAS, _CARRIERS = 3, 4  # that are named


def of_100(probability: float) -> str:
    """A probability as a count of 100 cases, never rounded to none or all of them."""
    if probability in (0, 1):
        return f"{100 * probability:g} of 100"
    if probability < 0.0005:
        return "under 0.1 of 100"
    return "over 99.9 of 100" if probability >= 0.9995 else f"{100 * probability:.1f} of 100"


def where(regions: Regions, number: int) -> str:
    """The bounds of a region with their units; of another shape those that it lies within."""
    within = "" if regions.are_boxes[number] else "within "
    return f"{within}{bounds(regions.box(number), regions.space)}"


def answer_sentences(answer: Answer) -> list[str]:
    """What was inferred and how sure it is; the first sentence is the headline."""
    inference, first = answer.inference, answer.support.region
    regions, none = inference.hypotheses, of_100(inference.posterior_none)
    name, chance = regions.names[first], inference.posterior[first]
    if not inference.gain[first] > 0:
        return [
            "No region stands out: none is more likely to be avoided than that nothing is.",
            f"How likely it is that nothing is avoided: {none}.",
            *_sampled_sentences(answer),
        ]
    if chance >= inference.posterior_none:
        sentences = [
            f"Region {name} is the most likely to be avoided: {where(regions, first)}.",
            f"How likely: {of_100(chance)}. That nothing is avoided: {none}.",
        ]
    else:
        sentences = [
            "It is not clear that anything is avoided.",
            f"How likely it is that nothing is: {none}. Of the regions, {name} comes first, with "
            f"{of_100(chance)}: {where(regions, first)}.",
        ]
    credible = inference.credible
    held = str(credible).replace("no constraint", "that nothing is avoided")
    sentences.append(
        f"The fewest answers that together have at least {100 * credible.share:g} of 100: {held}."
    )
    for area in credible.areas[:_AREAS]:
        several = len(area.regions) > 1
        members = listed([regions.names[i] for i in area.regions])
        sentences.append(
            f"{of_100(area.probability)} for {'regions' if several else 'region'} {members}, "
            f"{'within ' * several}{bounds(area.hull, regions.space)}."
        )
    if len(credible.areas) > _AREAS:
        sentences.append(f"And {len(credible.areas) - _AREAS} more areas; see the table.")
    if answer.ties is not None and len(answer.ties.others):
        told = answer.ties.summary(regions.names)
        sentences.append(f"{told[0].upper()}{told[1:]}.")
    return [*sentences, *_sampled_sentences(answer), *_support_sentences(answer)]


def _sampled_sentences(answer: Answer) -> list[str]:
    """How surely ranks are known, where chances are sampled."""
    if answer.rank_errors is None:
        return []
    return [f"Chances are counted from sampled paths: {sampled_words(answer)}."]


def _support_sentences(answer: Answer) -> list[str]:
    """Which demonstrations the first region owes its place to."""
    support, inference = answer.support, answer.inference
    names, regions = inference.names, inference.hypotheses.names
    carriers, sentences = support.carriers(), []
    if len(carriers):
        shares = [f"{names[j]} ({100 * support.share[j]:.0f} of 100)" for j in carriers]
        verb = "brings" if len(carriers) == 1 else "bring"
        sentences.append(
            f"{len(carriers)} of {len(names)} demonstrations {verb} half of what speaks for it: "
            f"{listed(shares, _CARRIERS)}."
        )
    if len(names) < 2:
        sentences.append("It rests on one demonstration alone.")
    elif support.stays.all():
        sentences.append("It stays first whichever single demonstration is left out.")
    else:
        others = [
            f"{regions[support.first_without[j]]} without {names[j]}"
            for j in np.flatnonzero(~support.stays)
        ]
        sentences.append(f"Another comes first without one: {listed(others, _CARRIERS)}.")
    return sentences


def next_sentences(answer: Answer) -> list[str]:
    """What to record next, as far as these demonstrations tell."""
    regions, unseen = answer.inference.hypotheses, answer.unseen
    if not len(unseen):
        return [
            "Each region lies on the way of some task that was recorded, so that keeping out of it "
            "says something. More demonstrations of such tasks make the answer surer.",
            *_task_sentences(answer),
        ]
    return [
        f"{len(unseen)} of {len(regions)} regions lie on the way of no task that was recorded "
        "(dotted on the map). That nobody enters them says nothing, so that they are neither "
        "likely nor ruled out.",
        "Record tasks whose easiest way leads through them. The nearest to the likeliest region: "
        f"{_places(regions, _by_distance(regions, unseen, answer.support.region))}.",
        *_task_sentences(answer),
    ]


def _task_sentences(answer: Answer) -> list[str]:
    """The tasks that promise most, and what that takes for granted."""
    if not answer.next_tasks:
        return []
    space = answer.inference.hypotheses.space
    return [
        "Of the tasks that could come next, these are expected to teach most about which region "
        "is avoided. Of 100 demonstrations so many would move a tenth of the probability or more:",
        *(
            f"Task {each.name}, {task_words(each.task, space)}: {of_100(each.chance)} "
            f"(expected information {each.information:.3f} nat)."
            for each in answer.next_tasks
        ),
        f"That holds {NEXT_ASSUMED.partition(';')[0]}.",
    ]


def _by_distance(regions: Regions, numbers: Ints, origin: int) -> Ints:
    """Some regions, the nearest to a region first, in shares of the bounds."""
    middle = np.array([middle_and_half(regions.box(i))[0] for i in range(len(regions))])
    away = regions.space.difference(middle[numbers], middle[origin]) / regions.space.bounds.widths
    return numbers[np.argsort(np.hypot.reduce(away, axis=1).round(9), kind="stable")]


def _places(regions: Regions, numbers: Ints, most: int = 6) -> str:
    """Some regions with their bounds."""
    named = [f"region {regions.names[i]} ({where(regions, i)})" for i in numbers]
    more = f"; and {len(named) - most} more" if len(named) > most else ""
    return "; ".join(named[:most]) + more


def dimension_title(name: str, unit: str) -> str:
    """The name of a dimension with its unit."""
    return f"{words(name)} [{unit}]" if unit else words(name)


def sentence(phrase: str) -> str:
    """A phrase with a capital and a full stop."""
    return phrase[:1].upper() + phrase[1:].rstrip(".") + "."


def sentences_of(phrases: Sequence[str]) -> list[str]:
    """Phrases as sentences."""
    return [sentence(phrase) for phrase in phrases]
