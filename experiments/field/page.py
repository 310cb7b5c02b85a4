"""What a contest leaves: tables, picture, and a page that says what was done."""

from __future__ import annotations

from pathlib import Path

import pandas as pd

from experiments.field.catalog import Catalog
from experiments.field.leaderboard import leaderboard, standings
from experiments.field.picture import picture
from experiments.field.scores import SCORES
from experiments.tracking.files import csv_bytes, replace_file

_HEAD = """# The benchmark of the field

Written by `make field`; `experiments/field/README.md` tells how to add a world or a method. Each
number is a mean over {seeds} seeds, with its 95 % interval (Student's). A seed draws
demonstrations anew; all methods see the same. Methods marked † only score hypotheses: they are
told how many are true and take so many, which the others have to find out.

![IoU of each method in each world](leaderboard.png)
"""


def write_results(
    folder: Path, runs: pd.DataFrame, catalog: Catalog, published: pd.DataFrame | None
) -> Path:
    """Write `runs.csv`, `leaderboard.csv`, `standings.csv`, `leaderboard.png` and `LEADERBOARD.md`.

    Args:
        folder: where to.
        runs: rows of `contest`.
        catalog: the entries that the rows are of.
        published: of `published.false_shares`, also written as a table; None leaves it out.

    Returns:
        The page.
    """
    told = told_methods(runs)
    board = leaderboard(runs)
    stands = pd.concat(
        standings(runs, name, told).assign(score=name) for name in ("iou", "rank", "violations")
    )
    replace_file(folder / "tables" / "runs.csv", csv_bytes(runs))
    replace_file(folder / "tables" / "leaderboard.csv", csv_bytes(board))
    replace_file(folder / "tables" / "standings.csv", csv_bytes(stands))
    replace_file(folder / "leaderboard.png", picture(board, told))
    if published is not None:
        replace_file(folder / "tables" / "published.csv", csv_bytes(published))
    page = folder / "LEADERBOARD.md"
    replace_file(page, page_text(runs, board, stands, catalog, published).encode())
    return page


def told_methods(runs: pd.DataFrame) -> set[str]:
    """Methods that only score hypotheses."""
    return set(runs.loc[runs["told"].astype(bool), "method"])


def page_text(
    runs: pd.DataFrame,
    board: pd.DataFrame,
    stands: pd.DataFrame,
    catalog: Catalog,
    published: pd.DataFrame | None,
) -> str:
    """The page in Markdown."""
    told = told_methods(runs)
    worlds, methods = runs["world"].unique().tolist(), runs["method"].unique().tolist()
    parts = [
        _HEAD.format(seeds=runs["seed"].nunique()),
        "## Over all worlds\n",
        _overall(board, methods, told),
        _NOTES,
        *([] if stands.empty else ["## Ours against the others\n", _STANDINGS, *_stands(stands)]),
        *([_FINDINGS] if {*worlds} >= _FOUND_IN else []),
        *([] if published is None else [_published(published)]),
        *(_of_world(board, world, methods, told) for world in worlds),
        "## How worlds were made\n",
        "Where no slip is named, moves are certain.\n",
        _worlds(runs, catalog),
        "## How methods were made\n",
        _table(
            ["method", "source", "what differs"],
            [[name, m.source, m.differs] for name, m in catalog.methods.items() if name in methods],
        ),
    ]
    return "\n".join(parts)


_NOTES = f"""
What the columns say:

- *IoU, precision, recall*: of the hypotheses that are taken to be forbidden; one that lies partly
  inside the truth counts by its share.
- *rank*: of the best hypothesis that is true, ties sharing the mean; *true among the first k*: of
  the first k hypotheses, where k are true.
- *log posterior*: of the truth by the marginals, as if hypotheses were independent, probabilities
  kept {1e-6:g} from 0 and 1; only of methods that have probabilities.
- *claimed - true*: probability that the first hypothesis is said to have, less how often it is
  true; above 0 is too sure. The paper's (12) as printed is no probability: it is cut at 0 and 1.
- *violations, reward lost, tasks without a way*: an agent of the same kind does the tasks and keeps
  out of what was inferred. How likely it enters what is truly forbidden; how much less reward it
  expects than one who knows the truth, below 0 where it goes through what is forbidden; and in how
  many tasks what was inferred leaves no way at all, which the other two leave out.
- *time*: of one processor, without making the world.
"""
_PUBLISHED = """## Published numbers beside ours

Share of false positives among the constraints that Scobee and Sastry's rule selects in their 9 x 9
world, with the same stop: theirs means over ten sets of demonstrations, ours over {draws}, with
95 % intervals. What differs: the truth and the demonstrations are ours, as the table of worlds
says, and so are the draws.
"""
_FOUND_IN = {"walls S2", "pendulum C2", "maze 1"}  # worlds that findings are of
_FINDINGS = """What decides where ours is ahead or behind, as far as we found out:

- *What nobody could show.* IoU counts the inside of a wall that is several states wide. Where its
  border is forbidden nobody comes to the inside, so that forbidding it explains nothing more, and
  selection by likelihood stops (`ours: greedy` in walls S2: all sixteen border states and none of
  the nine inside). The prior by the border fills it, since a hollow area has the longer border. An
  agent that is deployed does not tell the difference: compare violations.
- *Several sets explain the same.* In the mazes all demonstrations have one start and goal. In
  maze 2 with seed 1, five states on the diagonal explain 114.6 nat and the true wall of seven
  explains 114.3: the shorter border wins, and no method finds more than a part. Chains over sets do
  not agree there (R-hat 2.2 after 200 steps each, 1.2 after 1000, with the same best set).
- *Truths that do not hang together.* In Scobee and Sastry's world the true states touch at corners
  alone. With seed 0 another set is 1.1 nat likelier than the truth by the prior by the border,
  although it explains 1.1 nat less; `ours: greedy`, which expects no areas, takes the truth.
- *Few paths, and a prior that expects little.* One demonstration of the continuous worlds brings a
  fraction of a nat to any one hypothesis. Where 20 random tasks hardly come by the truth, as under
  C2, ours ranks the truth first and still says that there is more likely none. What is told that
  exactly one is true just takes the first.
- *Hypotheses that are forbidden in part.* Demonstrators enter the free part of some hypotheses that
  lie mostly in an ellipse or the disc, which excludes them for all methods but `ours: with rates`.
- *The model is the truth* in the grids: their demonstrators are the agents that likelihoods assume.
  In the pendulums, the ellipses and the disc they are not.
"""
_STANDINGS = """Two methods of ours, settled beforehand in worlds that are none of these
(`experiments/field/practice.py`): `ours: sets`, against the best of the others that are told
nothing, and `ours: ranked`, against the best of the others that are told how many hypotheses are
true. Mean difference of IoU over seeds, with its 95 % interval. The best other is picked in each
world by these same runs, which favours it. *Level* is where the interval holds 0: with few seeds
it is wide, and says little.
"""


def _overall(board: pd.DataFrame, methods: list[str], told: set[str]) -> str:
    """A row a method: means over worlds."""
    table = board.pivot_table(index="method", columns="score", values="mean", aggfunc="mean")
    rows = [
        [_named(m, told), *(_number(table[s].get(m)) for s in SCORES if s in table)]
        for m in methods
    ]
    return _table(["method", *(SCORES[s][0] for s in SCORES if s in table)], rows)


def _of_world(board: pd.DataFrame, world: str, methods: list[str], told: set[str]) -> str:
    """A section with a row a method."""
    table = board[board["world"] == world].set_index(["method", "score"])
    rows = [[_named(m, told), *(_between(table, m, s) for s in SCORES)] for m in methods]
    return f"\n## {world}\n\n" + _table(["method", *(words for words, _ in SCORES.values())], rows)


def _stands(stands: pd.DataFrame) -> list[str]:
    """In how many worlds ours is ahead by IoU, and a table with a row a world and kind."""
    said, rows = [], []
    table = stands[stands["score"] == "iou"]
    for (kind, ours), group in table.groupby(["kind", "ours"], sort=False):
        counts = group["verdict"].value_counts()
        where = [
            f"{v} in {counts[v]}" for v in ("ahead", "level", "behind", "unknown") if v in counts
        ]
        said.append(f"- `{ours}`, {kind}, is {', '.join(where)} of {len(group)} worlds.")
    for row in table.to_dict("records"):
        gap = f"{row['ahead']:+.2f} ({row['lower']:+.2f} to {row['upper']:+.2f})"
        rows.append([row[k] for k in ("world", "kind", "ours", "other")] + [gap, row["verdict"]])
    head = ["world", "methods", "ours", "best other", "ours less it", "ours is"]
    return ["\n".join(said) + "\n", _table(head, rows)]


def _worlds(runs: pd.DataFrame, catalog: Catalog) -> str:
    """A row a world: where it is from, and what is done in it."""
    rows = []
    for name, group in runs.groupby("world", sort=False):
        world = catalog.worlds[str(name)]
        counts = sorted(group["demonstrations"].unique().tolist())
        number = " to ".join(str(count) for count in dict.fromkeys((counts[0], counts[-1])))
        rows.append([str(name), world.source, number, world.setting, world.differs])
    return _table(["world", "source", "demonstrations", "setting", "what differs"], rows)


def _table(head: list[str], rows: list[list[str]]) -> str:
    """A table in Markdown."""
    lines = [head, ["---"] * len(head), *rows]
    return "\n".join(f"| {' | '.join(line)} |" for line in lines) + "\n"


def _named(method: str, told: set[str]) -> str:
    """A method, marked if it is told how many hypotheses are true."""
    return f"{method} †" if method in told else method


def _number(value: float | None) -> str:
    """A number in three digits; nothing if there is none."""
    return "" if value is None or value != value else f"{value:.3g}"


def _between(table: pd.DataFrame, method: str, name: str) -> str:
    """A mean with its interval."""
    row = table.loc[[(method, name)]].iloc[0]
    if row["mean"] != row["mean"]:
        return ""
    half = row["upper"] - row["mean"]
    return f"{row['mean']:.3g}" + ("" if half != half else f" ± {half:.2g}")


def _published(table: pd.DataFrame) -> str:
    """Published shares beside ours."""
    rows = [
        [
            f"{int(row['demonstrations'])}",
            f"{row['published']:.4f}",
            f"{row['mean']:.3f} ({row['lower']:.3f} to {row['upper']:.3f})",
            f"{row['selected']:.1f}",
        ]
        for row in table.to_dict("records")
    ]
    head = ["demonstrations", "published", "ours: greedy", "selected by ours"]
    return "\n".join([_PUBLISHED.format(draws=int(table["seeds"].max())), _table(head, rows)])
