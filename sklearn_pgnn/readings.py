"""Table of the methods of a model that are implemented in upper layers.

A `PhysicsModel` does not depend on the code that simulates it; yet ``model.simulate(...)`` is
the natural interface. This table is the only place where a lower layer names an upper one, by
text that is resolved on use.
"""

from collections.abc import Callable
from pkgutil import resolve_name
from typing import Any

READINGS = {
    "simulate": "sklearn_pgnn.simulation:simulate",
    "how_called": "sklearn_pgnn.simulation.native_function:how_called",
    "rigid_bodies": "sklearn_pgnn.simulation.rigid_bodies:at_points",
    "rigid_body_slopes": "sklearn_pgnn.simulation.rigid_bodies:slopes",
    "robot_model": "sklearn_pgnn.priors.robot_section:robot_model",
    "read_model": "sklearn_pgnn.physics.model_file:read_model",
    "cause_html": "sklearn_pgnn.inspection.notebook:cause_html",
    "cause_latex": "sklearn_pgnn.inspection.notebook:cause_latex",
    "detectability_html": "sklearn_pgnn.inspection.notebook:detectability_html",
    "diagnosis_html": "sklearn_pgnn.inspection.notebook:diagnosis_html",
    "diagnosis_latex": "sklearn_pgnn.inspection.notebook:diagnosis_latex",
    "effect_html": "sklearn_pgnn.inspection.notebook:effect_html",
    "effect_latex": "sklearn_pgnn.inspection.notebook:effect_latex",
    "model_html": "sklearn_pgnn.inspection.notebook:model_html",
    "model_latex": "sklearn_pgnn.inspection.notebook:model_latex",
    "write_report": "sklearn_pgnn.inspection:write_report",
    "plot_detectability": "sklearn_pgnn.inspection:plot_detectability",
    "plot_diagnosis": "sklearn_pgnn.inspection:plot_diagnosis",
    "write_model": "sklearn_pgnn.physics.model_file:write_model",
}


def reading(name: str) -> Callable[..., Any]:
    """Return the function that implements a method of a model."""
    return resolve_name(READINGS[name])
