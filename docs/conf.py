"""Settings of the documentation."""

import os
import sys
from pathlib import Path

import sklearn_pgnn

HERE = Path(__file__).parent
sys.path.insert(0, str(HERE))
os.environ.setdefault("MPLBACKEND", "Agg")

project = "sklearn_pgnn"
copyright = "2026, The sklearn-pgnn developers"
version = release = sklearn_pgnn.__version__

extensions = [
    "sphinx.ext.autodoc",
    "sphinx.ext.autosummary",
    "sphinx.ext.extlinks",
    "sphinx.ext.mathjax",
    "sphinx-mathjax-offline",  # brings MathJax, so that pages are read without a network
    "sphinx_copybutton",
    "myst_parser",
    "numpydoc",
    "sphinx_gallery.gen_gallery",
    "heat",
]
extlinks = {"doi": ("https://doi.org/%s", "doi:%s")}
templates_path = ["_templates"]
exclude_patterns = ["_build", "_extra", "_templates", "tables"]
html_extra_path = ["_extra", "llms.txt"]
html_static_path = ["_static"]
html_css_files = ["heat.css"]
default_role = "py:obj"
html_theme = "furo"
html_title = f"{project} {release}"

copybutton_prompt_text = r">>> |\.\.\. |\$ "
copybutton_prompt_is_regexp = True

autodoc_default_options = {
    "members": True,
    "member-order": "bysource",
    # made by scikit-learn for every estimator
    "exclude-members": ", ".join(
        f"set_{method}_request"
        for method in ("fit", "partial_fit", "predict", "score", "split", "transform")
    ),
}
autodoc_typehints = "none"  # the docstrings have them
numpydoc_show_class_members = False

sphinx_gallery_conf = {
    "examples_dirs": "../examples",
    "gallery_dirs": "gallery",
    # the others take minutes: they show what `python docs/run_examples.py` has stored
    "filename_pattern": "plot_diagnose_two_tanks",
    "download_all_examples": False,
    "show_memory": False,
    "show_signature": False,
    "remove_config_comments": True,
}


def make_samples(_app, _config):
    """Make the sample reports that are not there yet."""
    from make_samples import make_missing

    make_missing()


def make_codes(_app, _config):
    """Write the page of the codes from their table."""
    from make_codes import page

    (HERE / "codes.rst").write_text(page(), encoding="utf-8")


def setup(app):
    """Make what the pages refer to before they are built."""
    app.connect("config-inited", make_samples)  # before the folder is looked for
    app.connect("config-inited", make_codes)
