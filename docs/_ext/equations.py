"""Equations: as MathML, which browsers draw by themselves; numbered as in the paper; cited.

A label `eq-23` gives the equation the number 23, `eq-actuator` the name "actuator". Where a
docstring says "eq. 23" or "eqs 14-15", each number links to the theory.
"""

import re

from docutils.nodes import SkipNode
from latex2mathml.converter import convert
from sphinx.domains.math import MathDomain

_CITED = re.compile(
    r"\b(?P<word>eqs?\.?\s+)(?=\d)(?P<list>\d+(?:(?:[-–]|,\s+)\d+)*)"  # noqa: RUF001
)


class PaperNumbers(MathDomain):
    """The domain of equations, but their numbers come from their labels."""

    def note_equation(self, docname, labelid, location=None):
        super().note_equation(docname, labelid, location)
        if labelid.startswith("eq-"):
            self.equations[labelid] = (docname, labelid.removeprefix("eq-"))


def _inline(self, node):
    self.body.append(convert(node.astext()))
    raise SkipNode


def _block(self, node):
    number = node.get("number")
    self.body.append(self.starttag(node, "div", CLASS="math-block"))
    self.body.append(convert(node.astext().strip(), display="block"))
    if number is not None:
        self.body.append(f'<span class="eqno">({number})')
        self.add_permalink_ref(node, "Permalink to this equation")
        self.body.append("</span>")
    self.body.append("</div>\n")
    raise SkipNode


def cite(app, what, name, obj, options, lines):
    """Turn citations of equations in a docstring into links; a bar is a bar."""

    def links(match):
        linked = re.sub(r"\d+", lambda number: f":eq:`eq-{number[0]}`", match["list"])
        return match["word"] + linked

    words = "\n".join(lines).split("`")  # every second one is code
    words[::2] = [_CITED.sub(links, word).replace("|", r"\|") for word in words[::2]]
    lines[:] = "`".join(words).split("\n")


def setup(app):
    app.add_domain(PaperNumbers, override=True)
    app.add_html_math_renderer("mathml", (_inline, None), (_block, None))
    app.connect("autodoc-process-docstring", cite)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
