"""What a machine does: compiled simulation, sensitivities and windows (multiple shooting)."""

from sklearn_pgnn.simulation.simulate import Simulation, simulate

__all__ = ["Simulation", "simulate"]
