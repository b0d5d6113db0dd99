"""The cache of compiled code, asked for from Python."""

import jax
import pytest

import jaxglide


@pytest.fixture
def settings():
    """JAX's own settings, as they were, afterwards."""
    from jax.experimental.compilation_cache import compilation_cache

    names = "jax_compilation_cache_dir", "jax_persistent_cache_min_compile_time_secs"
    before = {name: getattr(jax.config, name) for name in names}
    yield
    for name, value in before.items():
        jax.config.update(name, value)
    compilation_cache.reset_cache()


@pytest.mark.usefixtures("settings")
def test_what_is_compiled_after_it_is_kept_in_the_folder(tmp_path):
    jax.jit(lambda x: x + 1)(1.0)  # JAX has looked for its cache already
    jaxglide.cache(tmp_path / "kept")
    jax.config.update("jax_persistent_cache_min_compile_time_secs", 0)
    jax.jit(lambda x: x + 2)(1.0)
    assert list((tmp_path / "kept").glob("*lambda*"))


@pytest.mark.usefixtures("settings")
def test_nobody_without_a_home_has_a_cache_by_default(monkeypatch):
    monkeypatch.setattr("jaxglide._lib.cache.cache_folder", lambda: None)
    with pytest.raises(ValueError, match="user without a home"):
        jaxglide.cache()
