"""Settings of the documentation."""

import sklearn_pgnn

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
]
extlinks = {"doi": ("https://doi.org/%s", "doi:%s")}
templates_path = ["_templates"]
exclude_patterns = ["_build", "_templates", "tables"]
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
