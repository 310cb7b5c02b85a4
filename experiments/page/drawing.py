"""The map as SVG: regions that can be selected, the paths over them, and axes with units."""

from __future__ import annotations

import html
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from experiments.page.words import dimension_title
from mlci.demonstrations import Demonstration
from mlci.outlines import outline
from mlci.planes import Plane, Rectangle, simplified
from mlci.regions import Regions
from mlci.spaces import Floats

WIDTH, HEIGHT = 560, 470  # of the drawing, in its own units
_LEFT, _RIGHT, _TOP, _BOTTOM = 64, 14, 12, 56
_TOLERANCE = 0.4  # how far a path's shortened line may be off, in the same units
_QUARTERS = ("0", "π/2", "π", "3π/2", "2π")


@dataclass(frozen=True)
class Frame:
    """Where the plane of a map lies on the paper.

    Attributes:
        plane: the two dimensions.
    """

    plane: Plane

    def place(self, points: Floats) -> Floats:
        """Points (P, 2) of the plane on the paper."""
        (x0, x1), (y0, y1) = self._range(self.plane.x), self._range(self.plane.y)
        x = _LEFT + (points[:, 0] - x0) / (x1 - x0) * (WIDTH - _LEFT - _RIGHT)
        y = HEIGHT - _BOTTOM - (points[:, 1] - y0) / (y1 - y0) * (HEIGHT - _TOP - _BOTTOM)
        return np.column_stack([x, y])

    def region(self, regions: Regions, number: int) -> tuple[str, float, float] | None:
        """A region as the data of one SVG path, and its middle; None if there is nothing of it."""
        rectangles = self.plane.rectangles(regions.box(number))
        shape = regions.shapes[number]
        if not rectangles or shape is None:
            return (self.outline(rectangles), *self.middle(rectangles)) if rectangles else None
        rings = [
            np.round(simplified(self.place(ring), _TOLERANCE), 1)
            for ring in outline(self.plane, shape)
        ]
        if not rings:
            return None
        lines = ("M" + "L".join(f"{x:g} {y:g}" for x, y in ring) + "Z" for ring in rings)
        return ("".join(lines), *self.middle(rectangles))

    def outline(self, rectangles: Sequence[Rectangle]) -> str:
        """Rectangles as the data of one SVG path."""
        parts = []
        for left, right, lower, upper in rectangles:
            (x0, y1), (x1, y0) = self.place(np.array([[left, lower], [right, upper]]))
            parts.append(f"M{x0:.1f} {y0:.1f}H{x1:.1f}V{y1:.1f}H{x0:.1f}Z")
        return "".join(parts)

    def middle(self, rectangles: Sequence[Rectangle]) -> tuple[float, float]:
        """The middle of the largest of some rectangles."""
        left, right, lower, upper = max(rectangles, key=lambda r: (r[1] - r[0]) * (r[3] - r[2]))
        x, y = self.place(np.array([[(left + right) / 2, (lower + upper) / 2]]))[0]
        return float(x), float(y)

    def line(self, states: Floats) -> tuple[str, Floats, Floats]:
        """A path (K+1, n) as the data of one SVG path, its first and its last point (2,)."""
        pieces = [
            np.round(simplified(self.place(piece), _TOLERANCE), 1)
            for piece in self.plane.pieces(states)
        ]
        lines = ("M" + "L".join(f"{x:g} {y:g}" for x, y in piece) for piece in pieces)
        return "".join(lines), pieces[0][0], pieces[-1][-1]

    def axes(self) -> str:
        """Border, ticks and labels."""
        space, right, floor = self.plane.space, WIDTH - _RIGHT, HEIGHT - _BOTTOM
        parts = [
            f'<path class="axis" d="M{_LEFT} {_TOP}V{floor}H{right}V{_TOP}Z"/>',
            self._text(
                (_LEFT + right) / 2, HEIGHT - 12, "axis-title", self._title(self.plane.x), "middle"
            ),
        ]
        for value, label in self._ticks(self.plane.x):
            x = self.place(np.array([[value, 0.0]]))[0, 0]
            parts.append(f'<path class="axis" d="M{x:.1f} {floor}v6"/>')
            parts.append(self._text(x, floor + 22, "tick", label, "middle"))
        if self.plane.y is None or space.dimension == 1:
            return "".join(parts)
        middle = (_TOP + floor) / 2
        parts.append(
            f'<text class="axis-title" text-anchor="middle" x="16" y="{middle:g}" '
            f'transform="rotate(-90 16 {middle:g})">{html.escape(self._title(self.plane.y))}</text>'
        )
        for value, label in self._ticks(self.plane.y):
            y = self.place(np.array([[0.0, value]]))[0, 1]
            parts.append(f'<path class="axis" d="M{_LEFT} {y:.1f}h-6"/>')
            parts.append(self._text(_LEFT - 10, y + 5, "tick", label, "end"))
        return "".join(parts)

    def _range(self, d: int | None) -> tuple[float, float]:
        """The bounds of a dimension."""
        if d is None:
            return 0.0, 1.0
        bounds = self.plane.space.bounds
        return float(bounds.lower[d]), float(bounds.upper[d])

    def _title(self, d: int) -> str:
        """The label of an axis."""
        return dimension_title(self.plane.space.names[d], self.plane.space.units[d])

    def _ticks(self, d: int) -> list[tuple[float, str]]:
        """Round values of a dimension; a whole turn in radians by its quarters."""
        lower, upper = self._range(d)
        if self.plane.space.units[d] == "rad" and lower == 0 and np.isclose(upper, 2 * np.pi):
            return [(k * upper / 4, label) for k, label in enumerate(_QUARTERS)]
        raw = (upper - lower) / 5
        power = 10.0 ** np.floor(np.log10(raw))
        step = power * min((1, 2, 5, 10), key=lambda each: abs(each - raw / power))
        first, last = np.ceil(lower / step - 1e-9), np.floor(upper / step + 1e-9)
        return [(k * step, f"{k * step:.6g}") for k in np.arange(first, last + 1)]

    @staticmethod
    def _text(x: float, y: float, kind: str, text: str, anchor: str) -> str:
        """A text, escaped."""
        return (
            f'<text class="{kind}" text-anchor="{anchor}" x="{x:.1f}" y="{y:.1f}">'
            f"{html.escape(text)}</text>"
        )


def plane_title(plane: Plane) -> str:
    """What a map shows: its two dimensions."""
    names = [dimension_title(plane.space.names[d], "") for d in (plane.x, plane.y) if d is not None]
    return " and ".join(names)


def places(frame: Frame, regions: Regions) -> dict[tuple[str, float, float], list[int]]:
    """Regions by what is drawn of them, and its middle: those of further dimensions may be one."""
    found: dict[tuple[str, float, float], list[int]] = {}
    for number in range(len(regions)):
        if drawn := frame.region(regions, number):
            found.setdefault(drawn, []).append(number)
    return found


def map_svg(
    plane: Plane,
    number: int,
    regions: Regions,
    demonstrations: Sequence[Demonstration],
    truth: Regions,
) -> str:
    """One map; the script gives regions their colours and names.

    Args:
        plane: its dimensions.
        number: of the map on the page.
        regions: the hypotheses.
        demonstrations: their paths are drawn.
        truth: what is forbidden, as far as it is known.
    """
    frame, shapes, paths = Frame(plane), [], []
    for (line, x, y), numbers in places(frame, regions).items():
        listed = " ".join(map(str, numbers))
        shapes.append(
            f'<g class="place" role="button" tabindex="-1" data-regions="{listed}" '
            f'data-x="{x:.1f}" data-y="{y:.1f}"><title>Region {listed}</title>'
            f'<path fill-rule="evenodd" d="{line}"/></g>'
        )
    for demonstration in demonstrations:
        line, first, last = frame.line(demonstration.states)
        paths.append(
            f'<g class="path"><path d="{line}"/><circle cx="{first[0]:g}" cy="{first[1]:g}" r="3"/>'
            f'<rect x="{last[0] - 3:g}" y="{last[1] - 3:g}" width="6" height="6"/></g>'
        )
    outlines = [
        f'<path class="truth" d="{drawn[0]}"/>'
        for i in range(len(truth))
        if (drawn := frame.region(truth, i))
    ]
    clip = f"clip{number}"
    return (
        f'<svg viewBox="0 0 {WIDTH} {HEIGHT}" role="group" '
        f'aria-label="Map of {html.escape(plane_title(plane))}; arrow keys move between regions, '
        f'Enter selects one"><defs><clipPath id="{clip}"><path d="M{_LEFT} {_TOP}H{WIDTH - _RIGHT}'
        f'V{HEIGHT - _BOTTOM}H{_LEFT}Z"/></clipPath></defs>'
        f'<g class="places">{"".join(shapes)}</g>'
        f'<g class="paths" aria-hidden="true" clip-path="url(#{clip})">{"".join(paths)}</g>'
        f'<g class="over" aria-hidden="true">{"".join(outlines)}<g class="ranks"></g>'
        f'<path class="ring chosen" d=""/><path class="ring focused" d=""/></g>'
        f'<g class="axes" aria-hidden="true">{frame.axes()}</g></svg>'
    )
