"""Study files that are not what they should be: one sentence, at once, and no memory."""

import pytest

from jaxglide.ensemble.study import MOST_CASES, Study

SPAN = "{start=1,stop=1.5,count=%d}"
GRID = r"\[grid\] holds, by name of a parameter, a list of numbers or \{ start, stop, count \}"
WRONG = {
    "cases = 5": r"cases = 5 is not a table; \[cases\] holds, by name of a parameter, a list",
    "[[cases]]\nnu_theta=1\n[[cases]]\nnu_theta=1.2": r"cases = \[\{'nu_theta': 1\}.* not a",
    f"[grid]\nnu_theta={SPAN % 10**7}\nd_psi={SPAN % 10**7}": r"has 100000000000000 cases \("
    r"nu_theta 10000000 x d_psi 10000000\); at most 10000000 are allowed",
    "[grid]\n"
    + "\n".join(f"{n}={SPAN % 65536}" for n in ("nu_theta", "d_psi", "psi_m", "svl")): (
        r"has 18446744073709551616 cases .*; at most 10000000 are allowed"
    ),
    "fixed=3\n[grid]\nnu_theta=[1]": r"fixed = 3 is not a table; \[fixed\] holds numbers",
    "fixed='ab'\n[grid]\nnu_theta=[1]": "fixed = 'ab' is not a table",
    "grid = [1,2]": rf"grid = \[1, 2\] is not a table; {GRID}",
    "grid = 5": rf"grid = 5 is not a table; {GRID}",
    "[[grid]]\nnu_theta=[1]": rf"grid = \[\{{'nu_theta': \[1\]\}}\] is not a table; {GRID}",
    "grid = true": rf"grid = True is not a table; {GRID}",
    "[grid]\nneck_fraction=[0.5]\n[fixed]\nheight=0.3": r"neck_fraction = 0.5 of SVL is not "
    r"allowed: it must be finite and in \(0, 0.5\)",
    "setup=['polar']\n[grid]\nnu_theta=[1]": r"setup = \['polar'\] is not a table; \[setup\] "
    r"holds polar \(published or smooth\), node_set \(published or gauss\), nodes",
    "[grid]\nnu_theta={start=inf,stop=inf,count=3}": r"nu_theta = inf is not allowed: it "
    r"must be finite and in \[0, 10\]",
    f"[grid]\nnu_theta=[{'9' * 390}]": rf"grid.nu_theta\[0\] = 9+\.\.\.9+ .* range; {GRID}",
    # further ones of each kind
    "[grid]\nnu_theta=[0x" + "f" * 9000 + "]": r"nu_theta\[0\] = a number of 36000 bits",
    "[grid]\nnu_theta=[1,'a']": rf"grid.nu_theta\[1\] = 'a' is not a number; {GRID}",
    "[grid]\nnu_theta={start=1,stop=2}": "'count' is missing in grid.nu_theta; ",
    "[grid]\nnu_theta={start=1,stop=2,coun=3}": "'coun' in grid.nu_theta: known are start",
    "[grid]\nnu_theta={start=1,stop=2,count=0}": "grid.nu_theta.count = 0 .* must be >= 1",
    "[grid]\nnu_theta=[true]": r"grid.nu_theta\[0\] = True is not a number",
    "[grid]\nwings=[1]": "there is no parameter 'wings': known are svl, mass, ",
    "wings=1": "no entry 'wings': known are grid, cases, fixed, setup, solver",
    "[grid]\nnu_theta=[1]\n[solver]\nmax_steps=1.5": r"solver.max_steps = 1.5 is not a whole",
    "[grid]\nnu_theta=[1]\n[solver]\nmax_steps=0": r"max_steps = 0 is not allowed",
    "[grid]\nnu_theta=[1]\n[setup]\npolar='x'": "polar = 'x' is not one of published, smooth",
    "a=" + "[" * 99999: "not a TOML file: it is nested too deeply",
    "a=": "not a TOML file",
    "# \xe9": "line 1: byte 0xe9 is not UTF-8 text",
}


@pytest.mark.parametrize("text", WRONG, ids=lambda text: repr(text)[:40])
def test_what_is_wrong_is_said_in_one_sentence(text, tmp_path):
    path = tmp_path / "study.toml"
    path.write_bytes(text.encode("latin-1"))
    with pytest.raises(ValueError, match=WRONG[text]) as caught:
        Study.from_file(path)
    said = str(caught.value)
    assert said.startswith(f"{path}")
    assert "\n" not in said
    assert len(said) < 500


def test_too_large_a_file_is_not_read(tmp_path, monkeypatch):
    monkeypatch.setattr("jaxglide._lib.documents.LARGEST", 2**20)
    path = tmp_path / "study.toml"
    with path.open("wb") as file:
        file.truncate(2**20 + 1)
    with pytest.raises(ValueError, match="larger than 1 MiB"):
        Study.from_file(path)


def test_the_file_sets_the_order_of_the_grid(tmp_path):
    """The last name varies fastest."""
    path = tmp_path / "study.toml"
    path.write_text("[grid]\nd_psi=[0,1]\nnu_theta={start=1,stop=1.5,count=3}")
    study = Study.from_file(path)
    assert list(study.varied) == ["d_psi", "nu_theta"]
    assert study.shape == (2, 3)


def test_the_number_of_cases_is_bounded_in_python_too():
    with pytest.raises(ValueError, match=f"has 10004000 cases .* at most {MOST_CASES}"):
        Study({"nu_theta": [1.0] * 4000, "d_psi": [0.0] * 2501})


def test_the_text_of_a_study_is_exact():
    for study in (
        Study(
            {"d_psi": [0.1, 1 / 3], "nu_theta": [1.0]}, fixed={"height": 0.3}, times=[0.1, 0.2]
        ),
        Study(cases={"nu_theta": [1.1, 1.2]}, setup={"polar": "smooth"}, rtol=1e-7),
    ):
        again = Study.from_json(study.to_json())
        assert again.to_json() == study.to_json()
        assert list(again.varied) == list(study.varied)


TEXT = Study({"nu_theta": [1.0]}).to_json()
NO_TEXT = {
    "no JSON": "{",
    "deep": "[" * 100_000,
    "a list": "[1]",
    "grid": TEXT.replace('[["nu_theta", [1.0]]]', '{"nu_theta": 1}'),
    "value": TEXT.replace("[1.0]", '["a"]'),
    "missing": TEXT.replace('"rtol"', '"r"'),
    "none": TEXT.replace('"grid"', '"cases"').replace("[[", "[").replace("]]", "]"),
}


@pytest.mark.parametrize("case", NO_TEXT)
def test_what_is_no_text_of_a_study_is_said(case):
    with pytest.raises(ValueError, match="this is not the text of a study: ") as caught:
        Study.from_json(NO_TEXT[case])
    assert "\n" not in str(caught.value)
