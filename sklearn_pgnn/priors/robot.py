"""Robots from their descriptions: rigid-body dynamics with a port at every joint."""

import os
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import sympy

from sklearn_pgnn.annotations import FilePath
from sklearn_pgnn.physics.expressions import symbol
from sklearn_pgnn.physics.external import external
from sklearn_pgnn.physics.model import PhysicsModel
from sklearn_pgnn.priors.base_parameters import base_inertias
from sklearn_pgnn.priors.rigid_tree import RigidTree, TreeDynamics
from sklearn_pgnn.priors.robot_file import Payload, read_mjcf, read_urdf, tree_of
from sklearn_pgnn.priors.robot_joint import Drive, Joint, joints_of, torques
from sklearn_pgnn.priors.robot_joint import controls as commands


def from_urdf(
    path: FilePath,
    *,
    payload: str | tuple[str, tuple[float, float, float]] | None = None,
    base_parameters: bool = False,
    armatures: bool = False,
    effort_limits: bool = False,
    **more: Any,
) -> PhysicsModel:
    r"""Return the rigid-body dynamics of a robot that a URDF describes.

    .. math:: M(q)\, \dot w + h(q, w) + d\, w + F_c\, \mathrm{sign}(w) = \tau, \qquad \dot q = w

    The states are ``q_NAME`` and ``w_NAME`` of every joint that moves (``v_NAME`` of one that
    slides), the inputs its torque ``tau_NAME`` (its force ``F_NAME``), the outputs the positions.
    Every joint is a port under its own name: effects act on it through the whole mass matrix.
    Inertias are those of the file and stay, unless ``base_parameters`` frees those of them that
    records can determine. What ``<dynamics damping friction>`` gives is a parameter,
    ``damping_NAME`` and ``friction_NAME``, and can be fitted. Limits of ``<limit>`` act in the
    robot's controller and are no part of the model, unless ``effort_limits`` says so of those of
    torques; neither are contacts.

    MuJoCo reads the file and checks its masses. The dynamics are compiled, with exact derivatives,
    and agree with MuJoCo's to rounding.

    Parameters
    ----------
    path : str or path-like
        The file. Meshes need not be there.
    payload : str or tuple of str and tuple of float, optional
        Link that may hold another mass, and where in its frame [m], by default at its origin: the
        mass is the parameter ``payload`` [kg], zero at first.
    base_parameters : bool, default=False
        Whether inertias can be fitted. Of the ten inertial parameters of every link that has a mass
        only some combinations act on the joints. Free are as many as there are such combinations,
        the others stay as in the file: those that a QR decomposition with pivoting takes first of
        the regressor at random states [1]_. They are ``mass_NAME`` [kg], ``moment_x_NAME`` [kg m]
        and ``inertia_xy_NAME`` [kg m^2] and so on of all that the joint moves up to the next one,
        about the joint, in the axes of the base with every joint at its zero. With the others held,
        a fitted value stands for its combination, not for the link alone.
    armatures : bool, default=False
        Whether every joint gets the inertia of its drive, seen through the gear, as the parameter
        ``armature_NAME``, zero where the file gives none. A URDF has no word for it.
    effort_limits : bool, default=False
        Whether the ``effort`` of ``<limit>`` bounds the torques: for inputs that are commands.
    **more
        Further parameters of `PhysicsModel`: ``outputs``, ``columns``, ``simulation`` and so on.

    Returns
    -------
    PhysicsModel
        The model.

    Raises
    ------
    ModelError
        If the file is no URDF, MuJoCo refuses it, or joints are coupled, float, or are balls.

    References
    ----------
    .. [1] M. Gautier, "Numerical calculation of the base inertial parameters of robots", IEEE
       International Conference on Robotics and Automation, 1990.

    Examples
    --------
    >>> import tempfile
    >>> text = '''<robot name="crank"><link name="base"/><link name="arm"><inertial>
    ...   <origin xyz="0.2 0 0"/><mass value="3"/>
    ...   <inertia ixx="0.01" iyy="0.05" izz="0.05" ixy="0" ixz="0" iyz="0"/></inertial></link>
    ...   <joint name="hub" type="continuous"><parent link="base"/><child link="arm"/>
    ...   <axis xyz="0 1 0"/><dynamics damping="0.4"/></joint></robot>'''
    >>> with tempfile.NamedTemporaryFile("w", suffix=".urdf") as file:
    ...     _ = file.write(text), file.flush()
    ...     crank = from_urdf(file.name)
    ...     free = from_urdf(file.name, base_parameters=True)
    >>> list(crank.states), list(crank.inputs), crank.parameters["damping_hub"].unit
    (['q_hub', 'w_hub'], ['tau_hub'], 'N m/(rad/s)')
    >>> list(free.parameters)
    ['damping_hub', 'moment_x_hub', 'moment_z_hub', 'inertia_yy_hub']
    """
    path = os.fspath(path)
    m = read_urdf(path)
    joints = joints_of(m, armatures)
    tree = _tree(m, joints, payload, base_parameters)
    return _model(_title(m, path), joints, torques(m, joints, effort_limits), tree, more)


def from_mjcf(
    path: FilePath,
    *,
    controls: bool | None = None,
    payload: str | tuple[str, tuple[float, float, float]] | None = None,
    base_parameters: bool = False,
    armatures: bool = False,
    **more: Any,
) -> PhysicsModel:
    r"""Return the rigid-body dynamics of a robot that an MJCF file describes.

    As `from_urdf`, and with what MuJoCo's own format adds: a joint's ``armature``, its spring
    (``stiffness_NAME``), and the actuators. The inputs are the actuators' commands by their names,
    where the file has actuators: motors, and servos of position or velocity, with gear, limits and
    delay. MuJoCo's limits of joints and its contacts are no part of the model.

    Parameters
    ----------
    path : str or path-like
        The file, with the meshes that it needs.
    controls : bool, optional
        Whether the inputs are the actuators' commands, by default where there are actuators; else
        they are the joints' torques.
    payload : str or tuple of str and tuple of float, optional
        Body that may hold another mass, see `from_urdf`.
    base_parameters, armatures : bool, default=False
        Whether inertias can be fitted, and whether every joint gets an armature, see `from_urdf`.
    **more
        Further parameters of `PhysicsModel`.

    Returns
    -------
    PhysicsModel
        The model.

    Raises
    ------
    ModelError
        If the file is no MJCF, MuJoCo refuses it, joints are coupled, float, or are balls, or an
        actuator is of another kind.

    Examples
    --------
    >>> import tempfile
    >>> text = '''<mujoco><worldbody><body><joint name="hub" axis="0 1 0" armature="0.1"/>
    ...   <geom type="capsule" size="0.02" fromto="0 0 0 0.4 0 0"/></body></worldbody>
    ...   <actuator><motor name="drive" joint="hub" gear="50"/></actuator></mujoco>'''
    >>> with tempfile.NamedTemporaryFile("w", suffix=".xml") as file:
    ...     _ = file.write(text), file.flush()
    ...     crank = from_mjcf(file.name)
    >>> list(crank.inputs), list(crank.parameters)
    (['drive'], ['gear_drive', 'armature_hub'])
    """
    path = os.fspath(path)
    m = read_mjcf(path)
    joints = joints_of(m, armatures)
    tree = _tree(m, joints, payload, base_parameters)
    commanded = m.nu > 0 if controls is None else controls
    drive = commands(path, m, joints) if commanded else torques(m, joints)
    return _model(_title(m, path), joints, drive, tree, more)


def _tree(m: Any, joints: list[Joint], payload, base_parameters: bool) -> RigidTree:
    """Return the tree, with what may be added to its links."""
    held = None if payload is None else Payload.of(payload)
    tree = tree_of(m, tuple(joint.name for joint in joints), held)
    if not base_parameters:
        return tree
    geared = [place for place, joint in enumerate(joints) if joint.armature is not None]
    return replace(tree, added=(*tree.added, *base_inertias(tree, geared)))


def _model(
    name: str, joints: list[Joint], drive: Drive, tree: RigidTree, more: Mapping
) -> PhysicsModel:
    q, w = [joint.q for joint in joints], [joint.w for joint in joints]
    parameters: dict[str, Any] = dict(drive.parameters)
    for joint in joints:
        parameters |= joint.parameters
    for each in tree.added:
        bounds = (each.low, np.inf)
        parameters[each.name] = {"value": each.known, "unit": each.unit, "bounds": bounds}
    inverse, bias = _entries(tree, joints)
    known = zip(drive.efforts, joints, bias, strict=True)
    efforts = [effort - joint.resistance - h for effort, joint, h in known]
    rates = [sympy.Add(*(b * e for b, e in zip(row, efforts, strict=True))) for row in inverse]
    usual = {
        "name": name,
        "outputs": {str(s): s for s in q},
        "initial_state": {str(s): at for s, at in zip(q, tree.zeros, strict=True)},
        "ports": {
            joint.name: joint.port(dict(zip(map(str, w), column, strict=True)))
            for joint, column in zip(joints, inverse, strict=True)
        },
    }
    return PhysicsModel(
        {str(j.q): j.unit("{x}") for j in joints} | {str(j.w): j.unit("{x}/s") for j in joints},
        dict(zip(map(str, q), w, strict=True)) | dict(zip(map(str, w), rates, strict=True)),
        parameters,
        drive.inputs,
        delays=drive.delays,
        **{**usual, **more},
    )


def _entries(tree: RigidTree, joints: list[Joint]):
    r"""Return the entries of :math:`M^{-1}`, row by row, and those of :math:`h`."""
    n = len(joints)
    geared = [2 * n + i for i, joint in enumerate(joints) if joint.armature is not None]
    dynamics = TreeDynamics(tree, (*geared, *range(3 * n, tree.arguments)))
    quantities = (
        *(_beyond(joint.q, at) for joint, at in zip(joints, tree.zeros, strict=True)),
        *(joint.w for joint in joints),
        *(joint.symbol("armature") for joint in joints),
        *(_beyond(symbol(each.name), each.known) for each in tree.added),
    )

    def entry(i, j):
        result = dynamics.entries.index((min(i, j), max(i, j)) if j < n else (i, j))
        places = dynamics.arguments(result)
        return external(dynamics.outside[0], result, places)(*(quantities[a] for a in places))

    return [[entry(i, j) for j in range(n)] for i in range(n)], [entry(i, n) for i in range(n)]


def _beyond(quantity: sympy.Symbol, known: float) -> sympy.Expr:
    return quantity - sympy.Float(known) if known else quantity


def _title(m: Any, path: str) -> str:
    """Return the robot's name: that of the file's root, or of the file."""
    named = m.names.split(b"\0", 1)[0].decode("utf-8", "replace")
    return named if named and named != "MuJoCo Model" else Path(path).stem
