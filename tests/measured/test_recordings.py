"""Recordings that hold what no flight can: named by file, frame and marker."""

import re

import numpy as np
import pytest

from jaxglide import measured
from jaxglide.cli import main
from made_recordings import PLACES, cut, swimming, write_study, write_tabular


@pytest.fixture(scope="module")
def whole():
    return swimming()


def in_cell(value, frame=49, marker=4, axis=2):
    def change(markers):
        markers[frame, marker, axis] = value
        return markers

    return change


def lost_at_zero(markers):
    markers[60:66, 3] = 0.0
    return markers


def all_lost_at(place):
    def change(markers):
        markers[100] = place
        return markers

    return change


def moved_in_frame(frame, off, marker=4):
    """A spike: some frames' places are off sideways [m]."""

    def change(markers):
        markers[frame, marker, 0] += off
        return markers

    return change


def frozen(*of):
    """Markers that stay from the middle of the flight on where they were last seen."""

    def change(markers):
        markers[120:, of] = markers[119, of]
        return markers

    return change


def held_in_a_gap(markers):
    """Lost for 8 frames, in one of which the last place is written again."""
    markers[60:67, 3] = np.nan
    markers[66] = markers[59]
    return markers


def bent_to_the(side, degrees):
    """The flight, its path turned off forward without the body."""

    def change(markers):
        forward = 2 * np.arange(len(markers)) / 179
        tilt = np.deg2rad(degrees)
        path = np.column_stack([side * np.sin(tilt) * forward, (np.cos(tilt) - 1) * forward])
        markers[..., :2] += path[:, None]
        return markers

    return change


def turned(*order, signs=(1, 1, 1)):
    return lambda markers: markers[..., list(order)] * signs


PLACES_OF_NO_FLIGHT = {
    "-9999": (in_cell(-9999), r"'m05_z' is -9999 m in frame 50 \(marker 5\); .* within 100 m"),
    "1e9": (in_cell(1e9), r"'m05_z' is 1e\+09 m in frame 50"),
    "1e300": (in_cell(1e300), r"'m05_z' is 1e\+300 m in frame 50"),
    "spike": (
        in_cell(13.0),
        r"marker 5 \(columns 'm05_x' to 'm05_z'\) in frame 50: markers 4 ",
    ),
    "first marker": (in_cell(13.0, 0, 0), r"marker 1 \(columns .* in frame 1: markers 1 and 2"),
    "lost at 0": (lost_at_zero, r"marker 4 \(.*\) is at exactly 0, 0, 0 in frame 61, as some"),
    "all at one place": (
        all_lost_at(0.001),
        r"marker 1 .* moves 7\.032\d* m from frame 100 to frame",
    ),
    "y up": (turned(0, 2, 1, signs=(1, 1, -1)), r"moves 6\.\d+ m backwards .* as 'm01_y'"),
    "z down": (turned(0, 1, 2, signs=(1, 1, -1)), r"moves 6\.\d+ m upwards from .* as 'm01_z'"),
    "at rest": (
        lambda m: m[:1] + 1e-4 * np.random.default_rng(0).normal(size=m.shape),
        "the body is at rest: .* 0.5 to 30 m/s",
    ),
    "exactly at rest": (
        lambda m: np.broadcast_to(m[:1], m.shape),
        r"marker 1 .* is at exactly the same place from frame 1 to frame 240, as some",
    ),
    "all frozen": (
        frozen(*range(11)),
        r"marker 1 .* is at exactly the same place from frame 120 to frame 240, as some",
    ),
    "one frozen": (
        frozen(6),
        r"marker 7 \(columns 'm07_x' to 'm07_z'\) is at exactly the same place from frame 120",
    ),
    "held in a gap": (
        held_in_a_gap,
        r"marker 4 .* same place from frame 60 to frame 67, as some .* leave it empty or write",
    ),
    "small spike": (
        moved_in_frame(49, 0.12),
        r"marker 5 .* in frame 50 is 0\.1[12]\d* m from the middle of its places in frames 49 "
        r"and 51, more than 0\.0899 m",
    ),
    "spike of two frames": (
        moved_in_frame(slice(49, 51), 0.12),
        r"marker 5 .* in frame 5[01] is 0\.1[12]\d* m from the middle of its places in frames "
        r"4[89] and 5[23], more than 0\.1054 m",
    ),
    "spike at the end": (
        moved_in_frame(-1, 0.19, 10),
        r"marker 11 .* in frame 239 is .* places in frames 238 and 240",
    ),
    "x and y exchanged": (turned(1, 0, 2), r"2\.6\d* m to the right .*'m01_x', 89\.8 degrees"),
    "x and -y exchanged": (turned(1, 0, 2, signs=(-1, 1, 1)), r"to the left .* y forward"),
    "75 to the left": (bent_to_the(-1, 75), r"to the left from .* 75(\.\d)? degrees off .* 70"),
}


POSSIBLE = {
    "as it is": lambda markers: markers,
    "in whole millimetres": lambda markers: markers.round(3),
    "held for 5 frames": lambda m: np.concatenate([m[:100], m[[99] * 5], m[105:]]),
    "65 to the right": bent_to_the(1, 65),
    "off by 0.08 m": moved_in_frame(49, 0.08),
    "steeply down": lambda m: m - [0, 1.8, 0] * np.arange(len(m))[:, None, None] / 179,
}


@pytest.mark.parametrize("case", POSSIBLE)
def test_places_of_a_flight_are_accepted(tmp_path, whole, case):
    assert measured.read_tabular(write_tabular(tmp_path, POSSIBLE[case](whole.copy())))


@pytest.mark.parametrize("case", PLACES_OF_NO_FLIGHT)
def test_places_of_no_flight_are_named(tmp_path, whole, case):
    change, message = PLACES_OF_NO_FLIGHT[case]
    with pytest.raises(measured.RecordingError, match=rf"one\.csv: .*{message}"):
        measured.read_tabular(write_tabular(tmp_path, change(whole.copy())))


def test_a_study_is_told_in_its_own_unit(tmp_path, whole):
    write_study(tmp_path, in_cell(-9.999)(whole.copy()))
    told = (
        r"101_7\.tsv: .*markers 4 and 5 are 1\d{4} mm apart, where the tape allows 276\.67 mm"
    )
    with pytest.raises(measured.RecordingError, match=told):
        measured.read_study(tmp_path, "101")


def retimed(source, change):
    """The recording with another text for every time [s]."""
    head, *rows = source.read_text().splitlines()
    cells = (row.split(",", 1) for row in rows)
    lines = [f"{change(float(time))},{rest}" for time, rest in cells]
    source.write_text("\n".join([head, *lines]) + "\n")
    return source


def test_times_may_be_rounded_to_a_millisecond(tmp_path, whole):
    source = write_tabular(tmp_path, whole)
    exact = measured.read_tabular(source)
    rounded = measured.read_tabular(retimed(source, lambda time: f"{time + 0.0004:.3f}"))
    assert rounded.rate == pytest.approx(exact.rate, rel=1e-4)
    lost = source.read_text().splitlines()
    source.write_text("\n".join(lost[:100] + lost[101:]) + "\n")
    with pytest.raises(measured.RecordingError, match=r"'time_s' is not in equal steps"):
        measured.read_tabular(source)


TIMES = {
    "minutes": (lambda time: f"{time / 60:.8f}", r"move at 3\d\d m/s .* unit of the times"),
    "milliseconds": (lambda time: f"{1000 * time:.3f}", r"0\.179 frames a second, .* unit of"),
    "standing still": (lambda _: "0.5", "column 'time_s' does not rise"),
}


@pytest.mark.parametrize("case", TIMES)
def test_times_in_another_unit_are_said(tmp_path, whole, case):
    change, message = TIMES[case]
    with pytest.raises(measured.RecordingError, match=rf"one\.csv: .*{message}"):
        measured.read_tabular(retimed(write_tabular(tmp_path, whole), change))


CELLS = {
    "long": (700 * "9", r"'9{12}\.\.\.9{13}' in column 'm01_x', row 2 below the header"),
    "Inf": ("Inf", r"'Inf' in column 'm01_x', row 2 below the header, is not a finite number"),
    "1_0": ("1_0", r"'1_0' in column 'm01_x'"),
    "Latin-1": (
        "\xb5",
        r"'\\xb5' in column 'm01_x', row 2 below the header, is not UTF-8 text",
    ),
}


@pytest.mark.parametrize("case", CELLS)
def test_cells_that_are_no_numbers_are_named(tmp_path, whole, case):
    cell, message = CELLS[case]
    source = write_tabular(tmp_path, whole)
    lines = source.read_text().splitlines()
    cells = lines[2].split(",")
    lines[2] = ",".join([cells[0], cell, *cells[2:]])
    source.write_bytes("\n".join(lines).encode("latin-1"))
    with pytest.raises(measured.RecordingError, match=rf"one\.csv: {message}"):
        measured.read_tabular(source)


def test_a_column_may_not_come_twice(tmp_path, whole):
    source = write_tabular(tmp_path, whole)
    source.write_text(cut(source.read_text(), "m04_x", "m03_x"))
    with pytest.raises(measured.RecordingError, match=r"one\.csv: column 'm03_x' is there 2"):
        measured.read_tabular(source)


BODIES = {
    "grams": (
        {"mass": "50"},
        r"mass = 50 kg does not go with svl = 0\.62 m, where 0\.0071 to 2",
    ),
    "all in cm": (
        {"svl": "62", "tape": str((100 * np.diff(PLACES)).tolist())},
        r"svl = 62 m is not allowed: it must be in \[0\.1, 1\.5\] m",
    ),
    "no end": ({"vent": "inf"}, r"vent = inf is not a whole number; the number of a marker"),
    "half a marker": ({"vent": "3.5"}, r"vent = 3\.5 is not a whole number"),
    "infinite": ({"mass": "inf"}, "mass is inf, not a positive number"),
    "deep": ({"density": "[" * 9999}, "not a TOML file: it is nested too deeply"),
    "no density": ({"density": "[]"}, r"density = \[\] is not allowed: at least two rows"),
    "one row": ({"density": "[[0, 1]]"}, r"density = \[\[0\.0, 1\.0\]\] is not .* two rows"),
    "singles": ({"density": "[[0]]"}, r"density\[0\] = \[0\] is not allowed: .*; pairs of arc"),
    "NUL": ({"snake": r'"\u0000x"'}, r"snake = '\\x00x' is not allowed: '\\x00' cannot stand"),
    "escape": ({"snake": r'"a\u001b[2J"'}, r"snake = 'a\\x1b\[2J' is not allowed: '\\x1b'"),
    "two lines": ({"snake": r'"a\nb"'}, r"snake = 'a\\nb' is not allowed: '\\n' cannot"),
    "triples": ({"density": "[[0, 1, 2]]"}, r"density\[0\] = \[0, 1, 2\] is not allowed"),
}


@pytest.mark.parametrize("case", BODIES)
def test_bodies_that_cannot_be_are_named(tmp_path, whole, case):
    changes, message = BODIES[case]
    with pytest.raises(measured.RecordingError, match=rf"one\.toml: {message}"):
        measured.read_tabular(write_tabular(tmp_path, whole, **changes))


@pytest.mark.parametrize("name", ["a\nb", "a\x7f", "\udce9"])
def test_names_of_files_that_cannot_be_written_are_said(tmp_path, whole, name):
    write_tabular(tmp_path, whole)
    for ending in (".csv", ".toml"):
        (tmp_path / f"one{ending}").rename(tmp_path / f"{name}{ending}")
    told = re.escape(f"{tmp_path}: file = {name + '.csv'!r} is not allowed: ")
    with pytest.raises(measured.RecordingError, match=told):
        measured.measure_folder(tmp_path)


def test_two_recordings_of_one_trial_are_asked_for(tmp_path, whole):
    first = write_study(tmp_path, whole) / "mocap" / "101_7.tsv"
    first.with_name("101_7_complete.tsv").write_bytes(first.read_bytes())
    told = r"101_7\.tsv and 101_7_complete\.tsv are of one trial: keep one"
    with pytest.raises(measured.RecordingError, match=told):
        measured.read_study(tmp_path, "101")


def test_a_recording_is_named_once(tmp_path, whole, capsys):
    write_tabular(tmp_path, whole)
    assert main(["measure", str(tmp_path), "--trial", "one", "--trial", "one"]) == 2
    assert "'one' is named 2 times" in capsys.readouterr().err
