"""A recording of motion capture, made up, in every form that is read."""

import numpy as np

RATE = 179.0
TIME = np.arange(240) / RATE
PLACES = np.array([0, 0.05, 0.13, 0.2, 0.27, 0.33, 0.4, 0.46, 0.52, 0.6, 0.68])
COLUMNS = [f"m{i:02d}_{axis}" for i in range(1, 12) for axis in "xyz"]
BODY = {"snake": '"A"', "mass": "0.05", "svl": "0.62", "vent": "10"}


def swimming():
    """A body of travelling waves in free fall from 8 m, (240, 11, 3) [m]."""
    arc = np.linspace(0, PLACES[-1], 400)
    phase = 2 * np.pi * (1.3 * arc / 0.62 - 1.2 * TIME[:, None])
    theta, psi = 1.5 * np.cos(phase), 0.3 * np.cos(2 * phase)
    tangent = [np.cos(psi) * np.sin(theta), -np.cos(psi) * np.cos(theta), np.sin(psi)]
    shape = np.cumsum(np.stack(tangent, axis=-1), axis=1) * arc[1]
    shape -= shape.mean(axis=1, keepdims=True)
    fall = np.column_stack([0 * TIME, 2 * TIME, 8 - 3.5 * TIME**2])
    return (shape + fall[:, None])[:, np.searchsorted(arc, PLACES)]


def write_tabular(folder, markers, **changes):
    """Recording `one.csv` with `one.toml`; `changes` replace lines of the latter."""
    lines = [",".join(["time_s", *COLUMNS])]
    for time, row in zip(TIME, markers.reshape(len(markers), -1), strict=False):
        cells = ["" if np.isnan(cell) else f"{cell:.6f}" for cell in row]
        lines.append(",".join([f"{time:.6f}", *cells]))
    (folder / "one.csv").write_text("\n".join(lines) + "\n")
    entries = BODY | {"tape": str(np.diff(PLACES).tolist())} | changes
    text = "\n".join(f"{name} = {value}" for name, value in entries.items() if value)
    (folder / "one.toml").write_text(text + "\n")
    return folder / "one.csv"


def write_study(folder, markers):
    """The same recording in the form of the study's folder, as trial 101 of snake 7."""
    (folder / "mocap").mkdir()
    (folder / "markers").mkdir()
    names = [f"{i:02d} {axis}" for i in range(1, 12) for axis in "XYZ"]
    lines = [f"LINE_{i}\t-" for i in range(9)] + ["FREQUENCY\t179"]
    lines.append("\t".join(["Frame", "Time", *names, ""]))
    for frame, row in enumerate(1000 * markers.reshape(len(markers), -1)):
        cells = ["NA" if np.isnan(cell) else f"{cell:.3f}" for cell in row]
        lines.append("\t".join([str(frame + 7), f"{3 + frame / 179:.5f}", *cells]))
    (folder / "mocap" / "101_7.tsv").write_text("\r\n".join(lines) + "\r\n")
    rows = [',Marker,Marker type,"Dist to next, mm",svl (mm)']
    kinds = ["head", *["body"] * 8, "vent", "tail"]
    for i, kind in enumerate(kinds):
        tape = f"{1000 * (PLACES[i + 1] - PLACES[i]):.4f}" if i < 10 else ""
        rows.append(f"{i},{i + 1}.0,{kind},{tape},620")
    (folder / "markers" / "Marker-summary_100_7.csv").write_text("\n".join(rows) + "\n")
    master = "Snake,Trial ID,Mass (g),SVL (mm)\n7,101,50.0,620\n"
    (folder / "snake_master.csv").write_text(master)
    density = ",arc length (SVL),density (rho/rho_bar)\n0,0.0,1\n1,0.5,1\n2,2.0,1\n"
    (folder / "snake_density.csv").write_text(density)
    return folder


def cut(text, old, new):
    assert old in text
    return text.replace(old, new)
