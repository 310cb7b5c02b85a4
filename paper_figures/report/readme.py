"""Numbers in README.md: each stands in a block that is written from tables.

A block is what is between the lines `<!-- numbers: NAME -->` and `<!-- end of numbers -->`.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping

from paper_figures.report import claim_4 as ranking
from paper_figures.report import claim_6 as telescope
from paper_figures.report import section_costs as timings
from paper_figures.report import section_origin as provenance
from paper_figures.report import section_start_points as in_cell
from paper_figures.report.markdown import by_dt
from paper_figures.report.report import verdicts
from paper_figures.report.study_tables import Missing, Results, absent, paper_rows

_BLOCK = re.compile(
    r"(?P<open><!-- numbers: (?P<name>\w+) -->\n).*?(?P<close><!-- end of numbers -->)", re.DOTALL
)


def renewed(text: str, results: Results) -> str:
    """A text whose blocks have the numbers of now.

    Raises:
        ValueError: a block that nothing writes.
    """

    def block(found: re.Match[str]) -> str:
        name = found["name"]
        if name not in BLOCKS:
            raise ValueError(f"nothing writes the numbers {name!r}; there are {', '.join(BLOCKS)}")
        try:
            content = BLOCKS[name](results)
        except Missing as missing:
            content = absent(missing)
        return f"{found['open']}{content}{found['close']}"

    return _BLOCK.sub(block, text)


def _ranks(results: Results) -> str:
    """Ranks of the truth after nine demonstrations."""
    return by_dt(paper_rows(ranking.after(results, "paper")), "text")


BLOCKS: Mapping[str, Callable[[Results], str]] = {
    "verdicts": verdicts,
    "ranks": _ranks,
    "in_cell": in_cell.sentence,
    "telescope": telescope.success,
    "costs": provenance.costs,
    "points": timings.points,
}
