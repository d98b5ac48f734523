"""Public benchmarks: measured records for the comparison of published methods."""

from dataclasses import dataclass
from functools import partial
from pathlib import Path

import numpy as np
import pandas as pd
from scipy.io import loadmat

from sklearn_pgnn.annotations import FilePath
from sklearn_pgnn.extras import needed_by
from sklearn_pgnn.physics.model import PhysicsModel
from sklearn_pgnn.physics.parameter import Parameter, by_name

#: force on the carriage per volt of the controller's output [N/V]
DRIVE_GAIN = 35.15065188
#: training samples of the drives' records, and their sample interval [s]
DRIVES_TRAIN, DRIVES_STEP = 400, 0.02
#: silverbox: sample rate [Hz], samples of growing amplitude, how many of them stay within the range
#: of the training data, samples with multisines, and how many of these are for training
SILVERBOX_RATE, ARROW, ARROW_WITHIN = 610.35, slice(100, 40_575), 32_000
MULTISINE, MULTISINE_TRAIN = slice(40_650, 127_400), 65_062


@dataclass(frozen=True)
class PublicBenchmark:
    """Training records, test records, and the usual prior model of a benchmark.

    Parameters
    ----------
    X_train, X_test : pandas.DataFrame
        Columns ``trajectory``, ``t`` and the input.
    y_train, y_test : pandas.DataFrame
        The measured output.
    initial_window : int
        Samples at the start of every test trajectory that may be used to estimate its initial
        state; they do not count in the error.
    prior : PhysicsModel
        The usual prior.

    Examples
    --------
    >>> import numpy as np
    >>> from sklearn_pgnn import systems
    >>> X = pd.DataFrame({"trajectory": 0, "t": np.arange(200.0), "pump": 1.0})
    >>> y = pd.DataFrame({"level": np.ones(200)})
    >>> tanks = PublicBenchmark(X[:100], X[100:], y[:100], y[100:], 5, systems.two_tanks())
    >>> len(tanks.y_test) - tanks.initial_window  # samples that count in the error
    95
    """

    X_train: pd.DataFrame
    X_test: pd.DataFrame
    y_train: pd.DataFrame
    y_test: pd.DataFrame
    initial_window: int
    prior: PhysicsModel


def load_emps(*, data_home: FilePath | None = None) -> PublicBenchmark:
    r"""Load the electro-mechanical positioning system: a carriage on a ball screw, at 1 kHz.

    .. math:: M \ddot q = F - F_v \dot q

    Measured in a position control loop; the test record is disturbed by pulses, which are part of
    the force. Input ``force`` [N], output ``position`` [m]. The records contain the controller's
    output in volts; the force is 35.15 N/V times this output.

    Parameters
    ----------
    data_home : path-like, optional
        Folder that contains, directly or in a subfolder, ``DATA_EMPS.mat`` and
        ``DATA_EMPS_PULSES.mat``; by default the package ``nonlinear_benchmarks`` downloads them.

    Returns
    -------
    PublicBenchmark
        One training and one test record; 20 samples may be used for the initial state.

    Raises
    ------
    FileNotFoundError
        If a file is not in the folder.
    ImportError
        If no folder is given and the package is not installed.
    ValueError
        If a file does not contain the records.

    References
    ----------
    .. [1] A. Janot, M. Gautier, M. Brunot, "Data set and reference models of EMPS", Workshop on
       Nonlinear System Identification Benchmarks, 2019.

    Examples
    --------
    >>> emps = load_emps(data_home="downloads")  # doctest: +SKIP
    >>> emps.initial_window  # doctest: +SKIP
    20
    """
    files = _files("EMPS", ("DATA_EMPS.mat", "DATA_EMPS_PULSES.mat"), data_home)
    records = [_read(file, "t", "vir", "qm") for file in files]
    train, test = (
        _tables(name, {"t": t, "force": DRIVE_GAIN * volt}, {"position": q})
        for name, (t, volt, q) in zip(("train", "test"), records, strict=True)
    )
    return _benchmark(train, test, 20, _emps_prior())


def load_cascaded_tanks(*, data_home: FilePath | None = None) -> PublicBenchmark:
    r"""Load the cascaded tanks: a pump and two tanks, one above the other, that can overflow.

    .. math::
        \dot x_1 = -k_1 \sqrt{x_1} + k_4 u, \qquad \dot x_2 = k_2 \sqrt{x_1} - k_3 \sqrt{x_2}

    Input ``pump`` [V], output ``level`` [V] of the lower tank, whose sensor saturates at 10 V,
    sampled every 4 s. The initial state is unknown, but the same in both records. The flow
    coefficients :math:`k` are unknown, too: the prior's values are start values of infinite spread.

    Parameters
    ----------
    data_home : path-like, optional
        Folder that contains, directly or in a subfolder, ``dataBenchmark.mat``; by default the
        package ``nonlinear_benchmarks`` downloads it.

    Returns
    -------
    PublicBenchmark
        One training and one test record; 50 samples may be used for the initial state.

    Raises
    ------
    FileNotFoundError
        If the file is not in the folder.
    ImportError
        If no folder is given and the package is not installed.
    ValueError
        If the file does not contain the records.

    References
    ----------
    .. [1] M. Schoukens, P. Mattsson, T. Wigren, J.-P. Noel, "Cascaded tanks benchmark combining
       soft and hard nonlinearities", Workshop on Nonlinear System Identification Benchmarks, 2016.

    Examples
    --------
    >>> tanks = load_cascaded_tanks(data_home="downloads")  # doctest: +SKIP
    >>> tanks.initial_window  # doctest: +SKIP
    50
    """
    (file,) = _files("Cascaded_Tanks", ("dataBenchmark.mat",), data_home)
    step, u_train, y_train, u_test, y_test = _read(file, "Ts", "uEst", "yEst", "uVal", "yVal")
    train, test = (
        _tables(name, {"t": step[0] * np.arange(u.size), "pump": u}, {"level": y})
        for name, u, y in (("train", u_train, y_train), ("test", u_test, y_test))
    )
    return _benchmark(train, test, 50, _tanks_prior())


def load_coupled_drives(*, data_home: FilePath | None = None) -> PublicBenchmark:
    r"""Load the coupled electric drives: two motors, a belt and a pulley on a spring, at 50 Hz.

    .. math:: G(s) = \frac{k\,\alpha\,\omega_0^2}{(s + \alpha)(s^2 + 2 \xi \omega_0 s + \omega_0^2)}

    Input ``voltage`` [V], output ``pulses`` [1/s] of a pulse counter, which measures only the
    magnitude of the pulley's speed. Two trajectories, ``low`` and ``high``, by the input's
    amplitude; the first 8 s are for training, the following 2 s for the test.

    Parameters
    ----------
    data_home : path-like, optional
        Folder that contains, directly or in a subfolder, ``DATAUNIF.MAT``; by default the
        package ``nonlinear_benchmarks`` downloads it.

    Returns
    -------
    PublicBenchmark
        Two training trajectories and their continuations as test; 10 samples may be used for the
        initial state.

    Raises
    ------
    FileNotFoundError
        If the file is not in the folder.
    ImportError
        If no folder is given and the package is not installed.
    ValueError
        If the file does not contain the records.

    References
    ----------
    .. [1] T. Wigren, M. Schoukens, "Coupled electric drives data set and reference models",
       Technical Report 2017-024, Uppsala University, 2017.

    Examples
    --------
    >>> drives = load_coupled_drives(data_home="downloads")  # doctest: +SKIP
    >>> drives.initial_window  # doctest: +SKIP
    10
    """
    (file,) = _files("CED", ("DATAUNIF.MAT",), data_home)
    u_low, z_low, u_high, z_high = _read(file, "u11", "z11", "u12", "z12")
    t = DRIVES_STEP * np.arange(u_low.size)
    pairs = [
        _tables(name, {"t": t, "voltage": u}, {"pulses": z})
        for name, u, z in (("low", u_low, z_low), ("high", u_high, z_high))
    ]
    X, y = _joined(pairs)
    test = np.tile(np.arange(t.size) >= DRIVES_TRAIN, 2)
    train, rest = (
        (X[rows].reset_index(drop=True), y[rows].reset_index(drop=True)) for rows in (~test, test)
    )
    return _benchmark(train, rest, 10, _drives_prior())


def load_silverbox(*, data_home: FilePath | None = None) -> PublicBenchmark:
    r"""Load the silverbox: an electronic oscillator whose spring hardens, at 610 Hz.

    .. math:: \ddot y = b\,u - d\,\dot y - k\,y

    Input ``drive`` [V], output ``response`` [V], about nine samples per period. Three quarters of
    the multisine are for training. The test trajectories are the rest, ``multisine``; the
    ``arrow``, noise with an amplitude that grows beyond the training data; and ``arrow_within``,
    the part of it that does not. Gain, damping and stiffness are unknown: the prior's values are
    start values of infinite spread.

    Parameters
    ----------
    data_home : path-like, optional
        Folder that contains, directly or in a subfolder, ``SNLS80mV.mat``; by default the
        package ``nonlinear_benchmarks`` downloads it.

    Returns
    -------
    PublicBenchmark
        One training and three test records; 50 samples may be used for the initial state.

    Raises
    ------
    FileNotFoundError
        If the file is not in the folder.
    ImportError
        If no folder is given and the package is not installed.
    ValueError
        If the file does not contain the record.

    References
    ----------
    .. [1] T. Wigren, J. Schoukens, "Three free data sets for development and benchmarking in
       nonlinear system identification", European Control Conference, 2013.

    Examples
    --------
    >>> silverbox = load_silverbox(data_home="downloads")  # doctest: +SKIP
    >>> silverbox.initial_window  # doctest: +SKIP
    50
    """
    *_, file = _files("Silverbox", ("SNLS80mV.mat",), data_home)
    u, y = _read(file, "V1", "V2")
    train, multisine = np.split(np.arange(u.size)[MULTISINE], [MULTISINE_TRAIN])
    arrow = np.arange(u.size)[ARROW]

    def record(name, rows):
        inputs = {"t": np.arange(rows.size) / SILVERBOX_RATE, "drive": u[rows]}
        return _tables(name, inputs, {"response": y[rows]})

    tests = {"multisine": multisine, "arrow": arrow, "arrow_within": arrow[:ARROW_WITHIN]}
    test = _joined([record(name, rows) for name, rows in tests.items()])
    return _benchmark(record("train", train), test, 50, _silverbox_prior())


def _benchmark(train, test, initial_window, prior) -> PublicBenchmark:
    (X_train, y_train), (X_test, y_test) = train, test
    return PublicBenchmark(X_train, X_test, y_train, y_test, initial_window, prior)


# -- files -----------------------------------------------------------------------------------------


def _files(benchmark: str, names, data_home) -> list[Path]:
    """Find the files in a folder, or let the package download them."""
    if data_home is None:
        with needed_by(f"{benchmark} without a folder of its files (data_home)"):
            import nonlinear_benchmarks
        found = getattr(nonlinear_benchmarks, benchmark)(data_file_locations=True)
        return [Path(file) for file in ([found] if isinstance(found, str) else found)]
    return [_below(Path(data_home), name) for name in names]


def _below(folder: Path, name: str) -> Path:
    """Find a file in a folder or below it."""
    found = sorted(folder.rglob(name))
    if not found:
        raise FileNotFoundError(
            f"data_home: expected {name} in {folder} or a folder below it. Remedy: download it "
            f"from nonlinearbenchmark.org, or leave data_home out."
        )
    return found[0]


def _read(file: Path, *names) -> list[np.ndarray]:
    """Read columns of a MATLAB file."""
    found = loadmat(file, variable_names=names)
    missing = [name for name in names if name not in found]
    if missing:
        raise ValueError(
            f"{file}: expected the variables {', '.join(names)}; {missing[0]!r} is missing. "
            f"Remedy: check that it is the benchmark's own file."
        )
    columns = (np.asarray(found[name], dtype=float) for name in names)
    return [column[0] if len(column) == 1 else column[:, 0] for column in columns]


def _tables(trajectory: str, inputs: dict, outputs: dict) -> tuple[pd.DataFrame, pd.DataFrame]:
    """Write a record as two tables."""
    X = pd.DataFrame(inputs)
    X.insert(0, "trajectory", trajectory)
    return X, pd.DataFrame(outputs)


def _joined(records) -> list[pd.DataFrame]:
    """Return the two tables of several records."""
    return [pd.concat(tables, ignore_index=True) for tables in zip(*records, strict=True)]


# -- priors ----------------------------------------------------------------------------------------


def _emps_prior() -> PhysicsModel:
    return PhysicsModel(
        name="EMPS",
        states={"q": "m", "v": "m/s"},
        inputs={"force": "N"},
        outputs={"position": "q"},
        parameters=by_name(
            Parameter("M", 95.0, unit="kg", bounds=(10.0, 1000.0)),
            Parameter("Fv", 203.0, unit="N s/m", bounds=(0.0, 2000.0)),
        ),
        equations={"q": "v", "v": "(force - Fv*v)/M"},
        inertia={"v": "M"},
    )


def _tanks_prior() -> PhysicsModel:
    flow = partial(Parameter, bounds=(1e-4, 1.0), spread=np.inf)
    return PhysicsModel(
        name="cascaded tanks",
        states={"x1": "V", "x2": "V"},
        inputs={"pump": "V"},
        outputs={"level": "x2"},
        parameters=by_name(
            flow("k1", 0.05, unit="V^0.5/s"),
            flow("k2", 0.05, unit="V^0.5/s"),
            flow("k3", 0.05, unit="V^0.5/s"),
            flow("k4", 0.04, unit="1/s"),
        ),
        equations={
            "x1": "-k1*sqrt(max(x1, 0)) + k4*pump",
            "x2": "k2*sqrt(max(x1, 0)) - k3*sqrt(max(x2, 0))",
        },
        initial_state={"x1": 5.0, "x2": 5.0},
    )


def _drives_prior() -> PhysicsModel:
    return PhysicsModel(
        name="coupled drives",
        states={"speed": "1/s", "acceleration": "1/s^2", "drive": "1/s"},
        inputs={"voltage": "V"},
        outputs={"pulses": "speed"},
        parameters=by_name(
            Parameter("k", 0.9, unit="1/(V s)", bounds=(0.05, 20.0)),
            Parameter("alpha", 4.9, unit="1/s", bounds=(0.1, 100.0)),
            Parameter("xi", 0.15, bounds=(0.001, 5.0)),
            Parameter("omega0", 22.9, unit="rad/s", bounds=(1.0, 100.0)),
        ),
        equations={
            "speed": "acceleration",
            "acceleration": "omega0**2*(drive - speed) - 2*xi*omega0*acceleration",
            "drive": "alpha*(k*voltage - drive)",
        },
    )


def _silverbox_prior() -> PhysicsModel:
    unknown = partial(Parameter, bounds=(0.0, 1e7), spread=np.inf)
    return PhysicsModel(
        name="silverbox",
        states={"y": "V", "v": "V/s"},
        inputs={"drive": "V"},
        outputs={"response": "y"},
        parameters=by_name(
            unknown("b", 1.8e5, unit="1/s^2"),
            unknown("d", 20.0, unit="1/s"),
            unknown("k", 1.8e5, unit="1/s^2"),
        ),
        equations={"y": "v", "v": "b*drive - d*v - k*y"},
    )
