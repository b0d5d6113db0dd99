"""References that Sphinx does not find itself: other projects' names, without fetching their
inventories, as the build needs no network; and names of ours without their module."""

import sys

from docutils import nodes
from sphinx.addnodes import desc_signature
from sphinx.util.nodes import make_refnode

_PAGES = {
    "diffrax.Dopri5": "https://docs.kidger.site/diffrax/api/solvers/ode_solvers/#diffrax.Dopri5",
    "diffrax.ForwardMode": "https://docs.kidger.site/diffrax/api/adjoints/#diffrax.ForwardMode",
    "diffrax.RecursiveCheckpointAdjoint": "https://docs.kidger.site/diffrax/api/adjoints/"
    "#diffrax.RecursiveCheckpointAdjoint",
    "diffrax.diffeqsolve": "https://docs.kidger.site/diffrax/api/diffeqsolve/",
    "equinox.Module": "https://docs.kidger.site/equinox/api/module/module/",
    "equinox.filter_jit": "https://docs.kidger.site/equinox/api/transformations/",
    "jax.Array": "https://docs.jax.dev/en/latest/_autosummary/jax.Array.html",
    "jax.grad": "https://docs.jax.dev/en/latest/_autosummary/jax.grad.html",
    "jax.hessian": "https://docs.jax.dev/en/latest/_autosummary/jax.hessian.html",
    "jax.jacfwd": "https://docs.jax.dev/en/latest/_autosummary/jax.jacfwd.html",
    "jax.jacrev": "https://docs.jax.dev/en/latest/_autosummary/jax.jacrev.html",
    "jax.jit": "https://docs.jax.dev/en/latest/_autosummary/jax.jit.html",
    "jax.jvp": "https://docs.jax.dev/en/latest/_autosummary/jax.jvp.html",
    "jax.vjp": "https://docs.jax.dev/en/latest/_autosummary/jax.vjp.html",
    "jax.vmap": "https://docs.jax.dev/en/latest/_autosummary/jax.vmap.html",
    "numpy.ndarray": "https://numpy.org/doc/stable/reference/generated/numpy.ndarray.html",
    "xarray.DataArray": "https://docs.xarray.dev/en/stable/generated/xarray.DataArray.html",
    "xarray.Dataset": "https://docs.xarray.dev/en/stable/generated/xarray.Dataset.html",
}
# docstrings name them without their package
_PAGES |= {name.rpartition(".")[2]: page for name, page in _PAGES.items()}
_PYTHON = {"ValueError", "TypeError", "OSError", "KeyboardInterrupt", "ImportError", "object"}


def resolve(app, env, node, content):
    """A link to a page of another project, or None."""
    target = node.get("reftarget", "")
    if target in _PYTHON:
        address = f"https://docs.python.org/3/library/exceptions.html#{target}"
    elif target in _PAGES:
        address = _PAGES[target]
    else:
        return _last_name(app, env, node, content, target)
    link = nodes.reference("", "", internal=False, refuri=address)
    link.append(content)
    return link


def _last_name(app, env, node, content, target):
    """A link to the one thing of the reference whose last name is the target, or None."""
    domain = env.get_domain("py")
    found = [name for name in domain.objects if name.rpartition(".")[2] == target]
    if len(found) != 1 or node.get("refdomain") != "py":
        return None
    page = domain.objects[found[0]]
    return make_refnode(app.builder, node["refdoc"], page.docname, page.node_id, content)


def mark(app, doctree):
    """Anchors by the facade's path and by the full one: pages of source link to either."""
    for signature in doctree.findall(desc_signature):
        module, name = signature.get("module") or "", signature.get("fullname")
        if not module.startswith("jaxglide"):
            continue
        found = getattr(sys.modules.get(module), name.partition(".")[0], None)
        for place in ("jaxglide", getattr(found, "__module__", module)):
            if f"{place}.{name}" not in signature["ids"]:
                signature["ids"].append(f"{place}.{name}")


def setup(app):
    app.connect("doctree-read", mark)
    app.connect("missing-reference", resolve)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
