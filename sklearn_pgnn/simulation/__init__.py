"""Simulation of models: compiled time loops, sensitivities and windows (multiple shooting)."""

from sklearn_pgnn.simulation.parameter_sets import simulate_sets
from sklearn_pgnn.simulation.simulate import Simulation, simulate
from sklearn_pgnn.simulation.uncertainty import Estimate

__all__ = ["Estimate", "Simulation", "simulate", "simulate_sets"]
