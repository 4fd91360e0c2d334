"""Formulas as MathML, which browsers draw by themselves: no script, no request."""

from typing import Any

from docutils import nodes
from latex2mathml.converter import convert
from sphinx.application import Sphinx


def register(app: Sphinx) -> None:
    """Let HTML pages have their formulas as MathML."""
    app.add_html_math_renderer("mathml", (inline, None), (block, None))


def inline(translator: Any, node: nodes.math) -> None:
    """A formula in a line."""
    translator.body.append(convert(node.astext()))
    raise nodes.SkipNode


def block(translator: Any, node: nodes.math_block) -> None:
    """A formula that stands by itself."""
    formula = convert(node.astext(), display="block")
    translator.body.append(f'<div style="overflow-x: auto; margin: 1em 0">{formula}</div>')
    raise nodes.SkipNode
