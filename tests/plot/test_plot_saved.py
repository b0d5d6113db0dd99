"""`jaxglide plot`: the right figure for every kind of file, and words for every mistake."""

import json
import shutil
import warnings

import matplotlib
import numpy as np
import pytest
import xarray as xr
from matplotlib.collections import QuadMesh

from jaxglide import Gait, Glider, Launch, Snake, cli, discretise, plot, simulate
from jaxglide._lib.formats import kind_of, marked
from jaxglide.ensemble.records import stamp
from jaxglide.ensemble.store import check_memory, opened
from jaxglide.ensemble.study import Study
from jaxglide.files.glides import glide_dataset
from jaxglide.files.saved import open_dataset
from jaxglide.plot.saved import draw

NODES = 20


@pytest.fixture(scope="module")
def glide():
    glider = Glider(Snake.from_svl(0.7, nodes=NODES), Gait.from_degrees())
    launch = Launch(1.0, 1.75, phi_theta=0.3, angles=np.deg2rad([0.0, -5.0, -5.0]))
    return simulate(glider, launch, dense=True)


@pytest.fixture(scope="module")
def saved(glide, tmp_path_factory):
    """The glide in a file."""
    path = tmp_path_factory.mktemp("saved") / "glide.nc"
    glide_dataset(glide, frames=41).to_netcdf(path, engine="h5netcdf")
    return path


def run(capsys, *arguments):
    code = cli.main(["plot", *map(str, arguments)])
    captured = capsys.readouterr()
    return code, captured.out, captured.err


def line(ax, label):
    (found,) = (line for line in ax.lines if line.get_label() == label)
    return np.asarray(found.get_xydata())


# A glide


def test_a_saved_glide_is_drawn_as_the_glide_itself(glide, saved):
    drawing = draw(open_dataset(saved))
    ours, theirs = drawing.figure, plot.glide_overview(glide)
    assert ours.get_suptitle() == theirs.get_suptitle()
    for a, b in zip(ours.axes, theirs.axes, strict=True):
        assert a.get_xlabel() == b.get_xlabel()
        np.testing.assert_allclose(a.get_xlim(), b.get_xlim(), atol=1e-3)
        for label in [one.get_label() for one in b.lines if one.get_label()[0] != "_"]:
            np.testing.assert_allclose(line(a, label), line(b, label), atol=0.02)


@pytest.mark.parametrize(
    ("name", "label", "unit"),
    [
        ("lift", "lift per length (N/m)", True),
        ("angle_of_attack", "angle of attack (°)", False),
        ("reynolds", "Reynolds number", False),
    ],
)
def test_quantities_along_the_body_are_the_files(glide, saved, name, label, unit):
    data = open_dataset(saved)
    ax = draw(data, name).figure.axes[0]
    (mesh,) = (c for c in ax.collections if isinstance(c, QuadMesh))
    sections = discretise(glide.glider.body)
    wanted = data[name].values.T
    if unit:
        wanted = wanted * (np.asarray(sections.chord) / np.asarray(sections.area))[:, None]
    np.testing.assert_allclose(mesh.get_array(), wanted)
    assert ax.figure.axes[1].get_ylabel() == label
    assert (ax.get_xlabel(), ax.get_ylabel()) == ("time, t (s)", "arc length, $s$ (SVL)")
    assert -0.05 < ax.get_ylim()[0] < 0.05 < 0.95 < ax.get_ylim()[1] < 1.05


def test_lift_along_the_body_adds_up(glide):
    values = plot.along_body(glide, "lift")
    assert values.dims == ("time", "node")
    spacing = 0.7 / NODES
    total = glide_dataset(glide)["lift"].sum("node")
    np.testing.assert_allclose(values.sum("node") * spacing, total, rtol=1e-9)


def test_lines_are_at_the_times_asked_for(saved):
    data = open_dataset(saved)
    end = float(data["time"][-1])
    ax = plot.along_body_lines(data, "drag", times=[0.0, end / 2, end])
    curves = [one for one in ax.lines if len(one.get_xdata()) == NODES]
    assert [one.get_label() for one in curves] == [f"{t:.2f} s" for t in (0, end / 2, end)]
    wanted = plot.along_body(data, "drag")
    for one, row in zip(curves, (0, 20, 40), strict=True):
        np.testing.assert_allclose(one.get_ydata(), wanted.values[row])
    assert ax.get_ylabel() == "drag per length (N/m)"
    assert ax.get_xlim() == (0.0, 1.0)
    assert len(plot.along_body_lines(data, times=4).get_legend().get_texts()) == 4


def test_names_that_are_not_along_the_body_are_refused(saved):
    data = open_dataset(saved)
    with pytest.raises(ValueError, match="'angles' is not along the body: known are lift"):
        plot.along_body_map(data, "angles")
    with pytest.raises(ValueError, match="times = 99"):
        plot.along_body_lines(data, times=[99.0])
    with pytest.raises(ValueError, match="no coordinate 'node_area' of its nodes"):
        plot.along_body_map(data.drop_vars("node_area"), "lift")


def test_forces_are_four_maps(saved):
    figure = draw(open_dataset(saved), "forces").figure
    assert [ax.get_ylabel() for ax in figure.axes[4:]] == [
        "lift per length (N/m)",
        "drag per length (N/m)",
        "angle of attack (°)",
        "Reynolds number",
    ]
    assert figure.axes[3].get_xlabel() == "time, t (s)"


def test_waves_and_body_are_those_of_the_glide(glide, saved):
    data = open_dataset(saved)
    ax = draw(data, "theta").figure.axes[0]
    gait, snake = glide.glider.gait, glide.glider.body
    given = {"duration": float(glide.time), "phi_theta": 0.3}
    wanted = plot.wave_map(gait, snake, wave="theta", **given)
    meshes = [next(c for c in a.collections if isinstance(c, QuadMesh)) for a in (ax, wanted)]
    np.testing.assert_allclose(*(mesh.get_array() for mesh in meshes), atol=1e-9)
    body = draw(data, "body").figure.axes[1]
    alone = plot.body_view(gait, snake, view="top", phase=0.3)
    np.testing.assert_allclose(line(body, "head"), line(alone, "head"), atol=1e-9)
    assert len(draw(data, "bends").figure.axes) == 10
    assert len(draw(data, "waves").figure.axes) == 4


def test_a_component_is_drawn_over_time(saved):
    data = open_dataset(saved)
    ax = draw(data, "velocity", at={"axis": "z"}).figure.axes[0]
    np.testing.assert_array_equal(ax.lines[0].get_ydata(), data["velocity"].values[:, 2])
    assert ax.get_ylabel() == "velocity, z (m/s)"
    assert draw(data, "angles").figure.axes[0].get_ylabel() == "angle (°)"
    assert draw(data, "position").figure.axes[0].get_ylabel() == "height, z (m)"


# Sweeps


def sweep_of(names, kind="f", cases=False):
    """A made-up sweep: over a grid of the names, three values each, or six cases."""
    rng = np.random.default_rng(0)
    dims = ("case",) if cases else tuple(names)
    shape = (6,) if cases else (3,) * len(names)
    coords = {n: (("case",) if cases else n, np.linspace(1, 1.5, shape[0])) for n in names}
    data = xr.Dataset(
        {
            "outcome": (dims, np.zeros(shape, int)),
            "path_length": (dims, rng.uniform(1, 5, shape), {"units": "m"}),
            "landing_point": ((*dims, "axis"), rng.uniform(1, 5, (*shape, 3)), {"units": "m"}),
        },
        coords={**coords, "axis": ["x", "y", "z"]},
    )
    return stamp(data, {}, "glides")


@pytest.mark.parametrize(
    ("names", "cases", "said", "axes"),
    [
        (["d_psi"], False, "landing_point, axis y over d_psi", 1),
        (["nu_theta", "d_psi"], False, "landing_point, axis y over d_psi and nu_theta", 2),
        (["nu_theta", "d_psi", "psi_m"], False, "share of stable glides over every pair", 5),
        (["nu_theta", "d_psi"], True, "landing_point, axis y over the cases' nu_theta", 2),
    ],
)
def test_a_sweep_is_drawn_by_what_it_varies(names, cases, said, axes):
    data = sweep_of(names, cases=cases)
    drawing = draw(data)
    assert kind_of(data) == "glides"
    assert drawing.said.startswith(said)
    assert len(drawing.figure.axes) == axes


def test_variables_and_dimensions_of_a_sweep_are_chosen():
    data = sweep_of(["nu_theta", "d_psi", "psi_m"])
    drawing = draw(data, "path_length", x="psi_m", y="nu_theta", at={"d_psi": 1.25})
    assert drawing.said == "path_length, d_psi 1.25 over psi_m and nu_theta"
    (mesh,) = (c for c in drawing.figure.axes[0].collections if isinstance(c, QuadMesh))
    wanted = data["path_length"].sel(d_psi=1.25).transpose("nu_theta", "psi_m")
    assert np.array_equal(mesh.get_array(), wanted.values)
    with pytest.raises(ValueError, match=r"also over nu_theta: choose one of 1, 1\.25, 1\.5"):
        draw(data, "path_length")
    everything = {"nu_theta": 1.0, "d_psi": 1.0, "psi_m": 1.0}
    with pytest.raises(ValueError, match="a single number"):
        draw(data, "path_length", at=everything)


@pytest.fixture
def store(tmp_path, monkeypatch):
    """A store of six glides in chunks of two, the last chunk not there yet."""
    monkeypatch.setattr("jaxglide.ensemble.store._GLIDES", 2)
    study = Study({"nu_theta": [1.0, 1.2, 1.4], "d_psi": [0, 10]}, setup={"nodes": 8})
    with opened(tmp_path / "part.zarr", study) as kept:
        for chunk in (0, 1):
            fill = {n: np.zeros((2, *a.shape), a.dtype) for n, a in kept.layout.items()}
            fill["path_length"][:] = 1.0 + chunk
            kept.write(chunk, fill)
    return kept


def test_a_store_is_drawn_as_far_as_it_goes(store, capsys, tmp_path):
    data = open_dataset(store.path)
    assert (data.attrs["computed"], data.attrs["total"]) == (4, 6)
    assert np.array_equal(data["outcome"].values, [[0, 0], [0, 0], [-1, -1]])
    assert np.isnan(data["path_length"].values[2]).all()
    assert np.array_equal(data["path_length"].values[:2], [[1, 1], [2, 2]])
    out = tmp_path / "part.png"
    code, told, _ = run(capsys, store.path, "--variable", "path_length", "--out", out)
    assert code == 0
    assert "is not finished: 4 of 6 glides are there" in told
    assert out.stat().st_size > 5000


def edit(file, old, new):
    text = file.read_text()
    assert old in text
    file.write_text(text.replace(old, new))


@pytest.mark.parametrize(
    ("file", "old", "new", "said"),
    [
        ("zarr.json", "1.4]", "1.5]", "chunk 0 does not match its digest"),
        ("zarr.json", "float64", "float32", "its [a-z_]+/zarr.json is not what"),
        ("zarr.json", "float64", "float16", "its study cannot be read .precision float16"),
        ("zarr.json", "nu_theta", "wings", "chunk 0 does not match its digest"),
        ("zarr.json", "sweep 3", "sweep 1", "not a store that this version"),
        ("time/zarr.json", "[6]", "[1000000000000000]", "its time/zarr.json is not what"),
        ("time/zarr.json", '"bytes"', '"pickle"', "its time/zarr.json is not what"),
    ],
)
def test_an_edited_store_is_refused(store, file, old, new, said):
    edit(store.path / file, old, new)
    with pytest.raises(ValueError, match=rf"part\.zarr.*{said}"):
        open_dataset(store.path)


def test_a_damaged_or_empty_store_is_refused(store, tmp_path):
    (store.path / "path_length" / "c" / "0").write_bytes(bytes(16))
    with pytest.raises(ValueError, match=r"part\.zarr.*chunk 0 does not match its digest"):
        open_dataset(store.path)
    shutil.rmtree(store.path / "digest" / "c")
    with pytest.raises(ValueError, match=r"part\.zarr holds no finished batch yet"):
        open_dataset(store.path)
    (tmp_path / "nothing.zarr").mkdir()
    with pytest.raises(ValueError, match=r"cannot read .*nothing\.zarr"):
        open_dataset(tmp_path / "nothing.zarr")


def test_a_study_larger_than_memory_is_refused_at_once(store):
    values = ", ".join(map(str, np.linspace(1, 1.5, 3000)))
    for given in ("[0.0, 10.0]", "[1.0, 1.2, 1.4]"):
        edit(store.path / "zarr.json", given, f"[{values}]")
    edit(store.path / "zarr.json", '\\"times\\": null', f'\\"times\\": [{values}]')
    with pytest.raises(ValueError, match="more than half of this machine's memory"):
        check_memory("part.zarr", 10**15)
    with pytest.raises(ValueError, match=r"part\.zarr holds .* GB: more than half"):
        open_dataset(store.path)


@pytest.fixture
def kept(tmp_path):
    """A dataset written as Zarr 3 by xarray, with a name along an axis."""
    data = sweep_of(["nu_theta", "d_psi"])
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        data.to_zarr(tmp_path / "kept.zarr", zarr_format=3, consolidated=False)
    return tmp_path / "kept.zarr"


@pytest.mark.filterwarnings("ignore::zarr.errors.UnstableSpecificationWarning")
def test_a_dataset_kept_as_zarr_is_read_too(kept):
    assert draw(open_dataset(kept)).said == draw(sweep_of(["nu_theta", "d_psi"])).said


@pytest.mark.parametrize(
    ("change", "said"),
    [
        ("codec", "it needs pickle, which is not opened"),
        ("inner", "it needs pickle, which is not opened"),
        ("copy", "it needs pickle, which is not opened"),
        ("type", "it holds object, which is not opened"),
        ("size", "more than half of this machine's memory"),
        ("chunk", "more than half of this machine's memory"),
        ("transformer", "it needs a storage transformer"),
        ("link", "it holds a link"),
        ("old", "it holds Zarr 2; only Zarr 3"),
    ],
)
def test_what_could_run_code_is_not_opened(kept, monkeypatch, change, said):
    """It is refused before a library sees it."""
    described = kept / "path_length" / "zarr.json"
    node = json.loads(described.read_text())
    if change in ("codec", "inner", "copy"):
        node["codecs"].append({"name": "pickle", "configuration": {}})
    elif change == "type":
        node["data_type"] = "object"
    elif change == "size":
        node["shape"] = [10**9, 10**6]
    elif change == "chunk":
        node["chunk_grid"]["configuration"]["chunk_shape"] = [10**9, 10**6]
    elif change == "transformer":
        node["storage_transformers"] = [{"name": "other"}]
    if change == "inner":
        (kept / "below" / "deeper").mkdir(parents=True)
        described = kept / "below" / "deeper" / "zarr.json"
    elif change == "copy":
        described = kept / "zarr.json"
        group = json.loads(described.read_text())
        group["consolidated_metadata"] = {"metadata": {"path_length": node}}
        node = group
    described.write_text(json.dumps(node))
    if change == "link":
        (kept / "elsewhere").symlink_to("/")
    elif change == "old":
        (kept / "below").mkdir()
        (kept / "below" / ".zarray").write_text("{}")
    monkeypatch.setattr(xr, "open_zarr", None)
    with pytest.raises(ValueError, match=rf"kept\.zarr.*{said}"):
        open_dataset(kept)


# Other kinds


def history():
    """A made-up history of two starts and three steps."""
    rng, each = np.random.default_rng(1), ("step", "start")
    names = ["nu_theta", "d_psi"]
    about = {"units": "m", "long_name": "landing_distance"}
    data = xr.Dataset(
        {
            "point": ((*each, "parameter"), rng.uniform(1, 1.5, (3, 2, 2))),
            "value": (each, rng.uniform(1, 5, (3, 2)), about),
            "violation": (each, np.zeros((3, 2))),
            "best_point": (("start", "parameter"), rng.uniform(1, 1.5, (2, 2))),
            "best_value": ("start", [4.0, 5.0], about),
            "best_violation": ("start", [0.0, 0.0]),
        },
        coords={
            "parameter": names,
            "low": ("parameter", [1.0, 1.0]),
            "high": ("parameter", [1.5, 1.5]),
        },
    )
    return stamp(data, {}, "optimisation")


def test_an_optimisation_is_its_search_or_its_paths():
    data = history()
    assert kind_of(data) == "optimisation"
    assert draw(data).figure.axes[0].get_xlabel() == "step"
    drawing = draw(data, x="d_psi", y="nu_theta")
    assert drawing.said == "paths of the starts over d_psi and nu_theta"
    assert drawing.figure.axes[0].get_xlabel() == r"$d_\psi$ (° per SVL)"
    assert draw(data, "violation").said == "violation over start and step"


def test_held_glides_are_moments_in_time_or_by_bend():
    rng = np.random.default_rng(2)
    dims, inner = ("d_psi", "nu_theta"), ("record", "phase", "about")
    moments = rng.normal(size=(2, 2, 4, 5, 3))
    data = xr.Dataset(
        {
            "outcome": (dims, np.zeros((2, 2), int)),
            "last": (dims, np.full((2, 2), 3)),
            "aerodynamic": ((*dims, *inner), moments, {"units": "N mm"}),
            "inertial": ((*dims, *inner), moments),
            "mean_moment": ((*dims, "record", "about"), moments.mean(-2)),
        },
        coords={
            "d_psi": [0.0, 10.0],
            "nu_theta": [1.0, 1.4],
            "record": [0.0, 0.1, 0.2, 0.3],
            "about": ["pitch", "roll", "yaw"],
        },
    )
    data = marked(data, "held glides")
    assert kind_of(data) == "held glides"
    assert draw(data).said == "mean pitch moment by bend and shape"
    one = data.stack(case=dims, create_index=False).isel(case=[2]).transpose("case", ...)
    assert draw(one).said == "moments in time of the first case"
    drawing = draw(one, "aerodynamic", at={"about": "roll"})
    (mesh,) = (c for c in drawing.figure.axes[0].collections if isinstance(c, QuadMesh))
    assert np.array_equal(mesh.get_array(), moments[1, 0, ..., 1])
    assert drawing.figure.axes[1].get_ylabel() == "roll aerodynamic (N mm)"


def test_measured_flights_are_their_gaits():
    rng = np.random.default_rng(3)
    names = ("mass", "nu_theta", "f_theta", "theta_m", "psi_m", "d_psi", "nu_psi", "f_psi")
    data = xr.Dataset(
        {name: ("trial", rng.uniform(1, 2, 6)) for name in names},
        coords={"trial": list("abcdef"), "snake": ("trial", list("uuvvww"))},
    )
    data["variance"] = (("trial", "wave", "mode"), rng.uniform(0, 1, (6, 2, 2)))
    data = marked(data, "measured flights")
    assert kind_of(data) == "measured flights"
    assert draw(data).figure.axes[1].get_ylabel() == r"horizontal amplitude, $\theta_m$ (°)"


def test_the_shape_space_is_its_heat_maps():
    data = sweep_of(["f_theta", "theta_m", "nu_theta"])
    data["height_lost"] = data["path_length"] + 1.0
    data = data.assign_coords(region=(("theta_m", "nu_theta"), np.full((3, 3), "observed")))
    data = marked(data, "shape space")
    assert kind_of(data) == "shape space"
    assert len(draw(data).figure.axes) == 8
    assert draw(data, "path_length", at={"f_theta": 1.0}).said.endswith("nu_theta and theta_m")


# The command


def test_the_picture_goes_to_the_current_folder(saved, capsys, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    before = dict(matplotlib.rcParams)
    code, told, complaint = run(capsys, saved, "--variable", "lift")
    assert (code, complaint) == (0, "")
    assert told.splitlines() == ["drew lift over time and body", "wrote glide.png"]
    assert (tmp_path / "glide.png").stat().st_size > 10_000
    assert dict(matplotlib.rcParams) == before


@pytest.mark.parametrize(
    ("options", "message"),
    [
        (["--variable", "lifts"], "there is no variable 'lifts' to draw: position, velocity"),
        (["--variable", "velocity"], "also over axis: choose one of x, y, z"),
        (["--variable", "velocity", "--at", "axis"], "--at 'axis' is not NAME=VALUE"),
        (["--variable", "velocity", "--at", "axis=w"], "axis = w is not there: x, y, z"),
        (["--variable", "lift", "--x", "axis", "--y", "node"], "not over 'axis'"),
        (["--out", "nowhere/lift.png"], "there is no folder nowhere"),
        (["--out", "lift.txt"], "--out lift.txt: the name must end in .png"),
    ],
)
def test_mistakes_are_named(saved, capsys, options, message):
    code, told, complaint = run(capsys, saved, *options)
    assert (code, told) == (2, "")
    assert message in complaint
    if "--out" not in options and "--at" not in options:
        assert "glide.nc" in complaint


def test_files_that_are_no_results_are_named(saved, capsys, tmp_path):
    code, _, complaint = run(capsys, tmp_path / "gone.nc")
    assert (code, complaint) == (1, f"jaxglide: there is no {tmp_path / 'gone.nc'}\n")
    text, cut, other = (tmp_path / name for name in ("text.nc", "cut.nc", "other.nc"))
    text.write_text("not data")
    cut.write_bytes(saved.read_bytes()[:4000])
    xr.Dataset({"a": ("b", [1.0])}).to_netcdf(other, engine="h5netcdf")
    for path, message in ((text, "cannot read"), (cut, "damaged"), (other, "not a result of")):
        code, _, complaint = run(capsys, path, "--out", tmp_path / "x.png")
        assert code == 2
        assert message in complaint
        assert str(path) in complaint
    assert not (tmp_path / "x.png").exists()
