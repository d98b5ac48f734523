"""Exporters of models and networks to the languages of other tools."""

from sklearn_pgnn.export.c import to_c
from sklearn_pgnn.export.casadi_function import to_casadi
from sklearn_pgnn.export.control_system import to_control
from sklearn_pgnn.export.fmu import to_fmu
from sklearn_pgnn.export.modelica import to_modelica
from sklearn_pgnn.export.onnx_network import to_onnx
from sklearn_pgnn.export.robot_description import to_mjcf, to_urdf

__all__ = [
    "to_c",
    "to_casadi",
    "to_control",
    "to_fmu",
    "to_mjcf",
    "to_modelica",
    "to_onnx",
    "to_urdf",
]
