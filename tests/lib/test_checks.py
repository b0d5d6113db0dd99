"""The shared checks of arguments."""

import pathlib
import warnings

import jax

import jaxglide
from jaxglide._lib.checks import warn_float32


def through_the_package():
    """A function of the package that calls `warn_float32`."""
    made = pathlib.Path(jaxglide.__file__).parent / "plot" / "made_up.py"
    names = {"warn_float32": warn_float32}
    exec(compile("def inner(*arguments):\n    warn_float32(*arguments)", made, "exec"), names)
    return names["inner"]


def test_the_warning_of_float32_names_the_users_line_once():
    inner = through_the_package()
    with jax.enable_x64(False), warnings.catch_warnings(record=True) as said:
        warnings.simplefilter("default")
        for _ in range(3):
            warn_float32(1e-7, 1e-6)
            inner(1e-5, 1e-6)
        warn_float32(1e-5, 1e-5)
        jax.jit(lambda rtol: warn_float32(rtol, 1e-6))(1e-7)
    lines = [one.lineno for one in said]
    assert lines == [lines[0], lines[0] + 1]
    assert {one.filename for one in said} == {__file__}
    assert "rtol = 1e-05, atol = 1e-06 are too tight for float32" in str(said[1].message)


def test_float64_needs_no_warning():
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        warn_float32(1e-12, 1e-12)
