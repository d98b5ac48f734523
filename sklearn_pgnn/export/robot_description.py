"""What was found at a robot's joints, written into a copy of its URDF or MJCF file."""

import os
from pathlib import Path
from xml.etree import ElementTree

from sklearn_pgnn.annotations import FilePath
from sklearn_pgnn.exceptions import ModelError, ModelWarning
from sklearn_pgnn.export.robot_copy import MjcfCopy, RobotCopy, UrdfCopy
from sklearn_pgnn.physics.model import PhysicsModel
from sklearn_pgnn.user_line import warn_user
from sklearn_pgnn.whole_file import write_whole


def to_urdf(model: PhysicsModel, source: FilePath, path: FilePath) -> Path:
    r"""Write what a model says of a robot's joints into a copy of its URDF.

    Damping :math:`d` and dry friction :math:`F_c` of a joint become ``<dynamics damping friction>``
    [N m s/rad and N m, or N s/m and N], a limit of the torque the ``effort`` of its ``<limit>``,
    end stops its ``lower`` and ``upper`` [rad or m].

    Parameters
    ----------
    model : PhysicsModel
        A model that `sklearn_pgnn.priors.from_urdf` has made, extended by effects or fitted.
    source : str or path-like
        The file that it was made of; it is not changed.
    path : str or path-like
        Where to write.

    Returns
    -------
    Path
        The written file.

    Raises
    ------
    ModelError
        If the model says what a URDF cannot say, all of which is listed; nothing is written then.

    Warns
    -----
    ModelWarning
        Of the stiffness of end stops: the file says where they are.

    Examples
    --------
    >>> import tempfile
    >>> from sklearn_pgnn import effects, priors
    >>> text = '''<robot name="crank"><link name="base"/><link name="arm"><inertial>
    ...   <origin xyz="0.2 0 0"/><mass value="3"/>
    ...   <inertia ixx="0.01" iyy="0.05" izz="0.05" ixy="0" ixz="0" iyz="0"/></inertial></link>
    ...   <joint name="hub" type="continuous"><parent link="base"/><child link="arm"/>
    ...   <axis xyz="0 1 0"/></joint></robot>'''
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     _ = Path(folder, "crank.urdf").write_text(text)
    ...     crank = priors.from_urdf(f"{folder}/crank.urdf")
    ...     found = crank + effects.CoulombFriction("hub", level=0.5)
    ...     written = to_urdf(found, f"{folder}/crank.urdf", f"{folder}/found.urdf").read_text()
    >>> written[written.index("<dynamics") :].split(">")[0]
    '<dynamics friction="0.5" /'
    """
    return _write(UrdfCopy(model, os.fspath(source)), Path(path))


def to_mjcf(model: PhysicsModel, source: FilePath, path: FilePath) -> Path:
    r"""Write what a model says of a robot's joints into a copy of its MJCF file.

    Joints get ``damping`` (with the polynomial of newer versions of MuJoCo for drag), their
    ``frictionloss``, ``armature``, ``stiffness`` and ``springref``, and for end stops their
    ``range``; actuators ``ctrlrange``, ``gear`` and ``delay``. Units are those of the file: angles
    in degrees, where it does not say radians, all else in SI units.

    Parameters
    ----------
    model : PhysicsModel
        A model that `sklearn_pgnn.priors.from_mjcf` has made, extended by effects or fitted.
    source : str or path-like
        The file that it was made of; it is not changed.
    path : str or path-like
        Where to write; in the folder of the source, if that names meshes or other files.

    Returns
    -------
    Path
        The written file.

    Raises
    ------
    ModelError
        If the model says what an MJCF file cannot say, all of which is listed; nothing is written
        then.

    Warns
    -----
    ModelWarning
        Of the stiffness of end stops: the file says where they are.

    Examples
    --------
    >>> import tempfile
    >>> from sklearn_pgnn import effects, priors
    >>> text = '''<mujoco><worldbody><body><joint name="hub" axis="0 1 0"/>
    ...   <geom type="capsule" size="0.02" fromto="0 0 0 0.4 0 0"/></body></worldbody></mujoco>'''
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     _ = Path(folder, "crank.xml").write_text(text)
    ...     crank = priors.from_mjcf(f"{folder}/crank.xml")
    ...     found = crank + effects.CoulombFriction("hub", level=0.5)
    ...     written = to_mjcf(found, f"{folder}/crank.xml", f"{folder}/found.xml").read_text()
    >>> written[written.index("<joint") :].split(">")[0]
    '<joint name="hub" axis="0 1 0" frictionloss="0.5" /'
    """
    return _write(MjcfCopy(model, os.fspath(source)), Path(path))


def _write(copy: RobotCopy, path: Path) -> Path:
    unsaid = list(copy.fill())
    if unsaid:
        raise ModelError(
            f"{path.name}: {copy.article} {copy.kind} file cannot say {'; nor '.join(unsaid)}. "
            f"Remedy: write the model without that, and what it says by hand."
        )
    text = ElementTree.tostring(copy.root, encoding="unicode")
    write_whole(path, f'<?xml version="1.0"?>\n{text}\n')
    _warn_of_stops(copy, path.name)
    return path


def _warn_of_stops(copy: RobotCopy, name: str) -> None:
    """Warn of the stiffness of end stops, which neither format has a number for."""
    for effort in copy.efforts:
        if effort.rigid:
            warn_user(
                f"{name}: {copy.article} {copy.kind} file says where joint {effort.joint.name} "
                f"stops, not how stiff the stop is, here {max(effort.rigid):.6g} "
                f"{effort.joint.unit('{effort}/{x}')}. Remedy: give the stiffness to the simulator "
                f"that reads the file.",
                ModelWarning,
            )
