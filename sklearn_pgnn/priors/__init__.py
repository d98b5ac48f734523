"""Importers: functions, python-control systems, CasADi, FMUs and robots as models."""

from sklearn_pgnn.priors.casadi_program import from_casadi
from sklearn_pgnn.priors.fmu_model import from_fmu
from sklearn_pgnn.priors.nlsys import from_control
from sklearn_pgnn.priors.python_function import from_function
from sklearn_pgnn.priors.robot import from_mjcf, from_urdf

__all__ = ["from_casadi", "from_control", "from_fmu", "from_function", "from_mjcf", "from_urdf"]
