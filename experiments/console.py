"""What a person reads on the terminal: a line or a small table for each part of a result."""

from __future__ import annotations

from collections.abc import Container, Iterator, Mapping, Sequence

import numpy as np
import pandas as pd

from experiments.terminal import WIDTH, entry, table_lines, words
from mlci.answers import Answer
from mlci.demonstrations import Task
from mlci.diagnosis import Diagnosis
from mlci.inference import Inference
from mlci.misfit import listed
from mlci.recordings.plausibility import Plausibility
from mlci.spaces import Box, StateSpace

_AREAS, _CARRIERS = 3, 4  # that are printed
NEXT_ASSUMED = (
    "as far as at most one region is forbidden, and people move like the tabular model; to tell "
    "something is to move a tenth of the probability"
)


def trial_lines(counts: Mapping[str, int]) -> list[str]:
    """How many demonstrations were kept, and why the others were not."""
    rejected = ", ".join(f"{n} {words(kind)}" for kind, n in counts.items() if kind != "kept")
    kept = f"{counts['kept']} of {sum(counts.values())} kept"
    return entry("demonstrations", f"{kept} ({rejected})")


def diagnosis_lines(
    diagnosis: Diagnosis, names: Sequence[str], unreachable: int, tasks: int
) -> Iterator[str]:
    """How the discretisation moves, and a warning for each thing that is wrong with it."""
    frozen = ", ".join(
        f"{words(name)} {share:.0%}" for share, name in zip(diagnosis.frozen, names, strict=True)
    )
    yield from entry(
        "discretisation",
        f"{diagnosis.stay:.0%} of moves stay in their cell, {diagnosis.leave:.0%} leave the state "
        f"space, {diagnosis.cells_crossed:.1f} cells crossed in a step; cells that no action "
        f"changes: {frozen}; {unreachable} of {tasks} goals cannot be reached",
    )
    if diagnosis.noise:
        yield from entry(
            "",
            f"control noise var(u) dt {noise_words(diagnosis)}, as limits and steps of actions let "
            "it be at this time step",
        )
    for concern in diagnosis.concerns(names, unreachable, tasks):
        yield from entry("warning", concern)


def noise_words(diagnosis: Diagnosis) -> str:
    """The tabular agent's control noise, and what it would be without limits, a pair a control."""
    pairs = zip(diagnosis.noise, diagnosis.free_noise, strict=True)
    return ", ".join(f"{noise:.3g} of {free:.3g}" for noise, free in pairs)


def doubt_lines(checks: Sequence[Plausibility]) -> list[str]:
    """A paragraph for each recording that is doubtful, and how many are not."""
    doubtful = [check for check in checks if check.doubts]
    lines = [line for check in doubtful for line in entry("doubtful", str(check), hang=2)]
    good = len(checks) - len(doubtful)
    return lines + entry("recordings", f"{good} of {len(checks)} are plausible")


def answer_lines(answer: Answer, top: int, truth: Container[int] = frozenset()) -> Iterator[str]:
    """The answer first, then what it assumes, what it rests on, and what is doubtful.

    Args:
        answer: the answer.
        top: hypotheses that are printed.
        truth: numbers of the hypotheses that the truth covers, as far as it is known.
    """
    inference, credible = answer.inference, answer.inference.credible
    names, space = inference.hypotheses.names, inference.hypotheses.space
    yield from entry("answer", _first_words(answer))
    yield from _ranking_lines(inference, top, truth)
    colon = ":" if credible.areas else ""
    yield from entry(f"{100 * credible.share:g} % credible", f"{credible}{colon}")
    for area in credible.areas[:_AREAS]:
        members = listed([names[i] for i in area.regions])
        yield from entry(
            "", f"{probability(area.probability)} in {members}: {bounds(area.hull, space)}", hang=2
        )
    if len(credible.areas) > _AREAS:
        yield from entry("", f"and {len(credible.areas) - _AREAS} more")
    yield from entry("assumed", "; ".join(answer.assumptions))
    if answer.rank_errors is not None:
        yield from entry("samples", sampled_words(answer))
    yield from entry("rests on", _carrier_words(answer))
    yield from entry("", _left_out_words(answer))
    if answer.ties is not None and len(answer.ties.others):
        yield from entry("ties", answer.ties.summary(names))
    for estimate in answer.weights:
        yield from entry("soft or hard?", f"region {estimate.region}, {estimate}")
    yield from _next_lines(answer)
    for warning in answer.warnings:
        yield from entry("warning", warning)


def sampled_words(answer: Answer) -> str:
    """Which ranks are settled where probabilities are sampled, and how surely these are known."""
    inference, errors = answer.inference, answer.rank_errors
    sampling = inference.sampling
    if errors is None or sampling is None:
        return "none: nothing is sampled"
    vague = np.all(sampling.unresolved(inference.avoidance), axis=0)
    words = [
        errors.summary(inference.order, inference.hypotheses.names),
        f"standard errors of Phi are {np.max(sampling.errors):.2g} at most, with "
        f"{np.min(sampling.effective):.0f} effective samples of a task or more",
    ]
    if vague.any():
        words.append(
            f"of {int(np.sum(vague))} regions the samples resolve no more than that they are "
            "hardly ever entered, or avoided"
        )
    return "; ".join(words)


def refutation_lines(inference: Inference) -> list[str]:
    """Which hypotheses each demonstration refutes, by their numbers; * where it alone does."""
    alone = np.sum(inference.violated, axis=0) == 1
    lines = entry("", "hypotheses that each refutes (* no other does):")
    for name, violated, reachable in zip(
        inference.names, inference.violated, inference.reachable, strict=True
    ):
        numbers = [f"{i}{'*' if alone[i] else ''}" for i in np.flatnonzero(violated)]
        note = [] if reachable else ["(goal unreachable: adds no gain)"]
        lines += entry("", " ".join([name, *numbers, *note]), hang=2)
    return lines


def _next_lines(answer: Answer) -> Iterator[str]:
    """What to record next, and what that takes for granted."""
    if not answer.next_tasks:
        return
    title, space = "record next", answer.inference.hypotheses.space
    for each in answer.next_tasks:
        yield from entry(
            title,
            f"task {each.name}: {task_words(each.task, space)}: {each.information:.3f} nat "
            f"expected, tells something with probability {probability(each.chance)}",
            hang=2,
        )
        title = ""
    yield from entry("", NEXT_ASSUMED)


def _first_words(answer: Answer) -> str:
    """Which region comes first, and how it compares with there being none."""
    inference, first = answer.inference, answer.support.region
    name, none = inference.hypotheses.names[first], probability(inference.posterior_none)
    chance = probability(inference.posterior[first])
    if not inference.gain[first] > 0:
        return f"no region is more likely than none, whose probability is {none}"
    return f"region {name} is the most likely, with probability {chance}; no constraint {none}"


def _ranking_lines(inference: Inference, top: int, truth: Container[int]) -> Iterator[str]:
    """The first hypotheses, in columns, or with their bounds below them if these are too many."""
    hypotheses, space = inference.hypotheses, inference.hypotheses.space
    first = [i for i in inference.order[:top].tolist() if inference.gain[i] > -np.inf]
    bounded = np.flatnonzero(np.any(np.isfinite(hypotheses.lower), axis=0)).tolist()
    gains = [gain_words(inference.gain[i]) for i in first]
    width = max(map(len, ["gain", *gains]))
    facts = [["region", "gain".rjust(width), "posterior"], ["", "[nat]".rjust(width), ""]]
    for i, gain in zip(first, gains, strict=True):
        chance = probability(inference.posterior[i]).rjust(9)
        facts.append([hypotheses.names[i], gain.rjust(width), chance])
    sides = [[words(space.names[d]) for d in bounded], [f"[{space.units[d]}]" for d in bounded]]
    sides += [[_side(hypotheses.box(i), d) for d in bounded] for i in first]
    marks = [[""], [""], *(["(truth)" if i in truth else ""] for i in first)]
    lines = list(
        table_lines(
            [[*fact, *side, *mark] for fact, side, mark in zip(facts, sides, marks, strict=True)]
        )
    )
    shaped = [hypotheses.names[i] for i in first if not hypotheses.are_boxes[i]]
    note = entry("", f"no boxes, but shapes within the bounds above: {listed(shaped)}")
    if max(map(len, lines)) + 2 <= WIDTH:
        yield from (f"  {line}" for line in lines)
        yield from note if shaped else ()
        return
    few = [fact + mark for fact, mark in zip(facts, marks, strict=True)]
    for i, line in zip([None, None, *first], table_lines(few), strict=True):
        yield f"  {line}"
        if i is not None:
            yield from entry("", bounds(hypotheses.box(i), space))
    yield from note if shaped else ()


def _carrier_words(answer: Answer) -> str:
    """Which demonstrations carry the first region's gain."""
    support, inference = answer.support, answer.inference
    name, carriers = inference.hypotheses.names[support.region], support.carriers()
    if not len(carriers):
        return f"nothing: no demonstration speaks for {name}"
    shares = [f"{inference.names[j]} {support.share[j]:.0%}".replace("%", " %") for j in carriers]
    return (
        f"{len(carriers)} of {len(support.share)} demonstrations, which bring half of the gain of "
        f"{name}: {listed(shares, _CARRIERS)}"
    )


def _left_out_words(answer: Answer) -> str:
    """Which region comes first when each demonstration is left out."""
    support, inference = answer.support, answer.inference
    name = inference.hypotheses.names[support.region]
    if len(support.stays) < 2:
        return "one demonstration alone, which cannot be left out"
    if support.stays.all():
        return f"{name} stays first whichever demonstration is left out"
    others = [
        f"{inference.hypotheses.names[support.first_without[j]]} without {inference.names[j]}"
        for j in np.flatnonzero(~support.stays)
    ]
    return (
        f"{name} stays first when any but {len(others)} of {len(support.stays)} demonstrations is "
        f"left out; what comes first then: {listed(others, _CARRIERS)}"
    )


def probability(value: float) -> str:
    """A probability, never rounded to 0 or 1."""
    if value in (0, 1):
        return f"{value:g}"
    if value < 0.0005:
        return "<0.001"
    return ">0.999" if value >= 0.9995 else f"{value:.3f}"


def gain_words(gain: float) -> str:
    """A gain; a word where it is infinite."""
    return "unavoidable" if gain == np.inf else f"{gain:.3f}"


def task_words(task: Task, space: StateSpace) -> str:
    """Start, goal and duration of a task, with units."""
    start, goal = bounds(Box.point(task.start), space), bounds(task.goal, space)
    return f"from {start} to {goal} in {task.horizon:.4g} s"


def bounds(box: Box, space: StateSpace) -> str:
    """Where a box is, in words."""
    sides = [
        f"{words(name)} {_side(box, d)} {unit}".rstrip()
        for d, (name, unit) in enumerate(zip(space.names, space.units, strict=True))
        if np.isfinite(box.lower[d])
    ]
    return ", ".join(sides) or "everywhere"


def _side(box: Box, d: int) -> str:
    """The ends of a box in a dimension."""
    if not np.isfinite(box.lower[d]):
        return "any"
    low, high = f"{box.lower[d]:.4g}", f"{box.upper[d]:.4g}"
    return low if box.lower[d] == box.upper[d] else f"{low} to {high}"


def measure_lines(summary: pd.Series, ranks: pd.DataFrame, top: int) -> Iterator[str]:
    """The study's three measures."""
    measured = (
        f"final-state error {summary['final_state_error']:.3f}; violation distance "
        f"{summary['violation_distance']:.2f} each (floor {summary['violation_floor']:.2f}), "
        f"{summary['violation_distance_pooled']:.2f} pooled"
    )
    nothing = (
        "no final-state error nor violation distance, since rollouts=0 or the tabular agent can "
        "reach no goal under the truth"
    )
    yield from entry("measures", measured if summary["feasible"] else nothing)
    if ranks["rank"].isna().all():
        yield from entry("", "no region is forbidden, so there is no truth to rank")
        return
    sizes = ranks["demonstrations"]
    for size in sorted({1, 5, 9, sizes.max()}.intersection(sizes)):
        rows = ranks[sizes == size]
        low, median, high = rows["rank"].quantile([0.1, 0.5, 0.9])
        yield from entry(
            "",
            f"rank of the truth after {size}: median {median:g} (80 % between {low:g} and "
            f"{high:g}), top {top} in {rows[f'share_top_{top}'].mean():.0%} of random subsets",
            hang=2,
        )
