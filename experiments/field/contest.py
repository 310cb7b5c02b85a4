"""Every method in every world, with several seeds; what is done is not done again."""

from __future__ import annotations

import json
import time
import traceback
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any
from zlib import crc32

import numpy as np
import pandas as pd
from joblib import Parallel, delayed

from experiments.field.catalog import load
from experiments.field.entries import Case, EntryError, Method, World, check_answer
from experiments.field.scores import score
from experiments.tracking.files import json_bytes, read_file, replace_file
from mlci.rivals.set_gains import set_gains

_RUNS = ".runs"  # folder of one file for each world, method and seed


def contest(
    folder: Path,
    worlds: Sequence[str],
    methods: Sequence[str],
    seeds: Sequence[int],
    added: tuple[Path, ...] = (),
    workers: int = 1,
    demonstrations: int | None = None,
) -> pd.DataFrame:
    """A row for each world, method and seed: `world`, `method`, `seed`, the scores, `seconds`.

    A world is made once for all methods that miss a row. Rows do not depend on the number of
    workers, apart from `seconds`.

    Args:
        folder: where rows are kept.
        worlds: names of worlds.
        methods: names of methods.
        seeds: of demonstrations and methods.
        added: files with more worlds or methods.
        workers: processes.
        demonstrations: how many each world shows; None is what the world says.

    Raises:
        EntryError: a world or a method that fails, or does not give what it must; by then all that
            others do is done and kept.
    """
    catalog = load(added)  # code is read once: what changes meanwhile does not run either
    keys = {
        world: {
            method: catalog.source(catalog.worlds[world].make, catalog.methods[method].answer)
            for method in methods
        }
        for world in worlds
    }
    done = Parallel(n_jobs=workers, batch_size=1)(
        delayed(_rows)(folder, world, seed, keys[world], added, demonstrations)
        for seed in seeds
        for world in worlds
    )
    if failures := [failure for _, failures in done for failure in failures]:
        more = f"; so do {len(failures) - 1} more" if failures[1:] else ""
        raise EntryError(f"{failures[0]}{more}. What others did is kept in {folder}")
    rows = {(row["world"], row["method"], row["seed"]): row for rows, _ in done for row in rows}
    return pd.DataFrame([rows[w, m, s] for w in worlds for m in methods for s in seeds])


def _rows(
    folder: Path,
    world: str,
    seed: int,
    keys: Mapping[str, str],
    added: tuple[Path, ...],
    demonstrations: int | None,
) -> tuple[list[dict[str, Any]], list[str]]:
    """The rows of one world and seed, by methods and what their code is, and what failed.

    Rows that are kept are read.
    """
    catalog, case = load(added), None
    count = demonstrations or catalog.worlds[world].demonstrations
    rows, failures = [], []
    for name, source in keys.items():
        path = folder / _RUNS / world / name.replace(":", "") / f"{seed}.json"
        key = f"{source} {count}"
        row = _kept(path, key)
        if row is None:
            who = f"world {world}, seed {seed}"
            try:
                case = case or _made(catalog.worlds[world], seed, count)
                who = f"method {name} in world {world}, seed {seed}"
                scores = _played(catalog.methods[name], case, [seed, *map(_number, (world, name))])
            except (Exception, SystemExit) as error:  # it may be anybody's code
                failures.append(f"{who} fails: {_what(error)}")
                if case is None:
                    break
                continue
            row = {"world": world, "method": name, "seed": seed, **scores}
            row = {k: None if v != v else v for k, v in row.items()}  # JSON has no nan
            replace_file(path, json_bytes({"key": key, "row": row}))
        rows.append(row)
    return rows, failures


def _made(world: World, seed: int, count: int) -> Case:
    """A case of a world, for which all is compiled that methods share: none is charged for it."""
    case = world.make(seed, count)
    if not isinstance(case, Case):
        raise EntryError(f"it must make a Case, not {type(case).__name__}")
    set_gains(case.problem).beside(np.zeros(case.problem.regions, dtype=bool))
    return case


def _played(method: Method, case: Case, seed: list[int]) -> dict[str, Any]:
    """What a method does in a case, and how well."""
    rng = np.random.default_rng(seed)
    begin = time.process_time()
    answer = method.answer(case.problem, rng)
    seconds = time.process_time() - begin
    check_answer(answer, case.problem.regions)
    row = {"demonstrations": len(case.problem.shown), "told": answer.chosen is None}
    return {**row, "dropped": case.dropped, **score(case, answer, rng), "seconds": seconds}


def _number(name: str) -> int:
    """A number for a name, the same in each process."""
    return crc32(name.encode())


def _what(error: Exception | SystemExit) -> str:
    """An error in one line, with the place in the code unless the message says all."""
    if isinstance(error, EntryError):
        return str(error)
    last = traceback.extract_tb(error.__traceback__)[-1]
    where = f"{Path(last.filename).name}, line {last.lineno}"
    return " ".join(f"{type(error).__name__}: {error} ({where})".split())


def _kept(path: Path, key: str) -> dict[str, Any] | None:
    """A row that was computed with the same code, or None."""
    try:
        record = json.loads(read_file(path))
    except (OSError, ValueError):
        return None
    return dict(record["row"]) if record.get("key") == key else None
