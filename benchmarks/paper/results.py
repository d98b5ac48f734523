"""Results, kept line by line as they come, so that a run that is broken off loses nothing."""

import datetime
import json
from pathlib import Path

FOLDER = Path(__file__).parent / "results"


class Results:
    """What a study has found so far: a file with a line a task.

    Parameters
    ----------
    study : str
        Name of the study.
    """

    def __init__(self, study):
        self.path = FOLDER / f"{study}.jsonl"
        text = self.path.read_text(encoding="utf-8") if self.path.exists() else ""
        self.lines = [json.loads(line) for line in text.splitlines()]

    def __contains__(self, task):
        return any(line["task"] == task for line in self.lines)

    def add(self, task, found):
        """Keep what a task has found."""
        line = {"task": task, "found": found, "date": str(datetime.date.today())}
        self.lines.append(line)
        FOLDER.mkdir(exist_ok=True)
        with self.path.open("a", encoding="utf-8") as file:
            file.write(json.dumps(line) + "\n")

    def clear(self):
        """Forget everything."""
        self.lines = []
        self.path.unlink(missing_ok=True)

    @property
    def found(self):
        """Return a dict for every finished task, with its parameters and its results."""
        return [{**line["task"], **line["found"]} for line in self.lines]

    @property
    def dates(self):
        """Return when the tasks were finished."""
        days = sorted({line["date"] for line in self.lines})
        return " to ".join(dict.fromkeys((days[0], days[-1])))
