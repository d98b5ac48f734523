"""Machines with several dry frictions that act on each other through the mass matrix."""

from sklearn_pgnn import PhysicsModel


def accelerations(mass, forces) -> list[str]:
    """Return what follows from a symmetric mass matrix of two rows, and the forces."""
    (a, b), (_, d) = mass
    f, g = (f"({force})" for force in forces)
    inertia = f"(({a})*({d}) - ({b})**2)"
    return [f"(({d})*{f} - ({b})*{g})/{inertia}", f"(({a})*{g} - ({b})*{f})/{inertia}"]


def cart_pendulum(**parameters) -> PhysicsModel:
    """A cart with a hanging pendulum, dry friction on the rail and in the hinge."""
    coupling = "m*l*cos(phi)"
    forces = "u - Fc*sign(v) + m*l*w**2*sin(phi)", "-m*g*l*sin(phi) - Fp*sign(w)"
    v, w = accelerations([["M + m", coupling], [coupling, "m*l**2"]], forces)
    values = {"M": 1.0, "m": 0.4, "l": 0.5, "g": 9.81, "Fc": 1.0, "Fp": 0.05} | parameters
    units = {"x": "m", "phi": "rad", "v": "m/s", "w": "rad/s"}
    equations = {"x": "v", "phi": "w", "v": v, "w": w}
    return PhysicsModel(units, equations, values, {"u": "N"}, name="cart with pendulum")


def two_link_arm(**parameters) -> PhysicsModel:
    """An arm of two links in a vertical plane, dry friction in both joints."""
    mass = [["a + 2*b*cos(q2)", "d + b*cos(q2)"], ["d + b*cos(q2)", "d"]]
    forces = (
        "u1 + b*sin(q2)*(2*w1*w2 + w2**2) - g1*cos(q1) - g2*cos(q1 + q2) - F1*sign(w1)",
        "u2 - b*sin(q2)*w1**2 - g2*cos(q1 + q2) - F2*sign(w2)",
    )
    w1, w2 = accelerations(mass, forces)
    values = {"a": 0.9, "b": 0.2, "d": 0.25, "g1": 6.0, "g2": 1.5, "F1": 2.0, "F2": 0.8}
    units = {"q1": "rad", "q2": "rad", "w1": "rad/s", "w2": "rad/s"}
    equations, inputs = {"q1": "w1", "q2": "w2", "w1": w1, "w2": w2}, {"u1": "N*m", "u2": "N*m"}
    return PhysicsModel(units, equations, values | parameters, inputs, name="arm")


def stacked_blocks(**parameters) -> PhysicsModel:
    """A block on another, which lies on the ground: dry friction between them and below."""
    equations = {"v1": "(u - F*sign(v1 - v2))/m1", "v2": "(F*sign(v1 - v2) - G*sign(v2))/m2"}
    values = {"m1": 1.0, "m2": 2.0, "F": 3.0, "G": 1.0} | parameters
    return PhysicsModel({"v1": "m/s", "v2": "m/s"}, equations, values, {"u": "N"}, name="blocks")
