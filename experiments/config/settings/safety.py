"""How simulated demonstrators keep out of the truth."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic.dataclasses import dataclass

from experiments.config.settings.cells import Shape
from experiments.config.settings.kinds import STRICT, NotNegative, Positive, about
from mlci.mechanics.planar_chain import PlanarChain
from mlci.regions import Regions
from mlci.safety.joint_barrier import JointBarrier
from mlci.systems import System

BARRIER, ESCAPES = "barrier", "escapes"  # the methods; the third solves the equation (9)


@dataclass(frozen=True, config=STRICT)
class SafetySettings:
    """How the safe set is computed, and how the safety filter uses it."""

    method: Annotated[
        Literal["equation", "escapes", "barrier"],
        about(
            "`equation` solves (9); `escapes` takes the best constant control, on coarse grids; "
            "`barrier` brakes a joint in time, without a grid: for chains of links and truths that "
            "are boxes of joints, where torques have no limit"
        ),
    ]
    shape: Annotated[
        Shape, about("cells of the grid that the safe set is computed on; `barrier` has none")
    ]
    margin: Annotated[
        NotNegative | None,
        about(
            "V below which the safe control acts; null derives it from dt and this grid, and is "
            "0.02 rad of a barrier",
            "of the state",
        ),
    ]
    width: Annotated[
        NotNegative,
        about("width of the blend above the margin; 0 switches at once", "of the state"),
    ]
    braking: Annotated[
        Positive,
        about("deceleration that a barrier trusts each joint to", "rad/s^2"),
    ]

    def barrier(self, system: System, truth: Regions, dt: float) -> JointBarrier:
        """The barrier that keeps a chain out of a truth.

        Args:
            system: the chain.
            truth: boxes of its joints.
            dt: hold time of the controls [s].

        Raises:
            ValueError: the system is no chain, or the truth is nothing that a barrier knows.
        """
        if not isinstance(system, PlanarChain):
            raise ValueError(
                f"a barrier brakes the joints of a PlanarChain, and {type(system).__name__} is none"
            )
        margin = JointBarrier.margin if self.margin is None else self.margin
        return JointBarrier(system, truth, dt, (self.braking,) * system.links, margin)
