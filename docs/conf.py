"""The site: `sphinx-build --fail-on-warning docs build/site`."""

import os
import sys
from pathlib import Path

from docutils import nodes
from latex2mathml.converter import convert
from sphinx.application import Sphinx
from sphinx.writers.html5 import HTML5Translator

import tippedisk_verify

project = "tippedisk_verify"
release = tippedisk_verify.__version__
extensions = ["myst_nb", "sphinx.ext.autodoc", "sphinx_click"]
html_theme = "furo"
html_title = f"tippedisk_verify {release}"
html_math_renderer = "mathml"
html_show_sphinx = html_copy_source = False
exclude_patterns = ["**.ipynb_checkpoints"]
highlight_language = "none"  # most examples are commands

myst_enable_extensions = ["dollarmath"]
myst_heading_anchors = 3
# The notebooks run commands: those of the environment that builds the site, active or not.
os.environ["PATH"] = os.pathsep.join([str(Path(sys.executable).parent), os.environ["PATH"]])
nb_execution_in_temp = True
nb_execution_mode = "force"  # what a page shows is what this version computes
nb_execution_timeout = 300  # a cell that takes as long is stuck
nb_execution_raise_on_error = True
nb_merge_streams = True

default_role = "py:obj"  # single backticks in docstrings: a link where the name has a place on the site
autodoc_member_order = "bysource"
autodoc_typehints = "none"  # the docstrings give types, shapes and units


def _inline(self: HTML5Translator, node: nodes.math) -> None:
    self.body.append(convert(node.astext()))
    raise nodes.SkipNode


def _display(self: HTML5Translator, node: nodes.math_block) -> None:
    self.body.append(
        f'<div class="math" style="margin: 1em 0; overflow-x: auto">{convert(node.astext(), display="block")}</div>'
    )
    raise nodes.SkipNode


def setup(app: Sphinx) -> None:
    """MathML, which browsers draw by themselves: no page needs a script or a network to show its formulas."""
    app.add_html_math_renderer("mathml", (_inline, None), (_display, None))
