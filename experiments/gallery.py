"""The gallery: every picture by the command that stands beside it, made small.

The commands run in a scratch folder, in order; the pictures go to the folder of results.
"""

import contextlib
import io
import shlex
import tempfile
from pathlib import Path

from common import arguments  # first: it sets up JAX

# isort: split
import numpy as np
from PIL import Image, ImageChops

from jaxglide import cli
from jaxglide._lib.writing import write_bytes

WIDTH = 900  # pixels at most
COLOURS = 256
# A palette is used where no pixel changes by more than this, of 255, and few by more than that.
UNSEEN, SEEN_OVER_AREAS, FEW = 16, 4, 0.1

# The data that several pictures draw, and then the pictures: the commands of the page.
DATA = (
    "jaxglide glide --save glide.nc",
    "jaxglide sweep --vary nu_theta=1:1.5:21 --vary d_psi=-20:20:21 --save map.nc",
    "jaxglide sweep --vary nu_theta=1:1.5:6 --vary d_psi=-20:20:9 --vary psi_m=0:40:5 "
    "--save space.nc",
    "jaxglide optimise --starts 16 --steps 30 --screen 128 --save search.nc",
    "jaxglide steady --theta-m 60 --psi-m 0 --nu-theta 1.738 --f-theta 1.3 --d-psi 5.5 "
    "--save steady.nc",
)
PICTURES = {
    "overview": "jaxglide plot glide.nc --out overview.png",
    "view": "jaxglide view --out view.png",
    "body": "jaxglide plot glide.nc --variable body --out body.png",
    "bends": "jaxglide plot glide.nc --variable bends --out bends.png",
    "waves": "jaxglide plot glide.nc --variable waves --out waves.png",
    "forces": "jaxglide plot glide.nc --variable forces --out forces.png",
    "map": "jaxglide plot map.nc --out map.png",
    "curve": "jaxglide plot map.nc --variable path_length --at nu_theta=1.4 --out curve.png",
    "space": "jaxglide plot space.nc --out space.png",
    "shapes": "jaxglide shapes --plot shapes.png",
    "moments": "jaxglide windtunnel --d-psi 10 --plot moments.png",
    "trim": "jaxglide trim --nu-theta 1.2 --plot trim.png",
    "search": "jaxglide plot search.nc --out search.png",
    "paths": "jaxglide plot search.nc --x nu_theta --y theta_m --out paths.png",
    "steady": "jaxglide plot steady.nc --out steady.png",
    "multipliers": "jaxglide plot steady.nc --variable spectrum --out multipliers.png",
    "branch": "jaxglide steady --theta-m 60 --psi-m 0 --nu-theta 1.738 --f-theta 1.3 "
    "--d-psi 5.5 --nodes 40 --continue f_theta=0.8:3 --plot branch.png",
    "figure_s7": "jaxglide figure s7 --out .",
}


def run(command: str) -> None:
    """Run a command of the command line in this process."""
    print(f"$ {command}", flush=True)
    code = cli.main(shlex.split(command)[1:])
    if code:
        raise RuntimeError(f"{command}: exit code {code}")


def shrink(picture: Path, out: Path) -> None:
    """A picture of at most `WIDTH` pixels across, of few colours where nobody sees it."""
    with Image.open(picture) as image:
        image = image.convert("RGB")
        if image.width > WIDTH:
            height = round(image.height * WIDTH / image.width)
            image = image.resize((WIDTH, height), Image.Resampling.LANCZOS)
        fewer = image.quantize(COLOURS, Image.Quantize.MAXCOVERAGE, dither=Image.Dither.NONE)
        change = np.asarray(ImageChops.difference(image, fewer.convert("RGB"))).max(axis=2)
        unseen = change.max() <= UNSEEN and (change > SEEN_OVER_AREAS).mean() < FEW
        kept = fewer if unseen else image
        memory = io.BytesIO()
        kept.save(memory, format="PNG", optimize=True)
    write_bytes(out, memory.getvalue())


def main() -> None:
    options = arguments(__doc__)
    folder = options.out.resolve()
    with tempfile.TemporaryDirectory() as scratch, contextlib.chdir(scratch):
        for command in DATA:
            run(command)
        for name, command in PICTURES.items():
            out = folder / f"{name}.png"
            run(command)
            shrink(Path(f"{name}.png"), out)
            print(f"wrote {options.out / out.name}, {out.stat().st_size / 1000:.0f} kB")


if __name__ == "__main__":
    main()
