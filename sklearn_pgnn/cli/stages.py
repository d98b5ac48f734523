"""What the stages of a diagnosis do, in words for who watches them."""

import re

#: by stage, what is done in it
WORDS = {
    "window length": "choosing the window length",
    "candidates": "simulating the candidates",
    "needless causes": "leaving out causes that others make unnecessary",
    "other causes": "putting other candidates in the place of the causes",
    "pairs": "fitting pairs of candidates",
    "all records": "fitting all records",
    "formula": "searching for a formula",
    "inputs between samples": "inputs between samples: held or straight",
    "integration steps": "checking the integration steps",
    "held-out error": "errors on held-out windows",
    "structure of what is left": "looking for structure in what is left",
    "quality of the records": "checking the quality of the records",
    "experiments that separate": "looking for experiments that separate causes",
}


def in_words(stage: str) -> str:
    """Return what is done in a stage; the stage itself where it says so already.

    Examples
    --------
    >>> in_words("cause 2"), in_words("held-out error"), in_words("writing the report")
    ('cause 2, fitting the candidates', 'errors on held-out windows', 'writing the report')
    """
    if re.fullmatch(r"cause \d+", stage):
        return f"{stage}, fitting the candidates"
    return WORDS.get(stage, stage)
