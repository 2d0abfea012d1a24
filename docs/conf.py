"""Configuration of the documentation. Nothing is fetched while it is built, or read."""

import re
import sys
from importlib import metadata
from pathlib import Path

sys.path.append(str(Path(__file__).parent / "_extensions"))

project = "pathcontrol"
author = project_copyright = "The pathcontrol contributors"
release = version = metadata.version("pathcontrol")

extensions = [
    "myst_parser",
    "sphinx.ext.autodoc",
    "sphinx.ext.napoleon",
    "sphinx.ext.viewcode",
    "sphinx.ext.mathjax",
    "sphinx-mathjax-offline",  # MathJax and its fonts beside the pages, which so need no network to be read
    "gallery",
]
mathjax_path = "mathjax/tex-chtml.js"
myst_enable_extensions = ["amsmath", "colon_fence", "dollarmath"]
myst_heading_anchors = 3
exclude_patterns = ["_build", "_extensions"]

html_theme = "furo"
html_static_path = ["_static"]
html_css_files = ["gallery.css"]
html_title = f"pathcontrol {release}"

autodoc_member_order = "bysource"
autodoc_preserve_defaults = True
autodoc_typehints_format = "short"
autodoc_type_aliases = {"Array": "Array", "ArrayLike": "ArrayLike"}
napoleon_google_docstring = True
napoleon_numpy_docstring = False
napoleon_use_ivar = True  # as fields of the class; as attributes they would be listed twice


#: what would be markup: of a ``(*batch, n)``, an absolute value, an operator that stands alone
_MARKUP = r"(?<=\()\*(?=batch)|\||(?<=\s)\*+(?=[\s,])"


def _docstring(app, what, name, obj, options, lines):
    """Make reStructuredText of what the docstrings leave plain: equations, ``(*batch, n)``, |v| and operators."""
    for i, line in enumerate(lines):
        parts = re.split(r"(``.*?``)", line)
        lines[i] = "".join(p if p.startswith("``") else re.sub(_MARKUP, r"\\\g<0>", p) for p in parts)
    _keep_equation_lines(lines)


def _keep_equation_lines(lines):
    """An indented block between blank lines is an equation or several, one a line."""
    block = False
    for i, line in enumerate(lines):
        indented = line.startswith("    ") and bool(line.strip())
        block = indented and (block or not lines[i - 1].strip())
        if block:
            lines[i] = "    | " + line.strip()


def _colon_in_property(app, what, name, obj, options, lines):
    """Napoleon takes what precedes a colon in the docstring of a property for its type."""
    if what == "property" and lines:
        lines.insert(0, "\\ ")


def _signature(app, what, name, obj, options, signature, return_annotation):
    """Names of type aliases, as they are written in the code, and types without what else is annotated."""

    def plain(text):
        return text and re.sub(r"TypeAliasForwardRef\('(\w+)'\)", r"\1", _without_annotations(text))

    return plain(signature), plain(return_annotation)


def _without_annotations(text):
    """Replace each ``Annotated[X, …]`` by X; the union that an evaluated ArrayLike is gets its name again."""
    while match := re.search(r"~?[\w.]*\bAnnotated\[", text):
        depth, commas, end = 1, [], match.end()
        while depth:
            depth += {"[": 1, "(": 1, "]": -1, ")": -1}.get(text[end], 0)
            commas += [end] * (depth == 1 and text[end] == ",")
            end += 1
        kind = text[match.end() : commas[0]]
        plain = "ArrayLike" + kind.rpartition("]")[2] if "_SupportsArray" in kind else kind
        text = text[: match.start()] + plain + text[end:]
    return text


def _skip_fields(app, what, name, obj, skip, options):
    """The fields of a NamedTuple are told in its docstring, not as ``Alias for field number 0``."""
    return True if type(obj).__name__ == "_tuplegetter" else skip


def setup(app):
    """Called by Sphinx."""
    app.connect("autodoc-process-docstring", _colon_in_property, priority=100)
    app.connect("autodoc-process-docstring", _docstring)
    app.connect("autodoc-process-signature", _signature)
    app.connect("autodoc-skip-member", _skip_fields)
