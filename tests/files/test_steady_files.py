"""Files of steady glides: back to the bit, and what is no such file refused in one sentence."""

import dataclasses

import jax
import numpy as np
import pytest
import xarray as xr
from hypothesis import given, settings
from hypothesis import strategies as st
from made_steady import made_steady

import jaxglide
from jaxglide import StillAir, UniformWind
from jaxglide.files import steady_dataset, steady_of


def same(one, other):
    """Whether two modules are the same, to the bit."""
    leaves = [jax.tree.leaves(it) for it in (one, other)]
    return jax.tree.structure(one) == jax.tree.structure(other) and all(
        (a.dtype, a.shape, a.tobytes()) == (b.dtype, b.shape, b.tobytes())
        for a, b in zip(*[map(np.asarray, them) for them in leaves], strict=True)
    )


def windy():
    glide = made_steady(0.5, 1.2)
    glider = dataclasses.replace(glide.glider, air=UniformWind([1.0, -2.0, 0.5]))
    return dataclasses.replace(glide, glider=glider, frozen=True)


def averaged():
    return dataclasses.replace(made_steady(), averaged=True)


@pytest.mark.parametrize(
    "make", [made_steady, windy, averaged, lambda: made_steady(found=False)]
)
def test_one_comes_back_to_the_bit(tmp_path, make):
    first = make()
    again = jaxglide.open(jaxglide.save(first, tmp_path / "it.nc"))
    assert same(again, first)
    assert str(again) == str(first)
    assert not same(again, made_steady(radius=0.8))


@pytest.mark.parametrize("count", [1, 3])
def test_several_come_back_as_several(tmp_path, count):
    glides = tuple(made_steady(0.1 * k, 0.5 + 0.1 * k) for k in range(count))
    again = jaxglide.open(jaxglide.save(glides, tmp_path / "them.nc"))
    assert isinstance(again, tuple)
    assert len(again) == count
    assert all(same(a, b) for a, b in zip(again, glides, strict=True))


def test_the_file_says_what_it_holds(tmp_path):
    glide = made_steady()
    jaxglide.save(glide, tmp_path / "it.nc")
    with xr.open_dataset(tmp_path / "it.nc", engine="h5netcdf") as data:
        assert data.attrs["format"] == "jaxglide steady glide 2"
        assert data["glide_angle"].attrs["units"] == "rad"
        assert data["turn_rate"].attrs["units"] == "rad/s"
        assert data["nu_theta"].item() == pytest.approx(float(glide.glider.gait.nu_theta))
        assert "height" not in data.variables
        assert data["reason"].attrs["flag_meanings"].startswith("found not_converged")
        modulus = np.hypot(data["multiplier_real"], data["multiplier_imaginary"])
        assert modulus.max().item() == pytest.approx(float(glide.spectral_radius), rel=1e-15)


def test_what_is_cut_off_is_refused(tmp_path):
    path = jaxglide.save(made_steady(), tmp_path / "it.nc")
    whole = path.read_bytes()
    for share in (0.1, 0.5, 0.99):
        path.write_bytes(whole[: int(share * len(whole))])
        with pytest.raises(ValueError, match=r"cannot read .*it\.nc: it is damaged") as caught:
            jaxglide.open(path)
        assert "\n" not in str(caught.value)


def other_glider():
    glider = dataclasses.replace(made_steady().glider, air=StillAir(air_density=1.0))
    return made_steady(), dataclasses.replace(made_steady(), glider=glider)


@pytest.mark.parametrize(
    ("make", "error", "said"),
    [
        (other_glider, ValueError, "2 steady glides: it is of different gliders"),
        (lambda: (), ValueError, "0 steady glides: it is empty"),
        (lambda: (made_steady(), averaged()), ValueError, "of different gliders or models"),
        (lambda: (made_steady(), 1.0), TypeError, "result must be of type SteadyGlide"),
        (
            lambda: jax.tree.map(lambda leaf: np.stack([leaf, leaf]), made_steady()),
            ValueError,
            r"a batch of steady glides of shape \(2,\)",
        ),
    ],
)
def test_what_cannot_be_saved_is_refused(tmp_path, make, error, said):
    with pytest.raises(error, match=said):
        jaxglide.save(make(), tmp_path / "it.nc")


def without(name):
    return lambda data: data.drop_vars(name)


def holding(name, value):
    return lambda data: data.assign({name: data[name] * 0 + value})


@pytest.mark.parametrize(
    ("change", "said"),
    [
        (without("slopes"), "have no variable 'slopes'"),
        (without("multiplier_real"), "have no variable 'multiplier_real'"),
        (lambda data: data.isel(mode=slice(3)), "it has 3 multipliers, not 8"),
        (lambda data: data.isel(component=slice(3)), "'component' has entries"),
        (holding("sink_rate", np.nan), "sink_rate is not a number, though it says that one"),
        (holding("speed", np.inf), "speed = inf m/s"),
        (holding("reason", 17), "reason = 17 .*is not allowed"),
        (lambda data: data.drop_attrs(), "it says no format"),
        (lambda data: data.assign_attrs(format="jaxglide fit 2"), "of the kind 'fit'"),
        (lambda data: data.assign_attrs(parts="{}"), "it lacks 'glider'"),
        (lambda data: data.assign_attrs(parts="os.system"), "no JSON text"),
        (lambda data: data.assign_attrs(frozen="maybe"), "invalid literal for int"),
    ],
)
def test_what_is_no_steady_glide_is_refused_in_one_sentence(change, said):
    data = change(steady_dataset(made_steady()))
    with pytest.raises(
        ValueError, match=f"this is not a whole steady glide: .*{said}"
    ) as caught:
        steady_of(data)
    assert "\n" not in str(caught.value)


@settings(max_examples=40, deadline=None)
@given(data=st.data())
def test_any_variable_may_be_missing_or_of_another_shape(data):
    good = steady_dataset(made_steady())
    needed = sorted({*good.data_vars} - {"path_length"})
    name = data.draw(st.sampled_from(needed))
    change = data.draw(st.sampled_from(["drop", "text", "shape"]))
    bad = good.drop_vars(name)
    if change == "text":
        bad = bad.assign({name: (good[name].dims, np.full(good[name].shape, "x"))})
    elif change == "shape":
        bad = bad.assign({name: ("elsewhere", np.zeros(3))})
    with pytest.raises(ValueError, match=f"not a whole steady glide: .*'{name}'"):
        steady_of(bad)
