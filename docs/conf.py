"""Settings of the documentation."""

import sklearn_pgnn

project = "sklearn_pgnn"
copyright = "2026, The sklearn-pgnn developers"
version = release = sklearn_pgnn.__version__

extensions = ["sphinx.ext.autodoc", "sphinx.ext.extlinks", "sphinx.ext.mathjax", "numpydoc"]
extlinks = {"doi": ("https://doi.org/%s", "doi:%s")}
exclude_patterns = ["_build", "tables"]
default_role = "py:obj"
html_theme = "alabaster"

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
