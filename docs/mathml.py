"""Formulas as MathML, which browsers show by themselves: the site needs no script and no network for them."""

import re

import latex2mathml.converter
from docutils import nodes
from sphinx.application import Sphinx
from sphinx.util.typing import ExtensionMetadata
from sphinx.writers.html5 import HTML5Translator

ATOM = r"<m[ino]>[^<]*</m[ino]>"
BESIDE = r'<mo lspace="0" rspace="0">\2</mo>'


def convert(formula: str, display: str = "inline") -> str:
    """A formula of TeX as MathML; primes stand beside what they follow: fonts raise them by themselves."""
    written = latex2mathml.converter.convert(formula, display=display)
    prime = r"<mi>(&#x0203[234];)</mi>"
    written = re.sub(rf"<msup>({ATOM}){prime}</msup>", rf"\1{BESIDE}", written)
    return re.sub(rf"<msubsup>({ATOM}{ATOM}){prime}</msubsup>", rf"<msub>\1</msub>{BESIDE}", written)


def show_inline(writer: HTML5Translator, node: nodes.math) -> None:
    """A formula within a line."""
    writer.body.append(convert(node.astext()))
    raise nodes.SkipNode


def show_display(writer: HTML5Translator, node: nodes.math_block) -> None:
    """A formula on lines of its own; those that are wider than the page scroll in their own box."""
    writer.body.append(writer.starttag(node, "div", CLASS="formula"))
    writer.body.append(convert(node.astext(), display="block"))
    writer.body.append("</div>\n")
    raise nodes.SkipNode


def setup(app: Sphinx) -> ExtensionMetadata:
    """Make this the renderer of formulas."""
    app.add_html_math_renderer("mathml", (show_inline, None), (show_display, None))
    return {"parallel_read_safe": True, "parallel_write_safe": True}
