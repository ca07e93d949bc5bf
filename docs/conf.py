"""Settings of the documentation site; `make docs` builds it, runs every example and treats warnings as errors."""

import os
import sys
import sysconfig
from pathlib import Path

import flexlin

ROOT = Path(__file__).parents[1]
sys.path.insert(0, str(ROOT))
os.environ["PATH"] = f"{sysconfig.get_path('scripts')}{os.pathsep}{os.environ['PATH']}"  # pages call `flexlin`
os.environ |= {"COLUMNS": "110", "TERM": "dumb", "NO_COLOR": "1"}  # plain text from commands

project, author, release = "flexlin", "The flexlin authors", flexlin.__version__
project_copyright = "the flexlin authors"
extensions = ["myst_nb", "sphinx.ext.autodoc", "sphinx.ext.autosummary", "sphinx.ext.mathjax", "numpydoc", "sphinx_copybutton"]
exclude_patterns = ["_build", "**.ipynb_checkpoints"]
nitpicky = False

html_theme = "furo"
html_title = "flexlin"
html_static_path = ["static"]
html_css_files = ["site.css"]

myst_enable_extensions = ["amsmath", "dollarmath", "colon_fence", "deflist"]
myst_heading_anchors = 3
nb_execution_mode = "force"
nb_execution_raise_on_error = True
nb_execution_show_tb = True
nb_execution_timeout = 300
nb_execution_in_temp = True
nb_merge_streams = True

autosummary_generate = True
autodoc_typehints = "none"
numpydoc_show_class_members = False
numpydoc_xref_param_type = False
copybutton_prompt_text = r">>> |\.\.\. |\$ "
copybutton_prompt_is_regexp = True
