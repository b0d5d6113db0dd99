"""How the site is built: `sphinx-build -W docs docs/_build`, without any network.

`-t short` leaves out what takes minutes: the tutorials, and the how-to pages that fly much.
"""

import hashlib
import os
import sys
from pathlib import Path

import jaxglide

HERE = Path(__file__).parent
sys.path.insert(0, str(HERE / "_ext"))

project = "jaxglide"
author = "the jaxglide developers"
copyright = author
release = version = getattr(jaxglide, "__version__", "0")

extensions = [
    "sphinx.ext.autodoc",
    "sphinx.ext.napoleon",
    "sphinx.ext.viewcode",
    "sphinx_copybutton",
    "myst_nb",
    "equations",  # these four: _ext/
    "outside",
    "parameters",
    "streams",
]
exclude_patterns = ["_build", "_cache", "_ext"]
nitpicky = True
# `name` in a docstring links where it is a name of the reference, and is code where it is not
default_role = "py:obj"
nitpick_ignore_regex = [("py:obj", ".*")]
suppress_warnings = ["config.cache"]

html_theme = "furo"
html_title = "jaxglide"
html_static_path = ["_static"]
html_css_files = ["site.css"]
html_show_copyright = False
copybutton_exclude = ".linenos, .gp, .go"

autodoc_member_order = "bysource"
autodoc_typehints = "none"  # docstrings give shapes and units
autodoc_preserve_defaults = True
napoleon_use_rtype = False
napoleon_use_param = False
napoleon_custom_sections = [("Attributes", "params_style")]

myst_enable_extensions = ["amsmath", "colon_fence", "deflist", "dollarmath", "fieldlist"]
myst_heading_anchors = 3
myst_dmath_double_inline = True


def _of_the_package() -> str:
    """A digest of the package: another package, other results."""
    digest = hashlib.sha256()
    for file in sorted(Path(jaxglide.__file__).parent.rglob("*.py")):
        digest.update(file.read_bytes())
    return digest.hexdigest()[:16]


# Every page that runs code is run when it, or the package, has changed.
_CACHE = HERE / "_cache"
nb_execution_mode = "cache"
nb_execution_cache_path = str(_CACHE / _of_the_package())
nb_execution_in_temp = True  # a folder of its own for every page
nb_execution_timeout = 300
nb_execution_raise_on_error = True
nb_execution_show_tb = True
nb_merge_streams = True
if tags.has("short"):  # noqa: F821
    nb_execution_excludepatterns = ["tutorials/*", "howto/*", "start.md"]
    suppress_warnings += ["myst-nb.lexer"]  # a page that has not run knows no language

# Kernels start in folders of their own; they share what JAX has compiled, and use all cores.
os.environ.setdefault("JAX_COMPILATION_CACHE_DIR", str(_CACHE / "compiled"))
os.environ.setdefault("TF_CPP_MIN_LOG_LEVEL", "3")  # what XLA says on reading its cache
os.environ.setdefault("JAX_PERSISTENT_CACHE_MIN_COMPILE_TIME_SECS", "0.5")
os.environ["PATH"] = os.pathsep.join([str(Path(sys.executable).parent), os.environ["PATH"]])
