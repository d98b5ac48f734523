"""Priors of several depths, from hardly any physics to the paper's."""

from sklearn_pgnn import systems

#: of the golf robot without dry friction
_NO_DRY_FRICTION = {
    "no friction": ("(-m*g*a*sin(phi) + 4*torque)/J", "0*omega"),
    "viscous friction": ("(-m*g*a*sin(phi) - d*omega + 4*torque)/J", "d*omega**2"),
}


def golf_robot(friction):
    """Return the golf robot's model with less friction than the paper's has."""
    golf = systems.golf_robot()
    if friction not in _NO_DRY_FRICTION:
        return golf
    rate, dissipated = _NO_DRY_FRICTION[friction]
    needless = {"r", "mu"} | ({"d"} if friction == "no friction" else set())
    return golf.replace(
        name=f"golf robot with {friction}",
        equations={"phi": "omega", "omega": rate},
        parameters=[p for name, p in golf.parameters.items() if name not in needless],
        energy={**golf.energy, "dissipated": dissipated},
    )


def servo_valve(limits):
    """Return the valve's model with none, one or both of its limits."""
    if limits == "no limit":
        return systems.servo_valve()
    valve = systems.servo_valve(limits=True)
    if limits == "velocity limit":  # an acceleration that the valve never reaches
        return valve.with_parameters(a_max=1e8)
    return valve


#: plant, and its priors from shallow to deep
DEPTHS = {
    "golf robot, 250 Hz": (golf_robot, ("no friction", "viscous friction", "dry friction too")),
    "valve": (servo_valve, ("no limit", "velocity limit", "acceleration limit too")),
}


def make_prior(plant, depth):
    """Return a plant's prior of a given depth."""
    return DEPTHS[plant][0](depth)
