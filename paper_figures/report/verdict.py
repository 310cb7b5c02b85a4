"""Claims of the paper, and verdicts on them by rules that are stated before the numbers.

A claim has parts, each with a rule that holds or does not in each of some settings.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from enum import StrEnum

from paper_figures.report.markdown import table

SPELT_OUT = 8  # settings in which a rule does not hold; more are counted

RULES = """\
A part of a claim is *reproduced* if its rule holds in every setting that it is checked in, *partly*
if in at least half of them, and *not* otherwise. A claim is reproduced if all its parts are, not
reproduced if none is reproduced even partly, and partly otherwise. A setting that has no value,
because the tabular agent can follow no demonstration there, does not count as holding. "Lower"
means that the 95 % intervals of two means do not overlap. The rules stand in the code that writes
this report.
"""


class Verdict(StrEnum):
    """Whether a claim, or a part of it, is reproduced."""

    REPRODUCED = "reproduced"
    PARTLY = "partly"
    NOT = "not reproduced"


@dataclass(frozen=True)
class Check:
    """A rule in one setting.

    Attributes:
        setting: which.
        holds: whether the rule holds there.
        numbers: what the rule was held against, as text.
    """

    setting: str
    holds: bool
    numbers: str = ""


@dataclass(frozen=True)
class Part:
    """One statement of a claim.

    Attributes:
        statement: what the paper says, in short.
        rule: when it holds in a setting.
        checks: the rule in every setting.
    """

    statement: str
    rule: str
    checks: Sequence[Check]

    def __post_init__(self) -> None:
        if not self.checks:
            raise ValueError(f"no setting to check in: {self.statement}")

    @property
    def holding(self) -> int:
        """In how many settings the rule holds."""
        return sum(check.holds for check in self.checks)

    @property
    def verdict(self) -> Verdict:
        """By the shares of settings in `RULES`."""
        if self.holding == len(self.checks):
            return Verdict.REPRODUCED
        return Verdict.PARTLY if 2 * self.holding >= len(self.checks) else Verdict.NOT


@dataclass(frozen=True)
class Claim:
    """A claim of the paper with our answer.

    Attributes:
        title: in a few words.
        paper: the paper's statement, in our own words.
        parts: what it comes down to.
        numbers: our numbers, as Markdown.
        why: what is known about parts that do not reproduce, as Markdown.
        command: what makes the tables behind it.
    """

    title: str
    paper: str
    parts: Sequence[Part]
    numbers: str
    why: str
    command: str

    @property
    def verdict(self) -> Verdict:
        """By the verdicts on its parts, as in `RULES`."""
        verdicts = {part.verdict for part in self.parts}
        if verdicts == {Verdict.REPRODUCED}:
            return Verdict.REPRODUCED
        return Verdict.NOT if verdicts == {Verdict.NOT} else Verdict.PARTLY

    def markdown(self) -> str:
        """The claim as a section, without its heading."""
        lines = [
            f"**The paper:** {self.paper}\n",
            f"**Verdict: {self.verdict}.** Command: `{self.command}`\n",
            table(
                ["part", "rule", "holds in", "verdict"],
                [
                    [
                        part.statement,
                        part.rule,
                        f"{part.holding} of {len(part.checks)}",
                        part.verdict,
                    ]
                    for part in self.parts
                ],
                words=4,
            ),
        ]
        for part in self.parts:
            failed = [check for check in part.checks if not check.holds]
            if failed and len(part.checks) > 1:
                lines.append(f'Where "{part.statement}" does not hold: {_exceptions(failed)}\n')
        return "\n".join([*lines, self.numbers, self.why])


def _exceptions(checks: Sequence[Check]) -> str:
    """Settings with their numbers, as many as can be read."""
    texts = [f"{check.setting}{f' ({check.numbers})' if check.numbers else ''}" for check in checks]
    more = f"; and {len(texts) - SPELT_OUT} more" if len(texts) > SPELT_OUT else ""
    return "; ".join(texts[:SPELT_OUT]) + more + "."
