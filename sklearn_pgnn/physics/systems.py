"""Ready systems, with the tables and the sources they come from."""

from sklearn_pgnn.physics.model import PhysicsModel
from sklearn_pgnn.physics.parameter import Parameter, by_name


def golf_robot() -> PhysicsModel:
    r"""Return the golf robot: a driven pendulum with dry friction that grows with the load.

    .. math::
        J \ddot\varphi = -m g a \sin\varphi - d\,\dot\varphi
            - r \mu\,\mathrm{sign}(\dot\varphi)
              \max(m a \dot\varphi^2 + m g \cos\varphi,\, 0) + 4 u

    The normal force is kept non-negative above the horizontal, where the friction would otherwise
    drive the pendulum.

    Returns
    -------
    PhysicsModel
        States ``phi`` [rad] and ``omega`` [rad/s], input ``torque`` [N m], output ``phi_measured``.

    References
    ----------
    .. [1] R.-S. Goette, J. Timmermann, "Composed Physics- and Data-driven System Identification
       for Non-autonomous Systems in Control Engineering", 2021, arXiv:2112.08148.

    Examples
    --------
    >>> golf_robot().parameters["J"].value
    0.1445
    """
    friction = "r*mu*sign(omega)*max(m*a*omega**2 + m*g*cos(phi), 0)"
    return PhysicsModel(
        name="golf robot",
        states={"phi": "rad", "omega": "rad/s"},
        inputs={"torque": "N m"},
        outputs={"phi_measured": "phi"},
        parameters=by_name(
            Parameter("m", 0.5241, unit="kg", bounds=(0.05, 5.0)),
            Parameter("a", 0.4702, unit="m", bounds=(0.05, 5.0)),
            Parameter("J", 0.1445, unit="kg m^2", bounds=(0.01, 1.0)),
            Parameter("d", 0.0132, unit="N m s/rad", bounds=(0.0, 1.0)),
            Parameter("r", 0.0245, unit="m", bounds=(0.001, 0.2)),
            Parameter("mu", 1.5136, unit="", bounds=(0.0, 10.0)),
            Parameter("g", 9.81, unit="m/s^2", fixed=True),
        ),
        equations={
            "phi": "omega",
            "omega": f"(-m*g*a*sin(phi) - d*omega - {friction} + 4*torque)/J",
        },
        inertia={"omega": "J"},
        energy={
            "stored": "J*omega**2/2 + m*g*a*(1 - cos(phi))",
            "supplied": "4*torque*omega",
            "dissipated": f"d*omega**2 + omega*{friction}",
        },
    )


def servo_valve(limits: bool = False) -> PhysicsModel:
    r"""Return the servo valve: a second-order lag from voltage to the slider's position.

    .. math:: T_V^2 \ddot y_V = K_V u_V - y_V - 2 D_V T_V \dot y_V

    The position is in units of its largest value (0.42672 mm), as implied by the table's gain of
    0.1 per volt over a range of 10 V.

    Parameters
    ----------
    limits : bool, default=False
        Whether the slider's velocity and acceleration are bounded. The paper gives no values of
        the bounds; those here (260 per second, 9e5 per second squared, in units of the largest
        position) are assumptions.

    Returns
    -------
    PhysicsModel
        States ``y`` [-] and ``v`` [1/s], input ``voltage`` [V], output
        ``y_measured``.

    References
    ----------
    .. [1] R.-S. Goette, J. Timmermann, "Composed Physics- and Data-driven System Identification
       for Non-autonomous Systems in Control Engineering", 2021, arXiv:2112.08148.

    Examples
    --------
    >>> servo_valve().free_parameters
    ('f_V', 'D_V', 'K_V')
    """
    free = "(2*pi*f_V)**2*(K_V*voltage - y) - 4*pi*f_V*D_V*v"
    parameters = [
        Parameter("f_V", 350.0, unit="Hz", bounds=(50.0, 2000.0)),
        Parameter("D_V", 0.5, bounds=(0.01, 5.0)),
        Parameter("K_V", 0.1, unit="1/V", bounds=(0.01, 1.0)),
    ]
    equations = {"y": "v", "v": free}
    if limits:
        parameters += [
            Parameter("v_max", 260.0, unit="1/s", bounds=(1.0, 1e5)),
            Parameter("a_max", 9e5, unit="1/s^2", bounds=(1e3, 1e8)),
        ]
        equations = {"y": "max(min(v, v_max), -v_max)", "v": f"max(min({free}, a_max), -a_max)"}
    return PhysicsModel(
        name="servo valve with limits" if limits else "servo valve",
        states={"y": "", "v": "1/s"},
        inputs={"voltage": "V"},
        outputs={"y_measured": "y"},
        parameters=by_name(*parameters),
        equations=equations,
        energy={
            "stored": "v**2/2 + (2*pi*f_V)**2*y**2/2",
            "supplied": "(2*pi*f_V)**2*K_V*voltage*v",
            "dissipated": "4*pi*f_V*D_V*v**2",
        },
    )


def two_tanks() -> PhysicsModel:
    r"""Return two tanks in cascade: a pump fills the upper one, the lower level is measured.

    .. math::
        \dot x_1 = -k_1 \sqrt{x_1} + k_4 u, \qquad \dot x_2 = k_2 \sqrt{x_1} - k_3 \sqrt{x_2}

    The outflows follow Torricelli's law; an empty tank has no outflow. The constants are typical of
    a laboratory rig (tanks of 20 cm, minutes to settle), and 3 V hold the initial state.

    Returns
    -------
    PhysicsModel
        States ``x1`` and ``x2`` [cm], input ``pump`` [V], output ``level``.

    References
    ----------
    .. [1] M. Schoukens, P. Mattsson, T. Wigren, J.-P. Noel, "Cascaded tanks benchmark combining
       soft and hard nonlinearities", Workshop on Nonlinear System Identification Benchmarks, 2016.

    Examples
    --------
    >>> two_tanks().kinematic_pairs
    {}
    """
    return PhysicsModel(
        name="two tanks",
        states={"x1": "cm", "x2": "cm"},
        inputs={"pump": "V"},
        outputs={"level": "x2"},
        parameters=by_name(
            Parameter("k1", 0.05, unit="cm^0.5/s", bounds=(0.001, 1.0)),
            Parameter("k2", 0.05, unit="cm^0.5/s", bounds=(0.001, 1.0)),
            Parameter("k3", 0.055, unit="cm^0.5/s", bounds=(0.001, 1.0)),
            Parameter("k4", 0.04, unit="cm/(V s)", bounds=(0.001, 1.0)),
        ),
        equations={
            "x1": "-k1*sqrt(max(x1, 0)) + k4*pump",
            "x2": "k2*sqrt(max(x1, 0)) - k3*sqrt(max(x2, 0))",
        },
        initial_state={"x1": 5.76, "x2": 4.760330578512396},
    )


def cart_on_spring() -> PhysicsModel:
    r"""Return a cart between springs, pushed by a force: :math:`m \ddot x = F - k x - d \dot x`.

    Returns
    -------
    PhysicsModel
        States ``x`` [m] and ``v`` [m/s], input ``force`` [N], output ``position``.

    Examples
    --------
    >>> cart_on_spring().kinematic_pairs
    {'v': 'x'}
    """
    return PhysicsModel(
        name="cart on a spring",
        states={"x": "m", "v": "m/s"},
        inputs={"force": "N"},
        outputs={"position": "x"},
        parameters=by_name(
            Parameter("m", 2.0, unit="kg", bounds=(0.1, 50.0)),
            Parameter("k", 40.0, unit="N/m", bounds=(0.1, 1000.0)),
            Parameter("d", 1.5, unit="N s/m", bounds=(0.0, 50.0)),
        ),
        equations={"x": "v", "v": "(-k*x - d*v + force)/m"},
        inertia={"v": "m"},
        energy={
            "stored": "m*v**2/2 + k*x**2/2",
            "supplied": "force*v",
            "dissipated": "d*v**2",
        },
    )
