"""One flight: from a recording to the gait, the path and the launch state."""

from dataclasses import dataclass

import numpy as np

from .backbone import centre_of_mass, fit_backbone
from .bending import CEILING, MeasuredBending, bending_angles
from .gaps import fill_gaps
from .modes import Modes, decompose, half_range
from .recording import MINIMUM_FRAMES, Recording, RecordingError, whole_interval
from .smoothing import smooth


@dataclass(frozen=True)
class MeasuredFlight:
    """What a flight's markers tell: SI units, radians; x right, y forward, z up.

    Args:
        trial: name of the flight.
        snake: name of the animal.
        mass: [kg].
        svl: snout-vent length found with the flight's markers [m].
        markers: their number.
        missing: number of positions that were filled in.
        longest_gap: longest time that a marker was not seen [s].
        times: since the first processed frame, (N,) [s].
        position: of the centre of mass, (N, 3) [m].
        velocity: of the centre of mass, (N, 3) [m/s].
        bending: the angles of the body in space and time.
        horizontal: modes of the horizontal wave [rad].
        vertical: modes of the vertical wave [rad].
    """

    trial: str
    snake: str
    mass: float
    svl: float
    markers: int
    missing: int
    longest_gap: float
    times: np.ndarray
    position: np.ndarray
    velocity: np.ndarray
    bending: MeasuredBending
    horizontal: Modes
    vertical: Modes

    @property
    def start_position(self) -> np.ndarray:
        """Centre of mass in the first processed frame, (3,) [m]."""
        return self.position[0]

    @property
    def start_velocity(self) -> np.ndarray:
        """Its velocity then, (3,) [m/s]."""
        return self.velocity[0]

    @property
    def nu_theta(self) -> float:
        """Spatial periods of the horizontal wave along the body."""
        return float(self.horizontal.wave_number[0])

    @property
    def f_theta(self) -> float:
        """Frequency of the horizontal wave [Hz]."""
        return float(self.horizontal.frequency[0])

    @property
    def theta_m(self) -> float:
        """Amplitude of the horizontal wave, reanimated from its modes [rad]."""
        return self.horizontal.amplitude

    @property
    def nu_psi(self) -> float:
        """Spatial periods of the vertical wave along the body."""
        return float(self.vertical.wave_number[0])

    @property
    def f_psi(self) -> float:
        """Frequency of the vertical wave [Hz]."""
        return float(self.vertical.frequency[0])

    @property
    def psi_m(self) -> float:
        """Amplitude of the vertical wave, reanimated from its modes [rad]."""
        return self.vertical.amplitude

    @property
    def d_psi(self) -> float:
        """Dorsoventral bending, the mean slope of the vertical angle [rad per SVL]."""
        return float(self.bending.slope.mean())

    @property
    def theta_range(self) -> float:
        """Half the peak-to-peak of the horizontal angle itself, mean over frames [rad]."""
        return half_range(self.bending.theta)

    @property
    def psi_range(self) -> float:
        """Half the peak-to-peak of the vertical angle itself, mean over frames [rad]."""
        return half_range(self.bending.psi)


def _longest_run(missing: np.ndarray) -> int:
    """Longest run of True along the first axis in any column; ends are False."""
    longest = 0
    for column in missing.T:
        whole = np.flatnonzero(~column)
        longest = max(longest, int(np.diff(whole).max()) - 1)
    return longest


def measure(recording: Recording) -> MeasuredFlight:
    """The gait, path and launch state of a recorded flight.

    Args:
        recording: from `read_study`, `read_tabular` or made by hand.

    Raises:
        RecordingError: every marker is seen in too few frames, or the centre of mass is
            below 7.25 m, where the gait is measured, in too few.
    """
    body, rate = recording.body, recording.rate
    raw = recording.markers[whole_interval(recording)]
    missing = np.asarray(np.isnan(raw).any(axis=-1))
    markers, _ = smooth(fill_gaps(raw, rate), rate)
    backbone = fit_backbone(markers, body.tape, rate)
    position, _ = smooth(centre_of_mass(backbone, body.density, body.svl), rate)
    times = np.arange(len(raw)) / rate
    low = position[:, 2] < CEILING
    if low.sum() < MINIMUM_FRAMES:
        raise RecordingError(
            f"{recording.source}: the centre of mass is below {CEILING} m, where the gait is "
            f"measured, in {low.sum()} frames; {MINIMUM_FRAMES} are needed"
        )
    bending = bending_angles(backbone, times, low, body.vent, body.svl_mean)
    return MeasuredFlight(
        trial=recording.trial,
        snake=body.snake,
        mass=body.mass,
        svl=body.svl,
        markers=raw.shape[1],
        missing=int(missing.sum()),
        longest_gap=float(_longest_run(missing) / rate),
        times=times,
        position=position,
        velocity=np.gradient(position, 1 / rate, axis=0, edge_order=2),
        bending=bending,
        horizontal=decompose(bending.theta, bending.times, bending.fraction),
        vertical=decompose(bending.psi, bending.times, bending.fraction),
    )
