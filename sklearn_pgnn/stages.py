"""Descriptions of the stages of a diagnosis, for the progress display."""

import re

#: prefix of a report of the best hypothesis so far, in place of a stage
BEST = "best candidate so far: "
#: description of the work in each stage
WORDS = {
    "window length": "choosing the window length",
    "candidates": "simulating the candidates",
    "needless causes": "removing unnecessary causes",
    "other causes": "trying other candidates in place of the causes",
    "all sets": "fitting all sets of the few candidates",
    "pairs": "fitting pairs of candidates",
    "all records": "fitting all records",
    "formula": "searching for a formula",
    "inputs between samples": "inputs between samples: held or linearly interpolated",
    "integration steps": "checking the integration steps",
    "held-out error": "errors on held-out windows",
    "structure of what is left": "looking for structure in the residuals",
    "quality of the records": "checking the quality of the records",
    "experiments that separate": "looking for experiments that separate causes",
}


def in_words(stage: str) -> str:
    """Return a description of a stage; its own name if that is descriptive already."""
    if re.fullmatch(r"cause \d+", stage):
        return f"{stage}, fitting the candidates"
    return WORDS.get(stage, stage)
