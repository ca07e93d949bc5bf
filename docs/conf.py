"""Settings of the documentation site; `make docs` builds it, runs every example and treats warnings as errors."""

import os
import re
import sys
import sysconfig
import tempfile
from pathlib import Path

from pydantic import BaseModel

import flexlin

ROOT = Path(__file__).parents[1]
sys.path[:0] = [str(ROOT), str(ROOT / "docs")]
os.environ["PATH"] = f"{sysconfig.get_path('scripts')}{os.pathsep}{os.environ['PATH']}"  # pages call `flexlin`
QUIET = Path(tempfile.mkdtemp(), "profile_default", "ipython_kernel_config.py")
QUIET.parent.mkdir()
QUIET.write_text("c.IPKernelApp.log_level = 40\n")
os.environ["IPYTHONDIR"] = str(QUIET.parents[1])
os.environ |= {"COLUMNS": "1000", "TERM": "dumb", "NO_COLOR": "1"}  # plain text from commands

project, author, release = "flexlin", "The flexlin authors", flexlin.__version__
project_copyright = "the flexlin authors"
extensions = [
    "myst_nb",
    "sphinx.ext.autodoc",
    "sphinx.ext.autosummary",
    "mathml",
    "numpydoc",
    "sphinx_copybutton",
]
exclude_patterns = ["_build", "**.ipynb_checkpoints"]
nitpicky = False

html_math_renderer = "mathml"
html_theme = "furo"
html_title = "flexlin"
html_static_path = ["static"]
html_css_files = ["site.css"]

myst_enable_extensions = ["amsmath", "dollarmath", "colon_fence", "deflist"]
myst_heading_anchors = 3
linkcheck_timeout, linkcheck_retries, linkcheck_workers = 20, 2, 4
linkcheck_ignore = [r"https://doi\.org/.*"]  # publishers answer programs with 403

nb_execution_mode = "force"
nb_execution_raise_on_error = True
nb_execution_show_tb = True
nb_execution_timeout = 300
nb_execution_in_temp = True
nb_merge_streams = True

autosummary_generate = True
templates_path = ["templates"]
autosummary_context = {"foreign": dir(BaseModel)}
autodoc_typehints = "none"
numpydoc_show_class_members = False
numpydoc_xref_param_type = False
copybutton_prompt_text = r">>> |\.\.\. |\$ "
copybutton_prompt_is_regexp = True


def setup(app):
    """Draw what the code says of itself; fill in the reference tables of each page; show equations of docstrings as they are written."""
    from draw_house import draw
    from figures import fill
    from gallery import write_gallery
    from myst_nb.core import render
    from public_names import write_names

    write_gallery()
    write_names()
    draw()
    render.coalesce_streams = join_streams
    app.connect("source-read", lambda app, name, source: source.__setitem__(0, fill(source[0])))
    app.connect("autodoc-process-docstring", lambda *event: quote_equations(event[-1]), priority=400)


def join_streams(outputs):
    """Put the pieces of each stream together as they came: myst_nb ends each piece with a new line, also in the middle of a word.

    How far a command has come (`flexlin: 47 %, about 2 s left`) is left out: it depends on how busy the machine is.
    """
    streams, joined = {}, []
    for output in outputs:
        name = output.get("name") if output["output_type"] == "stream" else None
        if name in streams:
            streams[name]["text"] += output["text"]
            continue
        if name:
            streams[name] = output
        joined.append(output)
    for stream in streams.values():
        stream["text"] = re.sub(r"^flexlin: .*(?:s left|so far).*\n", "", stream["text"], flags=re.MULTILINE)
    return [output for output in joined if output.get("text", "shown")]


def quote_equations(lines):
    """Make the indented equations of a docstring's summary literal blocks, and let |x| be no substitution."""
    heads = [k for k, line in enumerate(lines) if line and set(line) <= {"-"}]
    end = heads[0] - 1 if heads else len(lines)
    summary, inside = [], False
    for line in lines[:end]:
        indented = line.startswith("    ")
        if indented and not inside:
            summary += [".. code-block:: none", ""]
        inside = indented or (inside and not line)
        summary.append(line if inside else line.replace("|", "\\|"))
    examples = next((k for k, line in enumerate(lines) if line == "Examples"), len(lines))
    rest = [line.replace("|", "\\|") if k < examples else line for k, line in enumerate(lines)][end:]
    lines[:] = [*summary, *rest]
