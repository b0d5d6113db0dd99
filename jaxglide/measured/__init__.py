"""From motion capture to gait: how the published flights were measured.

Recordings of markers on a gliding snake become its gait (wave numbers, frequencies,
amplitudes), its path and its launch state, by the procedure of the published study
(I. J. Yeaton, S. D. Ross, G. A. Baumgardner, J. J. Socha, "Undulation enables gliding in
flying snakes", Nature Physics 16, 974-982, 2020, doi:10.1038/s41567-020-0935-4, Methods).
This package stands apart from the flight model and does not load JAX. SI units and radians;
axes: x to the right, y forward, z up.
"""

from .flight import MeasuredFlight, measure
from .folder import find_trials, measure_folder, read_recording
from .recording import Body, Recording, RecordingError
from .study_folder import read_study
from .table import flights_dataset
from .tabular import read_tabular

__all__ = [
    "Body",
    "MeasuredFlight",
    "Recording",
    "RecordingError",
    "find_trials",
    "flights_dataset",
    "measure",
    "measure_folder",
    "read_recording",
    "read_study",
    "read_tabular",
]
