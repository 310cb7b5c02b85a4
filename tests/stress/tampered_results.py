"""Commands on folders of results that somebody has tampered with, 2000 cases.

Run by `make stress`, or with a number of cases and a seed; ends with an error if a case is wrong.
"""

from __future__ import annotations

import shutil
import sys
import tempfile
from pathlib import Path

# The checkout comes first: tests/ has a folder experiments/ too.
TESTS = Path(__file__).resolve().parents[1]
sys.path[:0] = [str(TESTS.parent), str(TESTS)]

from tampering import check_cases

CASES, SEED = 2000, 2026


def main() -> None:
    """Try all cases."""
    count, seed = (int(word) for word in [*sys.argv[1:], CASES, SEED][:2])
    if len(sys.argv) == 2:
        seed = SEED
    base = Path(tempfile.mkdtemp(prefix="tampered-"))
    wrong = check_cases(base, count, seed)
    shutil.rmtree(base)
    for text in wrong[:20]:
        print(text)
    print(f"tampered results: {count} cases, {len(wrong)} wrong")
    sys.exit(bool(wrong))


if __name__ == "__main__":
    main()
