"""Folders of results that somebody has tampered with, and what commands make of them.

A case is a random file or folder, a random edit of it, and a random command. Whatever they are, the
command ends with words and no traceback, changes nothing outside the folder of results, and tells
if what it used was not as it was written.
"""

from __future__ import annotations

import contextlib
import io
import json
import os
import random
import re
import shutil
import sys
import traceback
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from unittest import mock

import numpy as np
import pandas as pd
from figure_study import study_tables
from hand_made import hand_made

from experiments import results as results_command
from experiments.collate.finished import CollateError
from experiments.collate.join import collate
from experiments.tracking import sources
from experiments.tracking.files import csv_bytes, digest, replace_file
from experiments.tracking.points import Point
from experiments.tracking.sealed import read_sealed, write_sealed
from experiments.tracking.store import Store
from experiments.tracking.study import Collated, read_study, write_collated, write_plan
from paper_figures import __main__ as figures_command
from paper_figures import state_space
from paper_figures.report import __main__ as report_command

# One of these is in what a command says if it met something that is not as it was written.
WORDS = re.compile(
    "not as |cannot|missing|is gone|changed|does not count|is a link|no regular file|no plain name|"
    "left out|nothing is cleaned|no point|Not there yet|no such|not finished|has no table|"
    "not drawn|there is no table|is no |no study|other columns|nothing to draw|holds no results|"
    "other points|has not finished|in no study|not written|run again|no finished|Is a directory|"
    "Not a directory|File exists|shipped|unused|moved"
)


@dataclass(frozen=True)
class Ending:
    """What a command did.

    Attributes:
        status: its exit status.
        text: all that it printed.
        files: digests of what it is for: figures, report, tables.
    """

    status: int
    text: str
    files: dict[str, str]


def pristine(base: Path) -> Path:
    """A small folder of results: two studies, points, a store, figures and a report."""
    results = base / "results"
    points = [hand_made(results, _trials(seed), {"stages": {}}, seed=seed) for seed in (0, 1)]
    hand_made(results, seed=2)  # in no study
    write_plan(results / "s", [(point, [f"seed={point.config['seed']}"]) for point in points])
    collate(points, results / "s", log=lambda line: None)
    Store(results / "store").get("stage", {"a": 1}, [json], lambda: {"values": np.arange(3)})
    tables = study_tables()
    digests = {}
    for name in state_space.TABLES:
        data = csv_bytes(tables[name])
        replace_file(results / "paper" / "tables" / f"{name}.csv", data)
        digests[f"{name}.csv"] = digest(data)
    collated = read_study(results / "s").collated
    write_collated(results / "paper", _with_tables(collated, digests))
    for command in (_figures, _report):
        command(results)
    _restore_outside(base)
    return results


def _trials(seed: int) -> dict[str, pd.DataFrame]:
    errors = [0.5 + seed, 0.25]
    return {"trials": pd.DataFrame({"trial": [0, 1], "final_state_error": errors})}


def _with_tables(collated: Collated, tables: dict[str, str]) -> Collated:
    return type(collated)(**{**vars(collated), "tables": tables})


def _run(main: Callable[[], int], *words: str) -> int:
    """The exit status of a command in this process."""
    with mock.patch.object(sys, "argv", ["command", *words]):
        try:
            return main()
        except SystemExit as end:
            print(end.code, file=sys.stderr)
            return 1


def _figures(results: Path) -> int:
    return _run(figures_command.main, "--jobs", "1", "--results", str(results), "paper")


def _report(results: Path) -> int:
    return _run(report_command.main, "--results", str(results))


def _collate(results: Path) -> int:
    """As a sweep of the study's points ends."""
    points = [hand_planned(results, seed) for seed in (0, 1)]
    try:
        write_plan(results / "s", [(point, []) for point in points])
        collate(points, results / "s", log=print)
    except (CollateError, OSError) as error:
        print(error)
        return 1
    return 0


def hand_planned(results: Path, seed: int) -> Point:
    """A point of the study as its sweep plans it."""
    return Point(results, IDENTITIES[seed])


IDENTITIES: dict[int, str] = {}


def commands() -> dict[str, Callable[[Path], int]]:
    """What can be called on a folder of results, by name."""

    def look(*words: str) -> Callable[[Path], int]:
        return lambda results: _run(results_command.main, *words, "--results", str(results))

    one, two = IDENTITIES[0], IDENTITIES[1]
    calls = [
        *(("status",), ("list",), ("list", "s"), ("list", "points"), ("show", one), ("show", "s")),
        *(("diff", one, two), ("query", "seed=0"), ("export", "s")),
        *(("export", "s", "--table=trials"),),
        *(("clean",), ("clean", "--yes"), ("empty-trash",), ("status", "paper")),
    ]
    return {
        **{" ".join(words): look(*words) for words in calls},
        "figures": _figures,
        "report": _report,
        "collate": _collate,
    }


# What a command is for; others only look.
_MAKES = {"figures": "paper/figures/*", "report": "paper/REPORT*", "collate": "s/tables/*"}


def call(name: str, results: Path) -> Ending:
    """Call a command by its name; an exception is a status of -1 with its traceback."""
    out = io.StringIO()
    with contextlib.redirect_stdout(out), contextlib.redirect_stderr(out):
        try:
            status = commands()[name](results)
        except Exception:
            traceback.print_exc(file=out)
            status = -1
    made = results.glob(_MAKES[name]) if name in _MAKES else ()
    files = {
        str(path.relative_to(results)): digest(path.read_bytes())
        for path in made
        if not path.is_symlink() and path.is_file()
    }
    return Ending(status, re.sub(r"\d+\.\d MB", "", out.getvalue()), files)


def snapshot(base: Path) -> dict[str, bytes]:
    """All that is outside the folder of results."""
    paths = [path for path in base.iterdir() if path.name not in ("results", "pristine")]
    inside = [inner for path in paths for inner in [path, *path.rglob("*")]]
    return {str(path): path.read_bytes() if path.is_file() else b"" for path in inside}


def edit(path: Path, base: Path, chance: random.Random) -> str:
    """Tamper with a file or folder; returns how."""
    outside = base / "outside"
    kinds = ["cut", "flip", "json", "link", "pipe", "remove", "type", "mode", "names", "odd"]
    kind = chance.choice(kinds if path.is_file() else ["link", "remove", "type", "mode", "pipe"])
    data = path.read_bytes() if path.is_file() else b""
    if kind == "cut":
        path.write_bytes(data[: chance.randrange(len(data) + 1)])
    elif kind == "flip" and data:
        place = chance.randrange(len(data))
        flipped = bytes([data[place] ^ 1 << chance.randrange(8)])
        path.write_bytes(data[:place] + flipped + data[place + 1 :])
    elif kind == "json":
        odd = ["null", "[]", "{}", '{"points": null}', "[" * 5000, "1e999", '{"identity": 3}']
        path.write_text(chance.choice(odd))
    elif kind in _FORGED and path.suffix == ".json":
        with contextlib.suppress(ValueError, OSError):
            write_sealed(path, _FORGED[kind](read_sealed(path), chance))
    elif kind == "mode":
        path.chmod(0)
    elif kind in ("link", "remove", "type", "pipe"):
        shutil.rmtree(path) if path.is_dir() else path.unlink()
        if kind == "link":
            path.symlink_to(outside if chance.random() < 0.5 else outside / "secret.txt")
        elif kind == "pipe":
            os.mkfifo(path)
        elif kind == "type":
            path.mkdir() if data else path.write_text("a file")
    return kind


def _with_paths(tree: object, chance: random.Random) -> object:
    """The same tree with a word of it replaced by a path that leads outside."""
    words = [word for word in _words(tree) if isinstance(word, str)]
    if not words:
        return tree
    victim = chance.choice(words)
    evil = chance.choice(["../../outside/secret.txt", "/etc/hostname", "../outside", ".hidden", ""])

    def swap(part: object) -> object:
        if isinstance(part, dict):
            return {
                swap(key) if "." in key or len(key) == 32 else key: swap(value)
                for key, value in part.items()
            }
        if isinstance(part, list):
            return [swap(each) for each in part]
        return evil if part == victim else part

    return swap(tree)


def _with_oddity(tree: dict[str, object], chance: random.Random) -> dict[str, object]:
    """The same tree with a value of it replaced by one of another kind, or removed."""
    deep = json.loads("[" * 450 + "]" * 450)
    part, whole = tree, tree
    while True:
        key = chance.choice(sorted(part))
        if isinstance(part[key], dict) and part[key] and chance.random() < 0.6:
            part = part[key]
            continue
        if chance.random() < 0.2:
            del part[key]
        else:
            part[key] = chance.choice([None, 3, -1.5, "x", "", [], {}, True, [None], deep])
        return whole


_FORGED = {"names": _with_paths, "odd": _with_oddity}


def _words(tree: object) -> list[object]:
    """Every key and value of a tree."""
    if isinstance(tree, dict):
        # Keys of the form itself stay; those that name a file or a point are words.
        keys = [key for key in tree if "." in key or len(key) == 32]
        return [*keys, *(word for value in tree.values() for word in _words(value))]
    if isinstance(tree, list):
        return [word for value in tree for word in _words(value)]
    return [tree]


def check_cases(base: Path, count: int, seed: int) -> list[str]:
    """Try random cases; returns what is wrong, a text for each case."""
    sources.source_hash([])  # imports before any case
    results = pristine(base)
    listed = read_study(results / "s")
    IDENTITIES.update(enumerate(listed.points))
    shutil.copytree(results, base / "pristine")
    expected = {}
    for name in commands():
        _restore(base)
        expected[name] = call(name, results)
        assert expected[name].status == 0, (name, expected[name])
    outside = snapshot(base)
    chance, wrong = random.Random(seed), []
    for number in range(count):
        _restore(base)
        inside = sorted(results.rglob("*"))
        path = chance.choice(inside)
        kind = edit(path, base, chance)
        name = chance.choice(list(expected))
        if kind == "odd" and name == "collate":
            continue  # which is for sweeps: it trusts what has a digest
        ending = call(name, results)
        is_same = snapshot(base) == outside
        fault = _fault(ending, expected[name], is_same, is_forged=kind in _FORGED)
        if path.parent == results and kind in ("remove", "type", "pipe") and ending.status >= 0:
            fault = None  # a whole study that is not there was used by nothing
        is_alone = path.name not in listed.points  # in no study, so that nothing used it
        if kind == "remove" and path.parent.name == "points" and is_alone and ending.status >= 0:
            fault = None
        if kind == "remove" and path.name == "study.json" and ending.status >= 0:
            fault = None  # tables of somebody's own
        if path.name == "runs.json" and ending.status >= 0:
            fault = None  # times and machines, which stand as unknown
        if fault:
            where = path.relative_to(results)
            wrong.append(f"case {number}: {kind} of {where}, then {name}: {fault}\n{ending.text}")
            _restore_outside(base)
    _restore(base)
    return wrong


def _fault(
    ending: Ending, expected: Ending, outside_is_same: bool, *, is_forged: bool
) -> str | None:
    """What is wrong with how a command ended on tampered results; None if nothing is.

    A forged file has a digest of its own: what it says is used, and must lead nowhere.
    """
    if not outside_is_same:
        return "something outside the folder of results changed"
    if ending.status not in (0, 1, 2) or "Traceback" in ending.text:
        return f"a traceback, status {ending.status}"
    # A damaged figure that is drawn again was used by nothing.
    mended = "drawn: " in ending.text and ending.files == expected.files
    same = mended or (ending.text == expected.text and ending.files == expected.files)
    if not same and not is_forged and not WORDS.search(ending.text):
        return "something damaged was used without a word"
    return None


def _restore(base: Path) -> None:
    """The folder of results as it was."""
    shutil.rmtree(base / "results", ignore_errors=True)
    shutil.copytree(base / "pristine", base / "results")


def _restore_outside(base: Path) -> None:
    """What is outside as it was at the start, or after a fault."""
    for path in base.iterdir():
        if path.name not in ("results", "pristine"):
            shutil.rmtree(path) if path.is_dir() else path.unlink()
    (base / "outside").mkdir()
    (base / "outside" / "secret.txt").write_text("of somebody else")
    (base / "outside" / "secret.png").write_bytes(b"\x89PNG\r\n\x1a\nsecret")
