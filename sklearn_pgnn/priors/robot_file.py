"""Robot descriptions, URDF and MJCF, as MuJoCo reads them: checked, and with every default."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import numpy as np

from sklearn_pgnn.exceptions import ModelError
from sklearn_pgnn.extras import needed_by
from sklearn_pgnn.priors.rigid_tree import Added, RigidTree

#: what a link looks like, which does not matter to its motion
SEEN = ("visual", "collision")
#: a small payload [kg], with which it is looked what depends on what
PROBED_MASS = 0.1
#: what couples or drives joints otherwise than by their own torques, by the number of it
COUPLED = {
    "neq": "equality constraints (mimic joints are such)",
    "ntendon": "tendons",
    "nflex": "flexible bodies",
    "nplugin": "plugins",
}


def read_urdf(path: str) -> Any:
    """Return MuJoCo's model of a URDF; meshes and shapes are left out, they need not be there."""
    root = parsed(path, "robot", "a URDF")
    for link in root.iter("link"):
        for part in [part for part in link if part.tag in SEEN]:
            link.remove(part)
    for material in root.findall("material"):
        root.remove(material)
    _keep_links(root)
    return _checked(path, ElementTree.tostring(root, encoding="unicode"))


def _keep_links(root: ElementTree.Element) -> None:
    """Let MuJoCo keep the links that are fixed to others, by their names."""
    own = root.find("mujoco")
    own = ElementTree.SubElement(root, "mujoco") if own is None else own
    compiler = own.find("compiler")
    compiler = ElementTree.SubElement(own, "compiler") if compiler is None else compiler
    compiler.set("fusestatic", "false")


def read_mjcf(path: str) -> Any:
    """Return MuJoCo's model of an MJCF file, whose shapes may give the masses."""
    parsed(path, "mujoco", "an MJCF")
    return _checked(path, None)


def parsed(path: str, root: str, what: str) -> ElementTree.Element:
    """Return the root of an XML file, which must have a name; comments are kept."""
    builder = ElementTree.TreeBuilder(insert_comments=True)
    try:
        text = Path(path).read_bytes()
    except OSError as error:
        raise ModelError(f"{path}: expected {what} file, got: {error.strerror}.") from error
    try:
        found = ElementTree.fromstring(text, ElementTree.XMLParser(target=builder))
    except ElementTree.ParseError as error:
        raise ModelError(f"{path}: expected {what} file, got no XML: {error}.") from error
    if found.tag != root:
        raise ModelError(f"{path}: expected {what} file, <{root}>, got <{found.tag}>. {_OTHER}")
    return found


_OTHER = (
    "Remedy: from_urdf reads <robot>, from_mjcf <mujoco>; a xacro file is made a URDF by the "
    "command xacro."
)


def _checked(path: str, text: str | None) -> Any:
    """Return MuJoCo's model, if it is a machine with one coordinate a joint."""
    with needed_by(path):
        import mujoco
    load = mujoco.MjModel.from_xml_path if text is None else mujoco.MjModel.from_xml_string
    try:
        found = load(path if text is None else text)
    except ValueError as error:
        raise ModelError(f"{path}: MuJoCo refuses it: {' '.join(str(error).split())}") from error
    for refusal in _refusals(found):
        raise ModelError(f"{path}: {refusal}")
    return found


def _refusals(m: Any) -> Iterator[str]:
    """Yield what about a robot the dynamics of a tree of joints does not say."""
    if not m.nv:
        yield "expected at least one joint that moves, got none."
    if np.any(m.jnt_type < 2):
        place = int(np.argmax(m.jnt_type < 2))
        yield (
            f"expected hinges and slides, got a joint that floats or is a ball: joint {place + 1}. "
            "Remedy: fix the robot's base, and write a ball as three hinges."
        )
    for count, what in COUPLED.items():
        if getattr(m, count, 0):
            yield f"expected joints that only their torques couple, got {what}."
    if m.opt.density or m.opt.viscosity:
        yield "expected no fluid around the robot, got a density or viscosity in <option>."
    if np.any(m.body_gravcomp) or m.opt.wind.any():
        yield "expected no gravity compensation and no wind in the file."


# -- its parts -------------------------------------------------------------------------------------


@dataclass(frozen=True)
class Payload:
    """A mass that may hang at a body, at a point in the body's frame [m]."""

    body: str
    at: tuple[float, ...] = (0.0, 0.0, 0.0)

    @classmethod
    def of(cls, given: str | tuple[str, Sequence[float]]) -> "Payload":
        """Return the payload at a body, by its name, or with a point."""
        body, at = (given, (0.0, 0.0, 0.0)) if isinstance(given, str) else given
        if len(at) != 3 or not np.all(np.isfinite(at)):
            raise ModelError(f"payload: expected a point of three numbers [m], got {at!r}.")
        return cls(body, tuple(map(float, at)))


def tree_of(m: Any, joints: tuple[str, ...], payload: Payload | None) -> RigidTree:
    """Return joints and links in the world's axes, fixed bodies with those that hold them."""
    import mujoco

    data = mujoco.MjData(m)
    data.qpos[:] = m.qpos0
    mujoco.mj_kinematics(m, data)
    mujoco.mj_comPos(m, data)
    n = m.nv
    parents = np.where(m.dof_parentid < 0, n, m.dof_parentid)
    links = _links(m)
    anchors = np.vstack([data.xanchor, np.zeros(3)])
    lumps = [_lump(m, data, np.flatnonzero(links == i), anchors[i]) for i in range(n)]
    masses, centres, tensors = zip(*lumps, strict=True)
    return RigidTree(
        joints,
        tuple(parents.tolist()),
        tuple((m.jnt_type == mujoco.mjtJoint.mjJNT_SLIDE).tolist()),
        _tuples(data.xaxis),
        _tuples(anchors[:n] - anchors[parents]),
        masses,
        _tuples(centres),
        tuple(map(_tuples, tensors)),
        tuple(m.opt.gravity.tolist()),
        tuple(m.qpos0.tolist()),
        () if payload is None else (_held(m, data, links, anchors, payload),),
    )


def _tuples(rows) -> tuple[tuple[float, ...], ...]:
    return tuple(tuple(map(float, row)) for row in rows)


def _links(m: Any) -> np.ndarray:
    """Return for every body the joint that moves it, the last one on its way; -1 for the base."""
    found = np.full(m.nbody, -1)
    for body in range(1, m.nbody):
        last = m.body_dofadr[body] + m.body_dofnum[body] - 1
        found[body] = last if m.body_dofnum[body] else found[m.body_parentid[body]]
    return found


def _lump(m: Any, data: Any, bodies, point) -> tuple[float, np.ndarray, np.ndarray]:
    r"""Return mass, centre and tensor about it: :math:`\sum R J R^T + m (r^2 1 - r r^T)`."""
    masses, at = m.body_mass[bodies], data.xipos[bodies] - point
    mass = float(masses.sum())
    centre = masses @ at / mass if mass else np.zeros(3)
    tensor = np.zeros((3, 3))
    for body, r in zip(bodies, at - centre, strict=True):
        turn = data.ximat[body].reshape(3, 3)
        about = m.body_mass[body] * (r @ r * np.eye(3) - np.outer(r, r))
        tensor += turn @ np.diag(m.body_inertia[body]) @ turn.T + about
    return mass, centre, tensor


def _held(m: Any, data: Any, links, anchors, payload: Payload) -> Added:
    """Return a payload, whose amount is its mass."""
    names = [m.body(i).name for i in range(m.nbody)]
    moved = [name for name, link in zip(names, links, strict=True) if link >= 0]
    if payload.body not in moved:
        raise ModelError(
            f"payload: expected a body among {', '.join(moved)}, got {payload.body!r}."
        )
    body = names.index(payload.body)
    r = data.xpos[body] + data.xmat[body].reshape(3, 3) @ np.array(payload.at)
    r = r - anchors[links[body]]
    tensor = (r @ r * np.eye(3) - np.outer(r, r))[np.triu_indices(3)]
    inertia = (1.0, *r.tolist(), *tensor.tolist())
    return Added("payload", int(links[body]), inertia, "kg", 0.0, 0.0, PROBED_MASS)
