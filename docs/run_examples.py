"""Run the examples that take too long for a build: ``python docs/run_examples.py [NAME ...]``.

What each prints goes to ``docs/_static/examples/NAME.txt``, its last picture to ``NAME.png``; the
gallery shows both.
"""

import contextlib
import io
import runpy
import sys
from pathlib import Path

import matplotlib

EXAMPLES = Path(__file__).parents[1] / "examples"
FOLDER = Path(__file__).parent / "_static" / "examples"
FIELDS = sorted(path.stem for path in EXAMPLES.glob("plot_field_*.py"))
LONG = ("plot_mpc_golf_robot", "plot_pgnnl_golf_robot", "plot_tune_lambda_phy", *FIELDS)


def run(name: str) -> None:
    """Run an example, and store what it prints and draws."""
    import matplotlib.pyplot as plt

    said = io.StringIO()
    with contextlib.redirect_stdout(said):
        runpy.run_path(str(EXAMPLES / f"{name}.py"), run_name="__main__")
    FOLDER.mkdir(parents=True, exist_ok=True)
    (FOLDER / f"{name}.txt").write_text(said.getvalue(), encoding="utf-8")
    if plt.get_fignums():
        plt.figure(plt.get_fignums()[-1]).savefig(FOLDER / f"{name}.png", dpi=100)
        plt.close("all")


def main() -> None:
    """Run those that are named, or all that take long."""
    matplotlib.use("Agg")
    for name in sys.argv[1:] or LONG:
        run(name)


if __name__ == "__main__":
    main()
