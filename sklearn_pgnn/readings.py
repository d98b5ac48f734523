"""Where a model's readings live.

A `PhysicsModel` knows what a machine is, not how to simulate it; yet ``model.simulate(...)`` is
what a person writes. This table is the only place where a lower floor names an upper one, and it
does so by text, resolved when the reading is asked for.
"""

from pkgutil import resolve_name

READINGS = {
    "simulate": "sklearn_pgnn.simulation:simulate",
    "read_model": "sklearn_pgnn.physics.model_file:read_model",
    "write_report": "sklearn_pgnn.inspection:write_report",
    "plot_detectability": "sklearn_pgnn.inspection:plot_detectability",
    "plot_diagnosis": "sklearn_pgnn.inspection:plot_diagnosis",
    "write_model": "sklearn_pgnn.physics.model_file:write_model",
}


def reading(name: str):
    """Return the function that reads a model in the way called `name`."""
    return resolve_name(READINGS[name])
