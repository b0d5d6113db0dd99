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
ROOMS = (  # from the ground up: a room imports from those before it
    "_lib",
    "body",
    "shape",
    "air",
    "loads",
    "flight",
    "tunnel",
    "steady",
    "control",
    "ensemble",
    "search",
    "flights",
    "files",
    "plot",
    "view",
    "cli",
)
APART = "measured"  # imports nothing of the model, but for what reads files
READERS = {
    "_lib.columns",
    "_lib.documents",
    "_lib.formats",
    "_lib.progress",
    "_lib.units",
    "_lib.version",
}  # which load neither JAX nor any other module

MODULES = sorted(ROOT.rglob("*.py"))


def module(path):
    """A file's name below jaxglide, such as `flight.glide`, or `flight` for the room itself."""
    parts = path.relative_to(ROOT).with_suffix("").parts
    return ".".join(parts[:-1] if parts[-1] == "__init__" else parts)


NAMES = {module(path) for path in MODULES}


def room(name):
    return name.split(".")[0]


def imported(node, path):
    """Modules of jaxglide, by their names below it, that an import statement names."""
    if isinstance(node, ast.Import):
        names = [alias.name.split(".") for alias in node.names]
        return [".".join(name[1:]) for name in names if name[0] == "jaxglide"]
    package = []
    if node.level:
        package = list(path.relative_to(ROOT.parent).parent.parts)
        package = package[: len(package) - node.level + 1]
    package += node.module.split(".") if node.module else []
    if package[0] != "jaxglide":
        return []
    base = package[1:]
    below = {".".join([*base, alias.name]) for alias in node.names} & NAMES
    return list(below) or [".".join(base)]


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
            found |= {(module(path), name) for name in imported(node, path)}
    return {(a, b) for a, b in found if a != b and a}


def test_every_file_is_in_a_room():
    found = {room(name) for name in NAMES} - {""}
    assert found <= {*ROOMS, APART}
    assert {"flight.dynamics", "flight.glide"} <= NAMES


def test_imports_only_go_down(edges):
    inside = {(a, b) for a, b in edges if APART not in (room(a), room(b))}
    up = {(a, b) for a, b in inside if not b or ROOMS.index(room(b)) > ROOMS.index(room(a))}
    assert not up, f"imports from a room above: {sorted(up)}"
    assert ("flight.dynamics", "loads.aerodynamics") in edges  # the walk sees something
    assert ("ensemble.batch", "flight.glide") in edges


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
    assert {b for a, b in edges if room(a) == APART and room(b) != APART} <= READERS
    assert not {(a, b) for a, b in edges if a in READERS and b not in READERS}
    users = {room(a) for a, b in edges if room(b) == APART} - {APART}
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

def loaded(*heavy):
    return set(heavy) & set(sys.modules)

for name in ("Snake", "TabulatedBody", "Gait", "Driven", "Gust", "Polar", "AngleLimit", "open"):
    getattr(jaxglide, name)
jaxglide.simulate, jaxglide.trim
assert not loaded("xarray", "scipy", "jaxglide.ensemble"), "for one glide"
for name in jaxglide.__all__:
    getattr(jaxglide, name)
assert loaded("xarray")
heavy = loaded("matplotlib", "dask", "jaxglide.plot", "jaxglide.view", "jaxglide.cli")
assert not heavy, heavy
after = jax.config.values
assert before
changed = [name for name in before if before[name] != after[name]]
assert not changed, changed
assert not jax.config.jax_enable_x64
"""
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True)
    assert done.returncode == 0, done.stderr


def test_no_two_modules_define_public_classes_of_one_name():
    found: dict[str, list[str]] = {}
    for path in MODULES:
        for node in ast.parse(path.read_text()).body:
            if isinstance(node, ast.ClassDef) and not node.name.startswith("_"):
                found.setdefault(node.name, []).append(module(path))
    assert found["Glider"] == ["flight.dynamics"]
    assert {name: where for name, where in found.items() if where[1:]} == {}


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
    with pytest.raises(AttributeError, match="nothing"):
        jaxglide.nothing  # noqa: B018


def test_functions_and_files_are_short():
    """No function over 60 lines, its docstring aside; no file over 400."""
    long = [path.name for path in MODULES if len(path.read_text().splitlines()) > 400]
    for path in MODULES:
        for node in ast.walk(ast.parse(path.read_text())):
            if isinstance(node, ast.FunctionDef):
                told = ast.get_docstring(node) is not None and node.body[1:]
                begin = node.body[1].lineno if told else node.lineno
                if node.end_lineno - begin >= 60:
                    long.append(f"{path.name}:{node.name}")
    assert not long
