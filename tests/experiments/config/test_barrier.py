"""What a barrier cannot keep out of, and truths that are drawn, in the words of a config."""

from __future__ import annotations

import pytest
from tiny_point import composed

from experiments.config.problems import ConfigError
from experiments.config.read import read_config

ARM = ("truth=reach", "model=sampled", "transition.samples=1", "safety.method=barrier")
HAND = (
    "truth=none",
    "truth.name=ball",
    "truth.balls=[{center: [0.5, 1.0, 0.0, 0.0], radii: [0.5, 0.7, null, null]}]",
)


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (
            ("safety.method=barrier",),
            "safety.method: barrier, but a barrier brakes the joints of a PlanarChain, and "
            "Pendulum is none; take escapes, or equation",
        ),
        ((*ARM, *HAND, "system=arm2"), "a barrier keeps out of boxes of joint angles at any rates"),
        (
            (*ARM, "demonstrations.clip=true"),
            "safety.method: barrier, but it brakes with any torque, and demonstrations.clip or",
        ),
        ((*ARM, "safety.width=0.1"), "safety.width: 0.1, but a barrier has no blend; set it to 0"),
        ((*ARM, "safety.braking=0"), "safety.braking: 0.0 must be above 0"),
        (
            (*ARM, "hypotheses.grids=[[2,2]]"),
            "hypotheses.grids[0]: [2, 2] must have 4 entries, one each for shoulder, elbow",
        ),
        (("truth=cell", "truth.cell=any"), "truth.cell: 'any' is not a whole number"),
        (("truth=drawn", "safety.method=barrier"), "Pendulum is none"),
    ],
)
def test_what_a_barrier_cannot_do_is_refused(words: tuple[str, ...], message: str) -> None:
    with pytest.raises(ConfigError) as error:
        read_config(composed(*words))
    assert message in str(error.value)


def test_a_drawn_truth_is_known_only_when_the_point_runs() -> None:
    settings = read_config(composed("truth=drawn"))[0]
    assert settings.columns["truth"] == "drawn"
    with pytest.raises(ValueError, match="the truth is drawn when the point runs"):
        _ = settings.constraint
