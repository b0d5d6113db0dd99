"""The log of an optimisation: what it keeps, what it refuses, who may write it."""

import itertools
import os
import subprocess
import sys

import jax.numpy as jnp
import numpy as np
import optax
import pytest

from jaxglide._lib.writing import BusyError, WriteError, alone
from jaxglide.search import journal as _journal
from jaxglide.search.evaluator import Evaluator, fingerprint
from jaxglide.search.journal import Journal, keeping
from jaxglide.search.objectives import landing_distance
from jaxglide.search.optimum import optimise
from jaxglide.search.problem import Evaluation, Problem
from made_searches import Made, problem_of

ASKED = {"seed": 0, "rate": 0.1}
STARTS = np.arange(2)
OPTIONS = {"starts": 2, "screen": 4, "steps": 2, "polish": 1}


def asked_and_found(k):
    """Points (2, 1) and what was found there; at the second asked, nothing finite."""
    points = np.array([[0.1], [1 / 3]]) * (k + 1)
    values = np.array([[1e-300 * k], [-0.1]]) if k != 1 else np.array([[np.nan], [-np.inf]])
    return points, Evaluation(values, np.array([[[2.0 / 3]], [[np.inf]]]))


@pytest.fixture
def log(tmp_path):
    """A log of three evaluations."""
    path = tmp_path / "log.jsonl"
    journal = Journal(path, ASKED)
    for k in range(3):
        points, found = asked_and_found(k)
        assert journal.recall(STARTS, points) is None
        journal.keep(STARTS, points, found)
    return path


def recalled(path):
    """How many evaluations a log gives back, all of them as they were."""
    journal = Journal(path, ASKED)
    for k in itertools.count():
        points, found = asked_and_found(k)
        again = journal.recall(STARTS, points)
        if again is None:
            return k
        np.testing.assert_array_equal(again.values, found.values)
        np.testing.assert_array_equal(again.gradients, found.gradients)


def refused(path):
    """The sentence with which a log is refused, None if it is not."""
    try:
        left = recalled(path)
    except ValueError as error:
        said = str(error)
    else:
        assert left < 3
        return None
    assert str(path) in said
    assert "\n" not in said
    return said


def test_what_is_kept_is_given_back_exactly(log):
    assert recalled(log) == 3
    text = log.read_text()
    assert '"values":[["nan"],["-inf"]]' in text
    assert "NaN" not in text


def test_every_single_bit_matters_or_does_no_harm(log):
    """Any bit flipped: refused, or the last evaluations are asked for again."""
    whole = log.read_bytes()
    assert whole.count(b"\n") == 4
    harmless = set()
    with log.open("r+b", buffering=0) as file:
        for k, bit in itertools.product(range(len(whole)), range(8)):
            os.pwrite(file.fileno(), bytes([whole[k] ^ 1 << bit]), k)
            if refused(log) is None:
                harmless.add(k)
            os.pwrite(file.fileno(), whole[k:], k)
    assert harmless == {len(whole) - 1}  # the last end of line: a line that is cut short


def test_every_single_line_matters(log):
    head, *lines = log.read_bytes().splitlines(keepends=True)
    one, two, three = lines
    edits = [
        (2, [two, one, three]),  # swapped
        (2, [two, three]),  # lost
        (2, [three, one, two]),
        (2, [one.replace(b"0.1", b"99.0", 1), two, three]),
        (3, [one, one, two, three]),  # doubled
        (3, [one, three]),
        (3, [one, b"{}\n", three]),
        (3, [one, b"\n", three]),
        (3, [one, b" " + two, three]),
        (4, [one, two, one]),
        (4, [one, two, three.replace(b"-0.1", b"-0.2")]),
        (5, [*lines, three]),
    ]
    for number, changed in edits:
        log.write_bytes(head + b"".join(changed))
        assert f"line {number} is not the one written there" in refused(log)
    for first in (b"", b"{}\n", lines[0], head.replace(b"0.1", b"0.2")):
        log.write_bytes(first + b"".join(lines))
        assert "line 1 is damaged" in refused(log)


def test_every_torn_end_is_dropped(log):
    whole = log.read_bytes()
    ends = [k + 1 for k, byte in enumerate(whole) if byte == ord("\n")]
    for size in range(0, len(whole), 3):
        log.write_bytes(whole[:size])
        lines = max(sum(end <= size for end in ends), 1)
        assert recalled(log) == lines - 1
        assert log.read_bytes() == whole[: ends[lines - 1]]


def test_a_log_is_added_to_and_never_written_again(log, monkeypatch):
    """A log that is taken up stays the same file, whole at every moment."""
    whole, place = log.read_bytes(), log.stat().st_ino
    monkeypatch.setattr(_journal, "write_bytes", None)
    with log.open("ab") as file:
        file.write(b'{"number":4,"st')
    journal = Journal(log, ASKED)
    assert log.read_bytes() == whole
    for k in range(4):
        points, found = asked_and_found(k)
        if journal.recall(STARTS, points) is None:
            journal.keep(STARTS, points, found)
    assert log.stat().st_ino == place
    assert log.read_bytes().startswith(whole)
    assert recalled(log) == 4


def test_other_files_are_refused_and_left_alone(tmp_path, log):
    notes = tmp_path / "notes.txt"
    for text in (b"my notes", b"my\nnotes\n", b"[" * 100_000 + b"\n", b"\xff\xfe\n", b"{}\n"):
        notes.write_bytes(text)
        with pytest.raises(ValueError, match=r"notes.txt is not the log of an optimisation"):
            Journal(notes, ASKED)
        assert notes.read_bytes() == text
    with pytest.raises(
        ValueError, match="another optimisation: seed differs, 0 there and 1 here"
    ):
        Journal(log, {**ASKED, "seed": 1})
    with pytest.raises(ValueError, match=r"rate differs, 0.1 there and None here"):
        Journal(log, {"seed": 0})
    reordered = Journal(log, dict(reversed(ASKED.items())))  # the same, in other words
    assert len(reordered.kept) == 3
    reordered.recalled = 3
    reordered.keep(STARTS, *asked_and_found(3))
    assert recalled(log) == 4


def test_an_answer_to_another_question_is_refused(log):
    points, _ = asked_and_found(0)
    assert Journal(log, ASKED).recall(STARTS, points * (1 + 1e-12)) is not None
    for starts, other in (
        (STARTS[::-1], points),
        (STARTS, points * 1.001),
        (STARTS[:1], points),
    ):
        with pytest.raises(ValueError, match=r"log.jsonl: line 2 answers another question"):
            Journal(log, ASKED).recall(starts, other)


def test_a_full_disk_is_said_and_the_log_stays_usable(log, tmp_path, disk_of):
    journal, size = Journal(log, ASKED), log.stat().st_size
    journal.recalled = 3
    with disk_of(size + 20), pytest.raises(WriteError) as full:
        journal.keep(STARTS, *asked_and_found(3))
    assert str(full.value) == f"cannot write {log}: File too large"
    assert log.stat().st_size == size + 20  # so much of the line was written
    assert recalled(log) == 3
    assert log.stat().st_size == size
    with (
        disk_of(20),
        pytest.raises(WriteError, match=r"cannot write .*new.jsonl: File too"),
    ):
        Journal(tmp_path / "new.jsonl", ASKED)
    assert {path.name for path in tmp_path.iterdir()} == {log.name}


def test_a_log_that_somebody_else_changes_is_left_alone(log):
    journal, whole = Journal(log, ASKED), log.read_bytes()
    log.write_bytes(whole[:-1])
    with pytest.raises(WriteError, match="it was changed meanwhile"):
        journal.keep(STARTS, *asked_and_found(3))
    assert log.read_bytes() == whole[:-1]
    log.unlink()
    with pytest.raises(WriteError, match="No such file"):
        journal.keep(STARTS, *asked_and_found(3))
    assert not log.exists()


def test_one_process_at_a_time_writes_a_log(log):
    code = "import sys; from jaxglide._lib.writing import alone\n"
    code += "with alone(sys.argv[1]): print('held', flush=True); sys.stdin.read()"
    pipes = {"stdin": subprocess.PIPE, "stdout": subprocess.PIPE, "text": True}
    with subprocess.Popen([sys.executable, "-c", code, str(log)], **pipes) as other:
        assert other.stdout.readline() == "held\n"
        problem = problem_of()
        with pytest.raises(BusyError, match=r"another process is at work on .*log.jsonl"):
            optimise(problem, evaluator=Made(problem, (0.3, 0.6)), log=log)
        other.communicate()
    with keeping(log, ASKED) as journal:
        assert len(journal.kept) == 3
        with pytest.raises(BusyError), alone(log):
            pass


@pytest.fixture
def kept(tmp_path):
    """The log of a search, and what it found."""
    problem, log = problem_of(), tmp_path / "log.jsonl"
    found = optimise(problem, **OPTIONS, evaluator=Made(problem, (0.3, 0.6)), log=log)
    assert log.read_bytes().count(b"\n") == 5  # screening, steps, a round of sampling
    return log, found


def test_a_search_goes_on_from_any_number_of_lines(kept):
    log, found = kept
    whole = log.read_bytes()
    lines = whole.splitlines(keepends=True)
    for left in range(1, 6):
        log.write_bytes(b"".join(lines[:left]))
        rest = Made(problem_of(), (0.3, 0.6))
        again = optimise(problem_of(), **OPTIONS, evaluator=rest, log=log)
        assert rest.calls == 5 - left
        assert again.best == found.best
        assert log.read_bytes() == whole


@pytest.mark.parametrize(
    ("change", "named"),
    [
        ({"seed": 1}, "seed differs, 0 there and 1 here"),
        ({"steps": 3}, "steps differs"),
        ({"screen": 8}, "screen differs"),
        ({"rate": 0.2}, "rate differs"),
        ({"optimiser": "lbfgs"}, "rate differs"),
        ({"optimiser": optax.adam(0.5)}, "rate differs"),
        ({"guesses": [{"theta_m": 90.0, "nu_theta": 1.2}]}, "guesses differs"),
        ({"problem": Problem(landing_distance, {"theta_m": (80, 120)})}, "free differs"),
        (
            {
                "problem": Problem(
                    landing_distance, {"nu_theta": (1, 1.5), "theta_m": (80, 120)}
                )
            },
            "order",
        ),
        ({"problem": Problem(2 * landing_distance, problem_of().free)}, "objective differs"),
        ({"problem": Problem(landing_distance, problem_of().free, rtol=1e-6)}, "rtol differs"),
    ],
)
def test_the_log_of_another_search_is_refused(kept, change, named):
    log, _ = kept
    whole = log.read_bytes()
    change = {**OPTIONS, "problem": problem_of(), **change}
    made = Made(change["problem"], (0.3, 0.6), stop_at=0)
    with pytest.raises(ValueError, match=f"log of another optimisation: {named}"):
        optimise(**change, evaluator=made, log=log)
    assert log.read_bytes() == whole


def test_transformations_are_told_apart_by_what_they_do(tmp_path):
    def run(rule, name, stop_at=None):
        made = Made(problem_of(), (0.3, 0.6), stop_at=stop_at)
        log = tmp_path / f"{name}.jsonl"
        return optimise(problem_of(), **OPTIONS, optimiser=rule, evaluator=made, log=log)

    def later(step):
        return optax.piecewise_constant_schedule(1.0, {step: 0.5})

    rules = [optax.sgd(1.0), optax.sgd(0.5), optax.adam(0.5), optax.sgd(1.0, momentum=0.5)]
    rules += [optax.sgd(later(50)), optax.sgd(later(51))]
    for k, rule in enumerate(rules):
        run(rule, k)
        for j in range(len(rules)):
            if j < k:
                with pytest.raises(ValueError, match="optimiser differs"):
                    run(rule, j, stop_at=0)
    again = run(optax.sgd(1.0), 0, stop_at=0)  # another object that does the same
    assert again.feasible


def test_what_is_computed_is_told_apart_by_its_code():
    """Objectives of one name and text, problems alike but for a number in a function."""

    def print_of(factor, **options):
        objective = landing_distance.__class__(
            "mine", "m", lambda trial: factor * trial.launch.height
        )
        return Evaluator(Problem(objective, {"theta_m": (80, 120)}, **options)).fingerprint()

    def table_of(table):
        return fingerprint(lambda x: jnp.asarray(table) @ x, jnp.ones(2))

    tables = np.eye(2), jnp.eye(2), np.array([[1.0, 0.0], [0.0, 1 + 1e-9]])
    assert len({table_of(table) for table in (tables[0], np.eye(2))}) == 1
    assert table_of(tables[0]) != table_of(tables[2])
    assert table_of(tables[1]) != table_of(jnp.asarray(tables[2]))
    one = print_of(1.0)
    assert one == print_of(1.0)
    assert one != print_of(1.0000001)
    assert one == print_of(1.0, fixed={"height": 3.0})  # a number: see the next test


def test_the_log_of_another_base_is_refused(tmp_path):
    log, base = tmp_path / "log.jsonl", problem_of().case

    def run(case, stop_at=None, **fixed):
        problem = Problem(landing_distance, problem_of().free, fixed=fixed, case=case)
        made = Made(problem, (0.3, 0.6), stop_at=stop_at)
        return optimise(problem, **OPTIONS, evaluator=made, log=log)

    found = run(base)
    assert run(base, stop_at=0).best == found.best
    with pytest.raises(ValueError, match="log of another optimisation: case differs"):
        run(base.replace({"gravity": 9.81 * (1 + 1e-15)}), stop_at=0)
    with pytest.raises(ValueError, match="log of another optimisation: fixed differs"):
        run(base, stop_at=0, gravity=9.81)


@pytest.mark.slow
def test_what_is_computed_is_known_again_by_another_process(tmp_path):
    code = """
import jax
jax.config.update("jax_enable_x64", True)
from jaxglide.search.objectives import clearance, landing_distance, stability_margin
from jaxglide.search.evaluator import Evaluator
from jaxglide.search.problem import Problem
limits = [stability_margin.at_least(10, 10), clearance.at_least(1)]
print(Evaluator(Problem(landing_distance, ("theta_m",), limits)).fingerprint())
"""
    prints = [
        subprocess.check_output(
            [sys.executable, "-c", code], env={**os.environ, "PYTHONHASHSEED": seed}
        )
        for seed in ("1", "2")
    ]
    assert prints[0] == prints[1]
