"""The overrides of a sweep's points: swept values, cases, and the settings in which cases run."""

from typing import Any

import pytest
from hydra.core.override_parser.overrides_parser import OverridesParser
from omegaconf import OmegaConf

from experiments.config.read import ConfigError
from experiments.sweep.combinations import Case, Combinations, read_cases


def listed(
    *arguments: str,
    params: dict[str, str] | None = None,
    settings: Any = None,
    cases: Any = None,
    ends: bool = False,
) -> list[str]:
    """The overrides of every point, each point's as one text; then the notes."""
    lists = [
        OmegaConf.create(part) if isinstance(part, dict | list) else part
        for part in (settings, cases)
    ]
    combinations = Combinations(params, *lists, ends)
    jobs = combinations.overrides(arguments, OverridesParser.create())
    return [" ".join(job) for job in jobs] + combinations.notes


def test_study_without_values_has_one_point() -> None:
    assert listed() == [""]
    assert listed("seed=3") == ["seed=3"]


def test_later_values_change_faster_and_settings_fastest() -> None:
    points = listed("seed=0,1", params={"dt": "0.5,1"}, settings=[["actions=3"], []])
    assert points == [
        f"dt={dt} seed={seed}{case}"
        for dt in ("0.5", "1")
        for seed in (0, 1)
        for case in (" actions=3", "")
    ]


def test_the_ends_of_many_systems_are_the_first_and_the_last() -> None:
    systems = [[f"system={name}", f"seed={seed}"] for seed, name in enumerate("abc")]
    *points, note = listed(settings=systems, ends=True)
    assert points == ["system='a' seed=0", "system='c' seed=2"] or points == [
        "system=a seed=0",
        "system=c seed=2",
    ]
    assert note == "settings: the first and the last stand for all 3 systems"
    # Other settings are no axis: all of them stay.
    assert len(listed(settings=[["seed=0"], ["seed=1"], ["seed=2"]], ends=True)) == 3


def test_option_of_a_group_stays_a_word() -> None:
    assert listed(params={"grid": "100,400"}) == ["grid='100'", "grid='400'"]


def test_case_with_a_name_says_it_first() -> None:
    cases = {"default": [], "temperature: 0.5": ["temperature=0.5", "seed=0,1"]}
    assert listed(cases=cases) == [
        "case='default'",
        "case='temperature: 0.5' temperature=0.5 seed=0",
        "case='temperature: 0.5' temperature=0.5 seed=1",
    ]
    (override,) = OverridesParser.create().parse_overrides(listed(cases={"it's so": []}))
    assert override.value() == "it's so"


SETTINGS = [["dt=0.25", "grid=100,400"], ["dt=0.5"]]


def test_each_case_runs_in_each_of_the_settings() -> None:
    settings = ["dt=0.25 grid='100'", "dt=0.25 grid='400'", "dt=0.5"]
    assert listed(settings=SETTINGS) == settings
    assert listed(settings=SETTINGS, cases={"a": ["seed=1"], "b": ["seed=2"]}) == [
        f"case='{name}' {words} seed={seed}" for name, seed in (("a", 1), ("b", 2))
        for words in settings
    ]  # fmt: skip


def test_case_may_have_settings_of_its_own() -> None:
    cases = {"a": [], "b": [["dt=1.0", "seed=1"], ["dt=2.0,3.0"]]}
    assert listed(cases=cases, settings=[["dt=0.5"]]) == [
        "case='a' dt=0.5",
        *("case='b' dt=1.0 seed=1", "case='b' dt=2.0", "case='b' dt=3.0"),
    ]


def test_command_line_wins_over_each_key_of_a_study() -> None:
    study = {"params": {"truth": "c1,c2"}, "cases": {"a": ["seed=1"]}, "settings": SETTINGS}
    assert listed("seed=4", "truth=wall", **study) == [
        f"seed=4 truth=wall case='a' {setting}"
        for setting in ("dt=0.25 grid='100'", "dt=0.25 grid='400'", "dt=0.5")
    ]
    assert listed("dt=2", "grid='900'", **study)[0] == "truth=c1 dt=2 grid='900' case='a' seed=1"


def test_ends_stand_for_all_values_of_a_study_and_say_so() -> None:
    study = {"params": {"dt": "1,2,3"}, "cases": {"a": ["seed=4,5,6"], "b": ["seed=4,5,6"]}}
    points = listed("horizon=1,2,3", **study, ends=True)
    assert points[-2:] == [
        "dt: 1 and 3 stand for all of 1, 2, 3",
        "seed: 4 stands for all of 4, 5, 6",
    ]
    assert len(points) == 2 * 3 * 2 + 2
    assert points[0] == "dt=1 horizon=1 case='a' seed=4"
    assert listed(params={"dt": "1,2"}, ends=True) == ["dt=1", "dt=2"]
    many = listed(params={"seed": "range(0,100)"}, ends=True)
    assert many == ["seed=0", "seed: 0 stands for all of 0, 1, 2, ..., 99"]


@pytest.mark.parametrize(
    ("study", "message"),
    [
        ({"settings": 3}, "hydra.sweeper.settings: 3 is no list of lists of overrides"),
        ({"settings": {"a": []}}, "hydra.sweeper.settings: {'a': []} is no list of lists"),
        ({"settings": [[], "seed"]}, "hydra.sweeper.settings[1]: 'seed' is no list of overrides"),
        ({"settings": [[3]]}, "hydra.sweeper.settings[0]: [3] is no list of overrides, such as"),
        ({"cases": 3}, "hydra.sweeper.cases: 3 does not name its cases, as {default: []} does"),
        ({"cases": [["seed=1"]]}, "hydra.sweeper.cases: [['seed=1']] does not name its cases"),
        ({"cases": {"a": "seed=1"}}, "hydra.sweeper.cases.a: 'seed=1' is no list of overrides"),
        ({"cases": {"a": None}}, "hydra.sweeper.cases.a: None is no list of overrides"),
        ({"cases": {"a": [["seed=1"], 3]}}, "hydra.sweeper.cases.a[1]: 3 is no list of overrides"),
        ({"cases": {"a": ["seed"]}}, "hydra.sweeper.cases.a: seed cannot be read as key=value"),
        (
            {"cases": {"a: 1": ["dt=1"]}, "settings": [["dt=2"]]},
            "hydra.sweeper.cases.a: 1: dt=1 is the second value of dt in this case; keep one, or",
        ),
        (
            {"cases": {"a": ["case=b"]}},
            "hydra.sweeper.cases.a: case=b is the second value of case in this case; keep one",
        ),
        (
            {"params": {"dt": "1,2"}, "settings": [["dt=2"]]},
            "hydra.sweeper.settings[0]: dt=2: params sweep dt too; leave it to one of them",
        ),
        ({"cases": {"a": ["study=x"]}}, "hydra.sweeper.cases.a: study=x: this changes no result"),
        ({"params": {"study": "a,b"}}, "study=a,b: this changes no result, so give it one value"),
        ({"params": {"dt": "interval(0,1)"}}, "dt=interval(0,1): cannot be swept; list its value"),
    ],
)
def test_wrong_study_is_refused_with_its_place(study: dict[str, Any], message: str) -> None:
    with pytest.raises(ConfigError) as refusal:
        listed(**study)
    assert str(refusal.value).startswith(message)


def test_cases_are_read_with_their_places() -> None:
    assert read_cases(None, None) == [Case("hydra.sweeper.settings[0]", ())]
    assert read_cases([["y=1"], ["y=2"]], {"a": ["x=1"]}) == [
        Case("hydra.sweeper.cases.a", ("case='a'", "y=1", "x=1")),
        Case("hydra.sweeper.cases.a", ("case='a'", "y=2", "x=1")),
    ]


@pytest.mark.parametrize(
    ("word", "values"),
    [
        ("dt=range(0.1,0.6,0.1)", [0.1, 0.2, 0.3, 0.4, 0.5]),
        ("dt=range(0.6,0.1,-0.2)", [0.6, 0.4, 0.2]),
        ("dt=range(0,1,0.25)", [0.0, 0.25, 0.5, 0.75]),
        ("dt=range(1e-3,3.1e-3,1e-3)", [0.001, 0.002, 0.003]),
        ("dt=range(1,4)", [1, 2, 3]),
        ("dt=range(3.0)", [0.0, 1.0, 2.0]),
    ],
)
def test_a_range_counts_in_decimals(word: str, values: list[float]) -> None:
    """0.3, as it is written, and not 0.30000000000000004, which is another number."""
    assert listed(word) == [f"dt={value}" for value in values]
    assert sorted(listed(word.replace("=", "=shuffle(") + ")")) == sorted(listed(word))
