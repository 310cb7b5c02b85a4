"""The page: one HTML file with its style, script and data in it, that asks for nothing else."""

from __future__ import annotations

import base64
import hashlib
import html
import json
from collections.abc import Sequence
from importlib.resources import files
from string import Template
from typing import Any

import numpy as np

import mlci
from experiments.page.drawing import map_svg, plane_title
from experiments.page.numbers import page_numbers
from experiments.page.words import answer_sentences, next_sentences, sentences_of
from experiments.terminal import counted
from mlci.answers import Answer
from mlci.demonstrations import Demonstration
from mlci.planes import planes
from mlci.regions import Regions

# Colour-blind safe, from light to dark: matplotlib's YlGnBu, as the maps of the figures.
RAMP = (
    *("#ffffd9", "#edf8b1", "#c7e9b4", "#7fcdbb", "#41b6c4"),
    *("#1d91c0", "#225ea8", "#253494", "#081d58"),
)


def page(
    answer: Answer,
    demonstrations: Sequence[Demonstration],
    *,
    title: str,
    about: str = "",
    beliefs: Sequence[str] = (),
    assumed: Sequence[str] = (),
    doubtful: Sequence[str] = (),
    truth: Regions | None = None,
) -> str:
    """The page of one answer; the same bytes for the same answer.

    Args:
        answer: what was inferred.
        demonstrations: the N that it is from, in its order; their paths are drawn.
        title: of the page.
        beliefs: what else is believed, such as of sets, a sentence each below the answer.
        about: where the demonstrations come from, in a sentence or two below the title.
        assumed: what reading the demonstrations took for granted, a phrase each.
        doubtful: what makes the answer doubtful, beside its own warnings.
        truth: what is forbidden, where it is known.
    """
    regions = answer.inference.hypotheses
    known = regions.select(np.zeros(len(regions), dtype=bool)) if truth is None else truth
    style, script = (_part(name) for name in ("page.css", "page.js"))
    headline, *sentences = answer_sentences(answer)
    shown = planes(regions)
    maps = [
        f'<figure class="map" id="map{number}">'
        f"{map_svg(plane, number, regions, demonstrations, known)}</figure>"
        for number, plane in enumerate(shown)
    ]
    count, names = len(answer.inference.names), [plane_title(plane) for plane in shown]
    parts = {
        "policy": html.escape(_policy(style, script)),
        "title": html.escape(title),
        "about": f"<p>{html.escape(about)}</p>" if about else "",
        "counts": f"{counted(count, 'demonstration')}, {counted(len(regions), 'region')}",
        "headline": html.escape(headline),
        "answer": _paragraphs([*sentences, *beliefs]),
        "planes": "".join(
            f'<option value="{k}">{html.escape(name)}</option>' for k, name in enumerate(names)
        ),
        "maps": "".join(maps),
        "ramp": "".join(
            f'<stop offset="{k / (len(RAMP) - 1):g}" stop-color="{colour}"/>'
            for k, colour in enumerate(RAMP)
        ),
        "assumed": _items(sentences_of([*answer.assumptions, *_evidence(answer), *assumed])),
        "doubtful": _items(sentences_of([*answer.warnings, *doubtful]))
        or "<p>Nothing that the program can see.</p>",
        "next": _paragraphs(next_sentences(answer)),
        "truth": '<li class="only-truth"><svg viewBox="0 0 24 16"><path class="truth" '
        'd="M3 3H21V13H3Z"/></svg>what is really forbidden</li>'
        if len(known)
        else "",
        "version": html.escape(mlci.__version__),
        "style": style,
        "data": _json({**page_numbers(answer), "ramp": RAMP}),
        "script": script,
    }
    return Template(_part("page.html")).substitute(parts)


def _part(name: str) -> str:
    """A file beside this module."""
    return files(__package__).joinpath(name).read_text(encoding="utf-8")


def _policy(style: str, script: str) -> str:
    """What the page may load and run: its own style and script, and nothing else."""
    own = {
        kind: base64.b64encode(hashlib.sha256(text.encode()).digest()).decode()
        for kind, text in (("style", style), ("script", script))
    }
    return (
        f"default-src 'none'; style-src 'sha256-{own['style']}'; "
        f"script-src 'sha256-{own['script']}'; base-uri 'none'; form-action 'none'"
    )


def _json(tree: Any) -> str:
    """JSON that ends no script, whatever names hold."""
    text = json.dumps(tree, separators=(",", ":"), allow_nan=False)
    return text.replace("<", "\\u003c").replace(">", "\\u003e").replace("&", "\\u0026")


def _evidence(answer: Answer) -> list[str]:
    """How the chances behind the evidence were calibrated, a phrase a map."""
    calibration = answer.inference.calibration
    if calibration is None:
        return []
    return [
        f"for regions of {_percent(curve.sizes)} of all states, chances of entering are calibrated "
        f"by {counted(curve.tasks, 'simulated task')}, so that one demonstration brings at most "
        f"{curve.largest_gain:.2f} nat"
        for curve in calibration.curves
    ]


def _percent(sizes: tuple[float, float]) -> str:
    """Sizes of regions as shares."""
    low, high = (f"{100 * size:.2g} %" for size in sizes)
    return low if low == high else f"{low} to {high}"


def _items(sentences: Sequence[str]) -> str:
    """A list, escaped."""
    items = "".join(f"<li>{html.escape(each)}</li>" for each in sentences)
    return f"<ul>{items}</ul>" if items else ""


def _paragraphs(sentences: Sequence[str]) -> str:
    """A paragraph a sentence, escaped."""
    return "".join(f"<p>{html.escape(each)}</p>" for each in sentences)
