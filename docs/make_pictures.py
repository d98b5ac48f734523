"""Make the pictures of the documents: ``python docs/make_pictures.py``."""

from pathlib import Path

from sklearn_pgnn import ModelDiagnosis, datasets, effects, systems
from sklearn_pgnn.inspection import DiagnosisDisplay

FOLDER = Path(__file__).parent / "_static"


def diagnose_golf_robot():
    """Diagnose a golf robot whose model misses stick-slip."""
    friction = effects.StribeckFriction("omega", level=0.1, peak=0.1, velocity=0.3)
    hidden = datasets.make_hidden_effect(
        systems.golf_robot(), friction, n_records=6, sample_rate=200, random_state=0
    )
    return ModelDiagnosis(hidden.prior).fit(hidden.X, hidden.y)


def main():
    """Write every picture."""
    FOLDER.mkdir(exist_ok=True)
    display = DiagnosisDisplay.from_estimator(diagnose_golf_robot(), record=3)
    display.figure_.savefig(FOLDER / "diagnosis_golf_robot.png", dpi=110)


if __name__ == "__main__":
    main()
