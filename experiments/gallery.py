"""The README's gallery: every picture by the command that stands beside it, made small.

The commands run in a scratch folder, in order; the pictures go to the folder of results.
"""

import contextlib
import io
import shlex
import tempfile
from pathlib import Path

from common import arguments  # first: it sets up JAX

# isort: split
from PIL import Image

from jaxglide import cli
from jaxglide._files import write_bytes

WIDTH = 900  # pixels at most
COLOURS = 128
SMALL = 100_000  # bytes

# The data that several pictures draw, and then the pictures: name and command.
DATA = (
    "jaxglide glide --save glide.nc",
    "jaxglide sweep --vary nu_theta=1:1.5:21 --vary d_psi=-20:20:21 --save bends.nc",
    "jaxglide sweep --vary nu_theta=1:1.5:6 --vary d_psi=-20:20:9 --vary psi_m=0:40:5 "
    "--save gaits.nc",
    "jaxglide optimise --starts 16 --steps 30 --screen 128 --save best.nc",
)
PICTURES = {
    "glide": "jaxglide plot glide.nc",
    "body": "jaxglide plot glide.nc --variable body",
    "bends": "jaxglide plot glide.nc --variable bends",
    "waves": "jaxglide plot glide.nc --variable waves",
    "forces": "jaxglide plot glide.nc --variable forces",
    "heatmap": "jaxglide plot bends.nc",
    "curve": "jaxglide plot bends.nc --variable path_length --at nu_theta=1.4",
    "atlas": "jaxglide plot gaits.nc",
    "shapes": "jaxglide shapes --plot shapes.png",
    "moments": "jaxglide windtunnel --d-psi 10 --plot moments.png",
    "trim": "jaxglide trim --nu-theta 1.2 --plot trim.png",
    "convergence": "jaxglide plot best.nc",
    "paths": "jaxglide plot best.nc --x nu_theta --y theta_m",
    "coefficients": "jaxglide figure s7 --out .",
    "view": "jaxglide view --out view.png",
}


def run(command: str) -> None:
    """Run a command of the command line in this process."""
    print(f"$ {command}", flush=True)
    code = cli.main(shlex.split(command)[1:])
    if code:
        raise RuntimeError(f"{command}: exit code {code}")


def picture_of(name: str, command: str) -> Path:
    """The picture that a command writes, by the name it has in the gallery."""
    if command.startswith("jaxglide plot") and "--out" not in command:
        command += f" --out {name}.png"
    run(command)
    return Path("figure_s7.png" if name == "coefficients" else f"{name}.png")


def shrink(picture: Path, out: Path) -> None:
    """A picture of at most `WIDTH` pixels across, of few colours unless it is small anyway."""
    with Image.open(picture) as image:
        image = image.convert("RGB")
        if image.width > WIDTH:
            height = round(image.height * WIDTH / image.width)
            image = image.resize((WIDTH, height), Image.Resampling.LANCZOS)
        memory = io.BytesIO()
        image.save(memory, format="PNG", optimize=True)
        if len(memory.getvalue()) > SMALL:
            memory = io.BytesIO()
            fewer = image.quantize(COLOURS, dither=Image.Dither.NONE)
            fewer.save(memory, format="PNG", optimize=True)
    write_bytes(out, memory.getvalue())


def main() -> None:
    options = arguments(__doc__)
    folder = options.out.resolve()
    with tempfile.TemporaryDirectory() as scratch, contextlib.chdir(scratch):
        for command in DATA:
            run(command)
        for name, command in PICTURES.items():
            out = folder / f"{name}.png"
            shrink(picture_of(name, command), out)
            print(f"wrote {options.out / out.name}, {out.stat().st_size / 1000:.0f} kB")


if __name__ == "__main__":
    main()
