"""The house: imports only go up, no circles, no side effects, every public name explained."""

import ast
import inspect
import pathlib
import re
import subprocess
import sys

import pytest

import jaxglide

ROOT = pathlib.Path(jaxglide.__file__).resolve().parent
FLOORS = {
    "_types": 0,
    "_numerics": 0,
    "_checks": 0,
    "_datasets": 0,
    "_documents": 0,
    "_files": 0,
    "_modes": 0,
    "_netcdf": 0,
    "_units": 0,
    "parameters": 0,
    "environment": 1,
    "attitude": 1,
    "snake": 1,
    "gait": 1,
    "polar": 1,
    "kinematics": 2,
    "aerodynamics": 2,
    "inertia": 2,
    "dynamics": 3,
    "launch": 3,
    "_peaks": 4,
    "cases": 4,
    "glide": 4,
    "glide_polar": 4,
    "trim": 4,
    "windtunnel": 4,
    "_ascent": 5,
    "_history": 5,
    "_journal": 5,
    "_objective": 5,
    "_polish": 5,
    "_search": 5,
    "_study_file": 5,
    "batch": 5,
    "cluster": 5,
    "comparison": 5,
    "extrapolation": 5,
    "fit": 5,
    "flights": 5,
    "objectives": 5,
    "optimise": 5,
    "problem": 5,
    "published": 5,
    "records": 5,
    "store": 5,
    "study": 5,
    "survey": 5,
    "sweep": 5,
    "__init__": 5,  # its names are those of floors 1 to 4; used by what stands above
    "plot": 6,
    "view": 6,
    "cli": 7,
}
# Methods for convenience that import from a floor above, in their bodies only.
LAZY = {("glide", "view")}
APART = {"measured"}  # imports nothing of the model, but for what reads files
READERS = {
    "_documents",
    "_units",
}  # which load neither JAX nor any other module of this package
MODULES = sorted(ROOT.rglob("*.py"))


def top(path):
    """The module or package directly below jaxglide that a file belongs to."""
    return path.relative_to(ROOT).with_suffix("").parts[0]


def imported(node, path):
    """Modules directly below jaxglide that an import statement names."""
    if isinstance(node, ast.Import):
        names = [alias.name.split(".") for alias in node.names]
        return [name[1] if name[1:] else "__init__" for name in names if name[0] == "jaxglide"]
    if node.level:
        package = list(path.relative_to(ROOT.parent).parent.parts)
        package = package[: len(package) - node.level + 1]
    else:
        package = []
    package += node.module.split(".") if node.module else []
    if package[0] != "jaxglide":
        return []
    if package[1:]:
        return [package[1]]
    files = {top(module) for module in MODULES}
    return [alias.name if alias.name in files else "__init__" for alias in node.names]


def statements(tree):
    """Import statements anywhere, inside functions too, but for those of type checkers."""
    for node in ast.iter_child_nodes(tree):
        if isinstance(node, ast.If) and "TYPE_CHECKING" in ast.unparse(node.test):
            continue
        if isinstance(node, ast.Import | ast.ImportFrom):
            yield node
        yield from statements(node)


@pytest.fixture(scope="module")
def edges():
    """Pairs (module, imported module) among the modules of jaxglide."""
    found = set()
    for path in MODULES:
        for node in statements(ast.parse(path.read_text())):
            found |= {(top(path), name) for name in imported(node, path)}
    assert found >= LAZY
    return {(a, b) for a, b in found - LAZY if a != b}


def test_every_module_has_a_floor():
    assert {top(path) for path in MODULES} <= FLOORS.keys() | APART
    assert {"dynamics", "glide"} <= {top(path) for path in MODULES}


def test_imports_only_go_up(edges):
    above = {(a, b) for a, b in edges if not {a, b} & APART and FLOORS[b] > FLOORS[a]}
    assert not above, f"imports from a floor above: {sorted(above)}"
    assert ("dynamics", "aerodynamics") in edges  # the walk sees something
    assert ("plot", "glide") in edges
    assert ("batch", "glide") in edges


def test_there_are_no_circles(edges):
    """Strip modules that import nothing or that nothing imports: only circles are left."""
    left = set(edges)
    while True:
        importers, used = {a for a, _ in left}, {b for _, b in left}
        kept = {(a, b) for a, b in left if b in importers and a in used}
        if kept == left:
            break
        left = kept
    assert not left, f"circle: {sorted(left)}"


def test_what_stands_apart_imports_nothing_of_the_model(edges):
    assert {b for a, b in edges if a in APART} <= READERS
    assert not {(a, b) for a, b in edges if a in READERS - {b}}
    users = {a for a, b in edges if b in APART}
    assert users <= {"plot", "cli"}, f"the model imports what stands apart: {sorted(users)}"


def test_docstrings_cite_what_a_reader_can_find():
    """The paper's equations and figures, not pages or numbers that are not here."""
    cited = re.compile(r"\bMODEL\b|\(floor \d")
    found = [path.name for path in MODULES if cited.search(path.read_text())]
    assert MODULES
    assert not found


def test_importing_changes_nothing():
    """In a fresh process: JAX's settings stay, and nothing heavy that is not needed loads."""
    code = """
import sys, jax
before = dict(jax.config.values)
import jaxglide
for name in jaxglide.__all__:
    getattr(jaxglide, name)
after = jax.config.values
assert before
changed = [name for name in before if before[name] != after[name]]
assert not changed, changed
assert not jax.config.jax_enable_x64
heavy = {"matplotlib", "xarray", "dask", "jaxglide.plot", "jaxglide.view", "jaxglide.cli"}
heavy &= set(sys.modules)
assert not heavy, heavy
"""
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True)
    assert done.returncode == 0, done.stderr


@pytest.mark.parametrize("name", jaxglide.__all__)
def test_every_public_name_is_explained(name):
    thing = getattr(jaxglide, name)
    doc = inspect.getdoc(thing)
    assert doc
    assert len(doc) > 30
    assert not doc.startswith(f"{name}(")  # a generated signature is no explanation
    assert doc.split("\n")[0].rstrip().endswith((".", ":", ",")) or "\n" in doc
    for method, value in vars(thing).items() if inspect.isclass(thing) else ():
        plain = inspect.unwrap(getattr(value, "__func__", value))
        if method.startswith("_") or not (callable(plain) or isinstance(value, property)):
            continue
        if isinstance(value, int):  # members of an enumeration
            continue
        assert inspect.getdoc(value), f"{name}.{method} says nothing"


def test_all_lists_every_public_name_and_no_other():
    assert sorted(jaxglide.__all__) == list(jaxglide.__all__)
    assert set(jaxglide.__all__) <= set(dir(jaxglide))
    with pytest.raises(AttributeError, match="no attribute 'nothing'"):
        jaxglide.nothing  # noqa: B018
