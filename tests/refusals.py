"""What a command says about a config that it refuses."""

import sys

import pytest

from experiments import app, run


def refusal(
    arguments: list[str], monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> str:
    """What the command says about a config that it refuses."""
    monkeypatch.setattr(sys, "argv", ["run.py", *arguments])
    try:
        status = run.main()
    except SystemExit as stop:
        status = stop.code
    out, err = capsys.readouterr()
    assert status == app.REFUSED
    assert out == ""
    assert "Traceback" not in err
    assert len(err.splitlines()) < 10
    return err
