"""Whether the truth is found although some demonstrators ignore it."""

from __future__ import annotations

from paper_figures.report.claim_4 import TOP
from paper_figures.report.markdown import between, count, percent, table
from paper_figures.report.study_tables import Results
from paper_figures.rule_breaking import TABLES, rule_breaking_rows

STUDY = "rule_breaking"
ASKED = 0.1  # share of rule breaking at which the verdict is given


def section(results: Results) -> str:
    """A line for each truth and share of rule breaking, the ways to infer side by side.

    Raises:
        Missing: the study `rule_breaking` is not there yet.
    """
    rows = rule_breaking_rows(**{name: results.table(STUDY, name, TABLES[name]) for name in TABLES})
    ways = list(dict.fromkeys(rows["value"]))
    lines, verdicts = [], []
    for (truth, rate), pair in rows.groupby(["truth", "rate"]):
        by_way = {row.value: row for row in pair.itertuples()}
        texts = [
            f"{between(count(row.rank), count(row.rank_low), count(row.rank_high))}; "
            + between(percent(row.top), percent(row.top_low), percent(row.top_high))
            for row in (by_way[way] for way in ways)
        ]
        lines.append([str(truth).upper(), percent(rate), *texts])
        if rate == ASKED:
            ranks = ", ".join(f"{count(by_way[way].rank)} with eps {way}" for way in ways)
            verdicts.append(f"{str(truth).upper()} {ranks}")
    size = int(rows["demonstrations"].iloc[0])
    head = [
        "truth",
        "break the rule",
        *(f"eps {way}: median rank; in the top {TOP}" for way in ways),
    ]
    return (
        "Each demonstrator ignores the constraint with some probability. Inference is that of "
        "`infer`. Where nobody is taken to (eps 0), a single violation excludes a hypothesis for "
        "ever; with "
        f"eps estimated, each set of {size} demonstrations is given the rate that makes it most "
        f"likely. Median rank of the truth where {percent(ASKED)} break the rule: "
        f"{'; '.join(verdicts)}. Who ignores the constraint need not enter the truth: most tasks "
        "do not lead through it.\n\n" + table(head, lines, words=2)
    )
