"""The same scene for talks: an animation as GIF or MP4, and a still."""

import contextlib
import io
import itertools
import re
import subprocess
import tempfile
from collections.abc import Iterator, Sequence
from importlib.util import find_spec
from pathlib import Path

import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from PIL import Image

from .._lib.checks import check_range
from .._lib.writing import WriteError, replacing, write_bytes, write_figure
from ..flight.trajectory import AbstractTrajectory
from ._picture import Picture
from .scene import Flights, scale_of, scenes_of, title_of

ANIMATIONS = (".gif", ".mp4")
STILLS = (".png",)
_MOST_FRAMES = 3000


def check_path(path: str | Path, allowed: Sequence[str] = ANIMATIONS) -> Path:
    """The path, if a file of its kind can be made here.

    Raises:
        ValueError: its name ends in none of `allowed`, or in .mp4 without imageio-ffmpeg.
    """
    path = Path(path)
    if path.suffix not in allowed:
        raise ValueError(f"path = {str(path)!r}: the name must end in {' or '.join(allowed)}")
    if path.suffix == ".mp4" and find_spec("imageio_ffmpeg") is None:
        raise ValueError(
            f"path = {str(path)!r}: an MP4 needs the package imageio-ffmpeg "
            "(pip install 'jaxglide[view]'); a .gif needs nothing more"
        )
    return path


def animate(
    glides: Flights,
    path: str | Path,
    *,
    labels: Sequence[str] | None = None,
    title: str | None = None,
    frames_per_second: float = 20.0,
    playback: float = 0.25,
    force_scale: float | None = None,
) -> Path:
    """An animation of one glide or of several on one clock, 960 by 540 pixels.

    Args:
        glides: as in `view`.
        path: the file to write, .gif or .mp4.
        labels: what to call the glides, one each.
        title: heading.
        frames_per_second: pictures a second of the animation [1/s], 1 to 50.
        playback: seconds of flight shown in a second; 1 is real time.
        force_scale: as in `view` [m per N/m].

    Returns:
        The path.

    Raises:
        ValueError: as `view`; or the path's ending is neither, imageio-ffmpeg is missing for
            an MP4, frames_per_second or playback is out of range, or both make more than
            3000 pictures.
        OSError: the file cannot be written.
    """
    path = check_path(path)
    check_range("frames_per_second", frames_per_second, "1/s", 1, 50)
    check_range("playback", playback, "", 0, 10, low_open=True)
    rate = frames_per_second / playback
    _check_length(glides, rate)
    scenes = scenes_of(glides, labels, min(rate, 1000.0))
    picture = Picture(scenes, title_of(glides, title), scale_of(scenes, force_scale))
    count = max(len(scene.times) for scene in scenes)
    write = _write_gif if path.suffix == ".gif" else _write_mp4
    write(path, _frames(picture, count), frames_per_second)
    return path


def still(
    glides: Flights,
    path: str | Path,
    *,
    time: float | None = None,
    labels: Sequence[str] | None = None,
    title: str | None = None,
    force_scale: float | None = None,
) -> Path:
    """One picture of the same scene, 1920 by 1080 pixels.

    Args:
        glides: as in `view`.
        path: the file to write, .png.
        time: in flight [s], to the nearest 1/240 s; by default 40 % of the longest glide.
        labels, title, force_scale: as in `animate`.

    Returns:
        The path.

    Raises:
        ValueError: as `view`; or the path does not end in .png, or the time lies outside the
            longest glide.
        OSError: the file cannot be written.
    """
    path = check_path(path, STILLS)
    scenes = scenes_of(glides, labels, 120.0)
    longest = max(scenes, key=lambda scene: scene.times[-1]).times
    time = 0.4 * longest[-1] if time is None else time
    check_range("time", time, "s", 0, longest[-1])
    frame = int(np.abs(longest - time).argmin())
    picture = Picture(scenes, title_of(glides, title), scale_of(scenes, force_scale))
    picture.draw(frame)
    write_figure(path, picture.figure, dpi=200)
    return path


def _check_length(glides: Flights, rate: float) -> None:
    several = [glides] if isinstance(glides, AbstractTrajectory) else list(glides)
    spans = (glide.time - glide.start_time for glide in several)
    longest = max((float(np.max(span)) for span in spans), default=0.0)
    if longest * rate > _MOST_FRAMES:
        raise ValueError(
            f"playback and frames_per_second make {longest * rate:.0f} pictures of this "
            f"glide, more than {_MOST_FRAMES}: play faster or show fewer a second"
        )


def _frames(picture: Picture, count: int) -> Iterator[np.ndarray]:
    """Pictures as arrays, (height, width, 3)."""
    canvas = FigureCanvasAgg(picture.figure)
    for frame in range(count):
        picture.draw(frame)
        canvas.draw()
        yield np.asarray(canvas.buffer_rgba())[..., :3].copy()


def _write_gif(path: Path, frames: Iterator[np.ndarray], frames_per_second: float) -> None:
    """One palette for all pictures, so that what stands still does not flicker."""
    images = [Image.fromarray(frame) for frame in frames]
    palette = images[len(images) // 2].quantize(256, dither=Image.Dither.NONE)
    paletted = [i.quantize(palette=palette, dither=Image.Dither.NONE) for i in images]
    wait = [round(1000 / frames_per_second)] * len(images)
    wait[-1] = 1500  # ms: rest on the end before it starts again
    memory = io.BytesIO()
    rest = {"append_images": paletted[1:], "duration": wait, "loop": 0}
    paletted[0].save(memory, format="GIF", save_all=True, **rest)
    write_bytes(path, memory.getbuffer())


def _write_mp4(path: Path, frames: Iterator[np.ndarray], frames_per_second: float) -> None:
    """Written by ffmpeg, whose failure has to be seen: imageio-ffmpeg's own writer hides it."""
    import imageio_ffmpeg

    first = next(frames)
    size, rate = f"{first.shape[1]}x{first.shape[0]}", f"{frames_per_second:g}"
    given = ("-f", "rawvideo", "-pix_fmt", "rgb24", "-s", size, "-r", rate, "-i", "-")
    made = ("-an", "-vcodec", "libx264", "-crf", "10", "-pix_fmt", "yuv420p")
    command = (imageio_ffmpeg.get_ffmpeg_exe(), "-y", "-v", "error", "-xerror", *given, *made)
    with replacing(path) as beside, tempfile.TemporaryFile() as words:
        encoder = subprocess.Popen(
            (*command, str(beside)),
            stdin=subprocess.PIPE,
            stderr=words,
            process_group=0,  # Ctrl-C is for us to hear, and to end it then
        )
        assert encoder.stdin is not None
        try:
            with contextlib.suppress(BrokenPipeError), encoder.stdin as pipe:
                for frame in itertools.chain([first], frames):
                    pipe.write(np.ascontiguousarray(frame))
            code = encoder.wait()
        finally:
            encoder.kill()
            encoder.wait()
        if code:
            words.seek(0)
            said = words.read().decode(errors="replace").strip().splitlines()
            said = [re.sub(r"^\[.*?\] ", "", line) for line in said]
            reason = said[-1] if said else f"the encoder ended with code {code}"
            raise WriteError(f"cannot write {path}: {reason}")
