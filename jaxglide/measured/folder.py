"""The recordings of a folder, in either form."""

from collections import Counter
from collections.abc import Sequence
from pathlib import Path

from .._lib.progress import progress_bar
from .flight import MeasuredFlight, measure
from .recording import Recording, RecordingError
from .study_folder import read_study, study_files
from .tabular import read_tabular, tabular_files


def find_trials(folder: Path | str) -> list[str]:
    """Names of the recordings in a folder, laid out as the study's or as CSV files.

    Raises:
        RecordingError: there is none.
    """
    folder = Path(folder)
    found = list(study_files(folder) or tabular_files(folder))
    if not found:
        raise RecordingError(
            f"{folder}: no recording there, neither mocap/TRIAL_SNAKE.tsv nor NAME.csv with "
            "NAME.toml or body.toml"
        )
    return found


def read_recording(folder: Path | str, trial: str) -> Recording:
    """One recording of a folder, by name; see `read_study` and `read_tabular`."""
    folder = Path(folder)
    if study_files(folder):
        return read_study(folder, trial)
    if trial not in tabular_files(folder):
        raise RecordingError(f"{folder}: no {trial}.csv with a {trial}.toml or body.toml")
    return read_tabular(folder / f"{trial}.csv")


def measure_folder(
    folder: Path | str, trials: Sequence[str] | None = None, progress: bool = False
) -> list[MeasuredFlight]:
    """Measure recordings of a folder, a fraction of a second each.

    Args:
        folder: laid out as the study's data, or of CSV files.
        trials: which; all unless told otherwise.
        progress: show a bar, if on a terminal.

    Raises:
        RecordingError: a recording cannot be used, or is named twice.
        OSError: a file cannot be read.
    """
    trials = find_trials(folder) if trials is None else list(trials)
    for trial, count in Counter(trials).items():
        if count > 1:
            raise RecordingError(f"the recording {trial!r} is named {count} times")
    flights = []
    with progress_bar(len(trials), "flight", None if progress else False) as bar:
        for trial in trials:
            flights.append(measure(read_recording(folder, trial)))
            bar.update()
    return flights
