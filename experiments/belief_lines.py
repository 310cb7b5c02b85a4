"""What a person reads on the terminal of beliefs beside the ranking: sets, controls, areas."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from experiments.console import bounds, probability
from experiments.terminal import counted, entry, table_lines
from mlci.actuation.inference import ControlInference
from mlci.actuation.joint import KINDS, JointInference
from mlci.areas.belief import AreaBelief
from mlci.misfit import listed
from mlci.sets.posterior import SetPosterior

_AREAS, _MARGINALS = 3, 5  # that are printed
_FEW_SHAPES = 300  # below a fifth of the 1500 that studies draw
JOINT_ASSUMED = (
    "at most one region and one range are forbidden; chances as the tabular agent's, which are not "
    "calibrated"
)


@dataclass(frozen=True)
class Beliefs:
    """Beliefs beside that over single regions; each None where nobody asked."""

    names: Sequence[str] = ()  # of the hypotheses
    sets: SetPosterior | None = None
    controls: ControlInference | None = None
    joint: JointInference | None = None
    area: AreaBelief | None = None


def belief_lines(beliefs: Beliefs, top: int) -> Iterator[str]:
    """What is believed beside the ranking, of all that was asked; `top` ranges of controls."""
    yield from set_lines(beliefs.sets, beliefs.names)
    yield from control_lines(beliefs.controls, top)
    yield from joint_lines(beliefs.joint, top)
    yield from area_lines(beliefs.area)


def set_lines(sets: SetPosterior | None, names: Sequence[str]) -> Iterator[str]:
    """The most probable set, the regions that are most probably forbidden, and how sure that is."""
    if sets is None:
        return
    best, marginal = sets.most_probable(), sets.marginal
    first = np.argsort(-marginal, kind="stable")[:_MARGINALS]
    likely = ", ".join(f"{names[i]} {probability(marginal[i])}" for i in first)
    members = f"is that of {listed([names[i] for i in best])}" if best else "forbids nothing"
    yield from entry(
        "sets",
        f"the most probable set {members}, with probability "
        f"{probability(sets.probability_of(best))}; forbidden, alone or with others: {likely}",
    )
    if sets.check is not None:
        yield from entry("", str(sets.check))
        if not sets.check.agrees:
            yield from entry("warning", "chains over sets disagree: raise inference.sets.steps")


def area_lines(belief: AreaBelief | None) -> Iterator[str]:
    """The area that is expected to overlap best with what is forbidden, part by part."""
    if belief is None:
        return
    parts, space = belief.parts, belief.raster.space
    if not np.isfinite(belief.overlap):
        yield from entry("area", f"of one or two shapes: {all_entered(belief)}")
        return
    yield from entry(
        "area",
        f"of one or two shapes; expected overlap with what is forbidden, if anything is, "
        f"{belief.overlap:.2f} (intersection over union, as far as prior and model are right); "
        f"nothing is forbidden with probability {probability(float(belief.sizes[0]))}"
        f"{':' if parts else ''}",
    )
    for part in parts[:_AREAS]:
        yield from entry(
            "",
            f"{bounds(part.hull, space)}; forbidden somewhere with at least "
            f"{probability(part.probability)}",
            hang=2,
        )
    if concern := area_concern(belief):
        yield from entry("warning", concern)


def all_entered(belief: AreaBelief) -> str:
    """What is said where demonstrations exclude every shape."""
    return (
        f"none, since demonstrations enter each of the {counted(belief.drawn, 'shape')} that were "
        "drawn; draw more (inference.shapes.count) or smaller ones (inference.shapes.smallest)"
    )


def area_concern(belief: AreaBelief) -> str | None:
    """Why an area is not to be relied on; None if nothing speaks against it."""
    if belief.drawn >= _FEW_SHAPES:
        return None
    return (
        f"{counted(belief.drawn, 'shape')} were drawn, too few to tell an area: others would tell "
        "another one. Raise inference.shapes.count; 1500 are many where two dimensions are bounded"
    )


def control_lines(controls: ControlInference | None, top: int) -> Iterator[str]:
    """The first ranges of controls, and what their ranking takes for granted."""
    if controls is None:
        return
    frame, none = controls.to_frame(), probability(controls.ranking.posterior_none)
    yield from entry("controls", control_words(controls))
    first = frame[frame["gain"] > -np.inf].head(top)
    rows = [["range", "gain [nat]", "posterior", "applied by"]]
    rows += [
        [name, f"{gain:.3f}".rjust(10), probability(share).rjust(9), str(count).rjust(10)]
        for name, gain, share, count in zip(
            *(first[key] for key in ("name", "gain", "posterior", "applied_by")), strict=True
        )
    ]
    rows.append(["none", "0.000".rjust(10), none.rjust(9), ""])
    yield from (f"  {line}" for line in table_lines(rows))
    yield from entry("assumed", controls_assumed(controls))


def joint_lines(joint: JointInference | None, top: int) -> Iterator[str]:
    """The most probable pairs of a region and controls, and how probable each kind is."""
    if joint is None:
        return
    kinds = ", ".join(
        f"{kind} {probability(share)}"
        for kind, share in zip(KINDS, joint.of_kinds.tolist(), strict=True)
    )
    yield from entry("both", f"a region and controls in one belief; forbidden are: {kinds}")
    rows = [["region", "controls", "gain [nat]", "posterior"]]
    rows += [
        [row["region"], row["controls"], f"{row['gain']:.3f}", probability(row["posterior"])]
        for row in joint.to_frame().head(top).to_dict("records")
    ]
    yield from (f"  {line}" for line in table_lines(rows))
    yield from entry("assumed", JOINT_ASSUMED)


def control_words(controls: ControlInference) -> str:
    """Which range comes first, and how it compares with there being none."""
    first, ranking = controls.ranking.order[0], controls.ranking
    none = probability(ranking.posterior_none)
    if not ranking.gain[first] > 0:
        return f"no forbidden range is more likely than none, whose probability is {none}"
    name, chance = controls.hypotheses.names[first], probability(ranking.posterior[first])
    return f"that {name} is forbidden is the most likely, with probability {chance}; nothing {none}"


def controls_assumed(controls: ControlInference) -> str:
    """What a ranking of ranges of controls takes for granted."""
    people = (
        "chances as the tabular agent's"
        if controls.calibration is None
        else "chances calibrated by a simulated demonstrator whom nothing limits, so that one "
        f"demonstration brings at most {controls.calibration.largest_gain:.2f} nat for a range"
    )
    return (
        "at most one range is forbidden, and no region; controls that are not recorded come from "
        f"inverse dynamics; {people}"
    )
