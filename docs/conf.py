"""The site: `sphinx-build --fail-on-warning docs build/site`."""

import os
import re
import sys
from collections.abc import Iterator
from dataclasses import is_dataclass
from pathlib import Path

from docutils import nodes
from latex2mathml.converter import convert
from sphinx import addnodes
from sphinx.application import Sphinx
from sphinx.pycode import ModuleAnalyzer
from sphinx.transforms import SphinxTransform
from sphinx.writers.html5 import HTML5Translator

import tippedisk_verify
from tippedisk_verify.commands.help import load_quantities
from tippedisk_verify.display import Printable, quantities

project = "tippedisk_verify"
release = tippedisk_verify.__version__
extensions = ["myst_nb", "sphinx.ext.autodoc", "sphinx.ext.napoleon", "sphinx_click"]
html_theme = "furo"
html_title = f"tippedisk_verify {release}"
html_math_renderer = "mathml"
html_static_path = ["static"]
html_css_files = ["site.css"]
html_show_sphinx = html_copy_source = False
exclude_patterns = ["**.ipynb_checkpoints"]
highlight_language = "none"  # most examples are commands

myst_enable_extensions = ["dollarmath"]
myst_heading_anchors = 3
# The notebooks run commands: those of the environment that builds the site, active or not.
os.environ["PATH"] = os.pathsep.join([str(Path(sys.executable).parent), os.environ["PATH"]])
nb_execution_in_temp = True
nb_execution_mode = "force"  # pages show the results of this version
nb_execution_timeout = 300  # s; a cell that takes longer is stuck
nb_execution_raise_on_error = True
nb_merge_streams = True

# Single backticks in docstrings: a link where the name has a place on the site
default_role = "py:obj"
autodoc_member_order = "bysource"
autodoc_typehints = "none"  # the docstrings give types, shapes and units


# ----------------------------------------------------------------------------------------- formulas
_GREEK = "Omega|beta|gamma|delta|epsilon|eta|theta|kappa|lambda|mu|nu|xi|pi|rho|tau|phi|chi|omega"
#: Symbols in pages and docstrings (gamma_bar_0, Omega_crit, c_2, T_crit, pi), powers, and numbers
#: with an exponent, which must not be broken at a line's end.
_SYMBOL = re.compile(
    rf"(?<![\w.\\\"“])(d?)(?:({_GREEK})(_bar)?(?:_([A-Za-z]+|\d+))?|([A-Za-z])_(\d+|crit|end|G|y))('*)(?![\w(])"
    r"|(?<=[\w)])\^(-?\w+|\([^()]*\))|(?<![\w.])(\d[\d.]*e-\d+)"
)
_FUNCTION = re.compile(
    r"(<mi>(?:sin|cos|log|ln|exp)</mi>|<msup><mi>(?:sin|cos)</mi><mn>\d</mn></msup>)"
)
_BAR = re.compile(r"<mo(?=[^>]*>&#x0007C;</mo>)")


def _formula(symbol: re.Match[str]) -> nodes.Node:
    differential, greek, bar, index, letter, letter_index, primes, power, number = symbol.groups()
    if number:
        return nodes.inline("", number, classes=["pre"])
    if power:
        return nodes.superscript("", power.strip("()").replace("-", "\N{MINUS SIGN}"))
    base = rf"\{greek}".replace(r"\epsilon", r"\varepsilon") if greek else letter
    below = index or letter_index or ""
    below = rf"\mathrm{{{below}}}" if len(below) > 2 else below
    latex = (rf"\bar{base}" if bar else base) + (f"_{{{below}}}" if below else "") + primes
    return nodes.math("", f"{differential}{latex}")


class Symbols(SphinxTransform):
    """The symbols in running text as formulas; sources and docstrings stay readable in a
    terminal.
    """

    default_priority = 480
    _VERBATIM = (
        nodes.literal,
        nodes.math,
        nodes.FixedTextElement,
        nodes.raw,
        nodes.comment,
        addnodes.desc_signature,
        addnodes.literal_strong,  # names of arguments
    )

    def apply(self, **_: object) -> None:
        for table in self.document.findall(
            lambda node: "names" in getattr(node, "attributes", {}).get("classes", ())
        ):
            for row in [row for body in table.findall(nodes.tbody) for row in body]:
                for cell in row[1:3]:  # the kind and the quantity are strings of an id
                    cell[0].children = [nodes.literal("", cell.astext())]
        for text in list(self.document.findall(nodes.Text)):
            ancestor = text.parent
            while ancestor is not None and not isinstance(ancestor, self._VERBATIM):
                ancestor = ancestor.parent
            if ancestor is None and _SYMBOL.search(text.astext()):
                text.parent.replace(text, list(self._pieces(text.astext())))
        for formula in self.document.findall(nodes.math):
            after = formula.next_node(nodes.Text, descend=False, siblings=True)
            # No line begins with these
            if after is not None and after.astext()[:1] in {*",.;:?!)'"}:
                after.parent.replace(after, nodes.Text("\N{WORD JOINER}" + after.astext()))

    @staticmethod
    def _pieces(text: str) -> Iterator[nodes.Node]:
        at = 0
        for symbol in _SYMBOL.finditer(text):
            yield nodes.Text(text[at : symbol.start()])
            yield _formula(symbol)
            at = symbol.end()
        yield nodes.Text(text[at:])


def _mathml(latex: str, display: str = "inline") -> str:
    """Return a formula as MathML, with TeX's spaces after functions and none around bars."""
    spaced = _FUNCTION.sub(
        r'<mspace width="0.1em"/>\1<mspace width="0.15em"/>', convert(latex, display=display)
    )
    return _BAR.sub('<mo lspace="0" rspace="0"', spaced)


def _inline(self: HTML5Translator, node: nodes.math) -> None:
    self.body.append(_mathml(node.astext()))
    raise nodes.SkipNode


def _display(self: HTML5Translator, node: nodes.math_block) -> None:
    self.body.append(f'<div class="math">{_mathml(node.astext(), "block")}</div>')
    raise nodes.SkipNode


# ------------------------------------------------------------------------------------------ fields
def _describe_quantities(kind: type = Printable) -> None:
    """Document each field of a result by its meaning and unit."""
    for below in kind.__subclasses__():
        analyzer = ModuleAnalyzer.for_module(below.__module__)
        analyzer.analyze()
        inherited = quantities(kind) if is_dataclass(kind) else {}
        for name, known in quantities(below).items() if is_dataclass(below) else ():
            if inherited.get(name) is not known:
                analyzer.attr_docs[below.__name__, name] = [f"{known.meaning} [{known.unit}]", ""]
        _describe_quantities(below)


def setup(app: Sphinx) -> None:
    """Set up the site. Browsers draw MathML, so formulas need no script and no network."""
    app.add_html_math_renderer("mathml", (_inline, None), (_display, None))
    app.add_transform(Symbols)
    load_quantities()
    _describe_quantities()

    app.parallel = max(app.parallel, 8)  # so many processes that no two notebooks share one
