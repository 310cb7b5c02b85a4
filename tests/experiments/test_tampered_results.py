"""Commands on folders of results that somebody has tampered with; `make stress` tries 2000."""

from pathlib import Path

from tampering import check_cases


def test_tampering_is_told_and_leads_nowhere(tmp_path: Path) -> None:
    assert check_cases(tmp_path, 60, 2026) == []
