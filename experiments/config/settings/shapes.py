"""Regions of a config: boxes, balls, half-spaces, and shapes of one's own."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import Annotated, Any

import numpy as np
from pydantic import BeforeValidator
from pydantic.dataclasses import dataclass

from experiments.config.settings.kinds import STRICT, Number, Positive, Word, about
from experiments.config.settings.targets import FunctionSettings, read_function
from mlci.shapes.balls import Ball
from mlci.shapes.half_spaces import HalfSpace
from mlci.shapes.shape import Shape
from mlci.spaces import Box


@dataclass(frozen=True, config=STRICT)
class Region:
    """A box of states; None leaves that dimension free, at both ends."""

    lower: Annotated[
        tuple[Number | None, ...],
        about("lower ends, one a dimension; null leaves a dimension free", "of the state"),
    ]
    upper: Annotated[tuple[Number | None, ...], about("upper ends", "of the state")]

    def box(self) -> Box:
        """The region with infinite sides where a dimension is free."""
        return Box(
            np.array([-np.inf if side is None else side for side in self.lower]),
            np.array([np.inf if side is None else side for side in self.upper]),
        )


@dataclass(frozen=True, config=STRICT)
class BallSettings:
    """A ball, or an ellipsoid along the axes; a radius of None leaves that dimension free."""

    center: Annotated[
        tuple[Number | None, ...],
        about("centre, one a dimension; null where the dimension is free", "of the state"),
    ]
    radii: Annotated[tuple[Positive | None, ...], about("semi-axes", "of the state")]

    def ball(self) -> Ball:
        """The ball with infinite radii where a dimension is free."""
        return Ball(
            [0.0 if middle is None else middle for middle in self.center],
            [np.inf if radius is None else radius for radius in self.radii],
        )


@dataclass(frozen=True, config=STRICT)
class HalfSpaceSettings:
    """States with normal . x > offset."""

    normal: Annotated[
        tuple[Number, ...], about("one a dimension, 0 where it does not count; points into it")
    ]
    offset: Annotated[Number, about("normal . x is greater inside", "of normal . x")]

    def half_space(self) -> HalfSpace:
        """The half-space."""
        return HalfSpace(self.normal, self.offset)


@dataclass(frozen=True, config=STRICT)
class ShapeSettings(FunctionSettings):
    """A shape of one's own: what a function or class makes of its arguments."""

    target: Annotated[Word, about("dotted name of what returns a mlci.shapes.shape.Shape")]

    def shape(self) -> Shape:
        """The shape itself."""
        made: Shape = self.made()
        return made


def read_shape(tree: Any) -> ShapeSettings:
    """A shape from `_target_` and the arguments beside it; errors as of `read_function`."""
    return read_function(
        ShapeSettings,
        tree,
        "a function that returns a region, such as your_module.ring",
        Shape,
        "a region of mlci, such as a Ball, a Predicate or a union of them",
    )


@dataclass(frozen=True, config=STRICT)
class ShapeList:
    """Regions of several kinds."""

    boxes: Annotated[
        tuple[Region, ...],
        about("regions that are boxes, null for a free dimension", "of the state"),
    ]
    balls: Annotated[
        tuple[BallSettings, ...],
        about("regions that are balls or ellipsoids, a null radius for a free dimension"),
    ]
    half_spaces: Annotated[tuple[HalfSpaceSettings, ...], about("regions with normal . x > offset")]
    shapes: Annotated[
        tuple[Annotated[ShapeSettings, BeforeValidator(read_shape)], ...],
        about(
            "regions of your own: `_target_` names a function that returns one and takes the other "
            "keys"
        ),
    ]

    @property
    def count(self) -> int:
        """How many are listed."""
        return sum(len(kind) for kind in (self.boxes, *self.others))

    @property
    def others(self) -> tuple[tuple[Any, ...], ...]:
        """The regions that are no boxes, by kind."""
        return self.balls, self.half_spaces, self.shapes

    def makers(self) -> Iterator[tuple[str, Callable[[], Shape | Box]]]:
        """The key of each, such as `balls[0]`, and what makes it."""
        makers: dict[str, list[Callable[[], Shape | Box]]] = {
            "boxes": [region.box for region in self.boxes],
            "balls": [ball.ball for ball in self.balls],
            "half_spaces": [half.half_space for half in self.half_spaces],
            "shapes": [own.shape for own in self.shapes],
        }
        for kind, of_kind in makers.items():
            for number, make in enumerate(of_kind):
                yield f"{kind}[{number}]", make

    def listed(self) -> list[Shape | Box]:
        """All of them, in the order in which tables number them."""
        return [make() for _, make in self.makers()]
