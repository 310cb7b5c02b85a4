"""Keep the rule of the study `dynamics` for advise.py: python -m experiments.success_rule"""

from __future__ import annotations

import json
import sys
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from experiments.config.paths import CONF, default_results
from experiments.terminal import words
from experiments.tracking.files import replace_file
from experiments.tracking.forms import sound_study
from mlci.outlook.outlook import FEATURES, Outlook
from mlci.outlook.rule import Rule
from mlci.spaces import Floats

KEPT = CONF / "success_rule.json"
STUDY = "dynamics"
LEAST_TOUCHED = 0.1  # share of the tasks that the study's truths touch
_ENDS = ("", "_low", "_high")


@dataclass(frozen=True, eq=False)
class SuccessRule:
    """How likely inference is to work, by what is known before anybody demonstrates.

    Attributes:
        features: names of `mlci.outlook.outlook.FEATURES`.
        rule: fitted to the study's points.
        least: (F,) the least that the study has of each.
        most: (F,) the most.
        top: success is that the truth is among so many,
        demonstrations: after so many.
        systems: that the study has.
        points: likewise.
        scores: Brier score on systems that were left out, with its interval, by way.
        rule_less: the rule's score less that of each way, with its interval.
    """

    features: tuple[str, ...]
    rule: Rule
    least: Floats
    most: Floats
    top: int
    demonstrations: int
    systems: int
    points: int
    scores: dict[str, tuple[float, ...]]
    rule_less: dict[str, tuple[float, ...]]

    def chances(self, known: Outlook) -> Floats:
        """(H,) probability of success for each region that the study could have had as a truth.

        These are the regions that the optimal paths of a tenth of the tasks enter.
        """
        return self.rule.probability(self._numbers(known))

    def beyond(self, known: Outlook) -> list[str]:
        """Features that are, in the middle of those regions, outside of what the study has."""
        numbers = self._numbers(known)
        if not len(numbers):
            return []
        middle = np.median(numbers, axis=0)
        out = (middle < self.least - 1e-9) | (middle > self.most + 1e-9)
        return [name for name, is_out in zip(self.features, out, strict=True) if is_out]

    def _numbers(self, known: Outlook) -> Floats:
        """(H, F) the rule's features of each such region."""
        columns = [FEATURES.index(name) for name in self.features]
        told = np.flatnonzero(known.touched >= LEAST_TOUCHED)
        return known.features(told, self.demonstrations, self.top)[:, columns]


def read_rule(path: Path = KEPT) -> SuccessRule:
    """The rule that is kept."""
    kept = json.loads(path.read_text())
    rows = kept["features"]
    mean, scale, weights, least, most = (
        np.array([row[name] for row in rows])
        for name in ("mean", "scale", "weight", "least", "most")
    )
    return SuccessRule(
        features=tuple(row["feature"] for row in rows),
        rule=Rule(mean, scale, weights, kept["intercept"]),
        least=least,
        most=most,
        scores={way: tuple(values) for way, values in kept["brier"].items()},
        rule_less={way: tuple(values) for way, values in kept["rule_less"].items()},
        **kept["success"],
        **kept["cases"],
    )


def kept_rule(folder: Path) -> dict[str, Any]:
    """What is kept of a study's tables.

    Args:
        folder: of the study `dynamics`.

    Raises:
        FileNotFoundError: its tables are not there.
    """
    rule, scores, points = (
        pd.read_csv(folder / "tables" / f"{name}.csv")
        for name in ("success_rule", "success_scores", "dynamics")
    )
    study = sound_study(folder)
    made = None if study is None else study.collated
    features = rule[rule["feature"] != "intercept"]
    (intercept,) = rule.loc[rule["feature"] == "intercept", "weight"]
    return {
        "written_by": "python -m experiments.success_rule, from the tables of results/dynamics",
        "success": {"top": 5, "demonstrations": int(points["demonstrations"].max())},
        "cases": {key: int(scores[key].iloc[0]) for key in ("systems", "points")},
        "features": features.round(6).to_dict("records"),
        "intercept": round(float(intercept), 6),
        **{
            measure: {
                row.way: [round(float(getattr(row, measure + end)), 4) for end in _ENDS]
                for row in scores.itertuples()
            }
            for measure in ("brier", "rule_less")
        },
        "made_from": {
            "commits": [] if made is None else list(made.commits),
            "changed_since_commit": None if made is None else made.dirty,
            "sources": {} if made is None else dict(made.sources),
            "dynamics.csv": "" if made is None else made.tables.get("dynamics.csv", ""),
        },
    }


def chance_words(known: Outlook, rule: SuccessRule) -> list[str]:
    """How likely inference is to work, and on what that rests; a sentence each."""
    chances = rule.chances(known)
    if not len(chances):
        return ["of no hypothesis it can be told: none is entered by a tenth of the tasks"]
    low, high = np.quantile(chances, (0.1, 0.9))
    scores = {
        way: "{:.3f} ({:.3f} to {:.3f})".format(*values) for way, values in rule.scores.items()
    }
    said = [
        f"in about {np.mean(chances):.0%} of cases a truth is among the first {rule.top} of "
        f"{len(known.touched)} hypotheses after {rule.demonstrations} demonstrations "
        f"({low:.0%} to {high:.0%} for most of the {len(chances)} hypotheses that a tenth of the "
        "tasks would enter).",
        f"This rests on {rule.points} simulated studies of {rule.systems} systems, whose truth was "
        f"one of the hypotheses, and on {', '.join(map(words, rule.features)) or 'no feature'}: "
        f"on systems that it had not seen, the rule had a Brier score of {scores['rule']}, "
        f"the mere base rate {scores['base_rate']}, expected violations alone "
        f"{scores['expected_violations']}.",
    ]
    if rule.rule_less["base_rate"][2] >= 0:
        said.append("So it is not surely better than the base rate: do not lean on it.")
    if beyond := rule.beyond(known):
        said.append(f"Here {', '.join(map(words, beyond))} is beyond all that was tried there.")
    return said


def chance_word(known: Outlook | None, rule: SuccessRule) -> str:
    """The chance in a table."""
    chances = None if known is None else rule.chances(known)
    return "-" if chances is None or not len(chances) else f"{np.mean(chances):.0%}"


def main() -> int:
    """Write the rule; returns 1 if the study is not there."""
    folder = default_results() / STUDY if len(sys.argv) < 2 else Path(sys.argv[1])
    try:
        kept = kept_rule(folder)
    except FileNotFoundError as error:
        command = f"python experiments/run.py -m experiment={STUDY}"
        print(f"{error.filename} is not there: run {command} first", file=sys.stderr)
        return 1
    replace_file(KEPT, (json.dumps(kept, indent=2) + "\n").encode())
    print(f"written: {KEPT}")
    return 0


if __name__ == "__main__":
    sys.exit(main())
