"""Every method in every world, with several seeds; what is done is not done again."""

from __future__ import annotations

import json
import time
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any
from zlib import crc32

import numpy as np
import pandas as pd
from joblib import Parallel, delayed

from experiments.field.catalog import load
from experiments.field.entries import Case, EntryError, check_answer
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
        EntryError: a world or a method that does not give what it must.
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
    rows = {(row["world"], row["method"], row["seed"]): row for rows in done for row in rows}
    return pd.DataFrame([rows[w, m, s] for w in worlds for m in methods for s in seeds])


def _rows(
    folder: Path,
    world: str,
    seed: int,
    keys: Mapping[str, str],
    added: tuple[Path, ...],
    demonstrations: int | None,
) -> list[dict[str, Any]]:
    """The rows of one world and seed, by methods and what their code is; kept ones are read."""
    catalog, case = load(added), None
    entry = catalog.worlds[world]
    count = demonstrations or entry.demonstrations
    rows = []
    for name, source in keys.items():
        method, key = catalog.methods[name], f"{source} {count}"
        path = folder / _RUNS / world / name.replace(":", "") / f"{seed}.json"
        row = _kept(path, key)
        if row is None:
            if case is None:
                case = entry.make(seed, count)
                if not isinstance(case, Case):
                    raise EntryError(f"world {world} must make a Case, not {type(case).__name__}")
                _warm_up(case)
            rng = np.random.default_rng([seed, crc32(world.encode()), crc32(name.encode())])
            begin = time.process_time()
            answer = method.answer(case.problem, rng)
            seconds = time.process_time() - begin
            try:
                check_answer(answer, case.problem.regions)
            except EntryError as error:
                raise EntryError(f"method {name} in world {world}, seed {seed}: {error}") from None
            row = {"world": world, "method": name, "seed": seed, "demonstrations": count}
            row |= {"told": answer.chosen is None, "dropped": case.dropped}
            row |= {**score(case, answer, rng), "seconds": seconds}
            row = {k: None if v != v else v for k, v in row.items()}  # JSON has no nan
            replace_file(path, json_bytes({"key": key, "row": row}))
        rows.append(row)
    return rows


def _warm_up(case: Case) -> None:
    """Compile what all methods use, so that none of them is charged for it."""
    set_gains(case.problem).beside(np.zeros(case.problem.regions, dtype=bool))


def _kept(path: Path, key: str) -> dict[str, Any] | None:
    """A row that was computed with the same code, or None."""
    try:
        record = json.loads(read_file(path))
    except (OSError, ValueError):
        return None
    return dict(record["row"]) if record.get("key") == key else None
