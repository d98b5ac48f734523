"""Records with their simulations as a table, and as files for programs that show time series."""

import xml.etree.ElementTree as ET
from collections.abc import Mapping
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np
import pandas as pd

from sklearn_pgnn.annotations import ArrayLike
from sklearn_pgnn.extras import needed_by
from sklearn_pgnn.inspection.runs import run_estimators
from sklearn_pgnn.trajectories.reader import TIME, TRAJECTORY

#: stem of the files, and the column in which records follow one another [s]
RUNS, AXIS = "runs", "time"
#: stands between an output and whose it is; programs make folders of it
OF = "/"


def simulated_records(
    estimator: Any, X: ArrayLike | None = None, y: ArrayLike | None = None
) -> pd.DataFrame:
    """Return records with their simulations in free run, and the residual, on one time axis.

    Parameters
    ----------
    estimator : ModelDiagnosis, PhysicsModel, estimator, or mapping of str to these
        A fitted diagnosis brings its own records, simulated by the model as given, re-tuned and
        extended.
    X : DataFrame or array of shape (n_samples, n_columns), optional
        Time [s], inputs and, where known, initial states; see `ModelDiagnosis.fit`.
    y : array-like of shape (n_samples, n_outputs) or (n_samples,), optional
        Measured outputs.

    Returns
    -------
    DataFrame
        ``time`` [s], in which the records follow one another, ``trajectory`` and ``t``, the inputs,
        and of every output ``name/measured``, one column for each model, and ``name/residual``,
        measured minus simulated by the last model.

    Raises
    ------
    ValueError
        If X or y is missing, or no record of the model.

    Examples
    --------
    >>> from sklearn_pgnn import PhysicsModel
    >>> lag = PhysicsModel({"y": "V"}, {"y": "(u - y)/T"}, {"T": 2.0}, {"u": "V"})
    >>> X = np.column_stack([np.arange(5.0), np.ones(5)])
    >>> table = simulated_records({"slow": lag}, X, np.ones(5))
    >>> table.columns.tolist()
    ['time', 'trajectory', 't', 'u', 'y/measured', 'y/slow', 'y/residual']
    """
    runs, tables, begins = run_estimators(estimator, X, y), [], 0.0
    for r, t in enumerate(runs.t):
        columns: dict[str, Any] = {AXIS: begins + t - t[0], TRAJECTORY: runs.names[r], TIME: t}
        columns |= dict(zip(runs.model.inputs, runs.u[r].T, strict=True))
        for i, output in enumerate(runs.model.outputs):
            measured = runs.measured[r][:, i]
            found = {name: of[r][:, i] for name, of in runs.simulated.items()}
            columns[f"{output}{OF}measured"] = measured
            columns |= {f"{output}{OF}{name}": values for name, values in found.items()}
            columns[f"{output}{OF}residual"] = measured - list(found.values())[-1]
        tables.append(pd.DataFrame(columns))
        begins = float(tables[-1][AXIS].iloc[-1] + np.median(np.diff(t)))
    return pd.concat(tables, ignore_index=True)


def check_kind(kind: str | None) -> None:
    """Refuse a kind of file whose library is not installed."""
    with needed_by(f"Writing a {kind} file"):
        if kind == "parquet":
            import pyarrow  # noqa: F401
        if kind == "mcap":
            import rosbags  # noqa: F401


def write_runs(table: pd.DataFrame, folder: Path, kind: str) -> None:
    """Write a table of records and simulations, and a layout of PlotJuggler that shows it."""
    path, called = folder / f"{RUNS}.{kind}", {name: name for name in table.columns}
    if kind == "csv":
        table.to_csv(path, index=False)
    elif kind == "parquet":
        table.to_parquet(path, index=False)
    else:
        topics = {name: "/" + name.replace(" ", "_") for name in table.columns}
        _write_mcap(table, topics, path)
        called = {name: f"{topic}/data" for name, topic in topics.items()}
    (folder / f"{RUNS}.xml").write_text(_layout(called), encoding="utf-8")


def _write_mcap(table: pd.DataFrame, topics: Mapping[str, str], path: Path) -> None:
    """Write every column as a topic of numbers, a sample without a value as no message."""
    from rosbags.rosbag2 import StoragePlugin, Writer
    from rosbags.typesys import Stores, get_typestore

    types = get_typestore(Stores.ROS2_HUMBLE)
    number = types.types["std_msgs/msg/Float64"]
    at = np.round(1e9 * table[AXIS]).astype(np.int64)
    with TemporaryDirectory() as folder:
        bag = Path(folder, RUNS)
        with Writer(bag, version=9, storage_plugin=StoragePlugin.MCAP) as writer:
            for name in table.columns.drop([AXIS, TRAJECTORY]):
                topic = writer.add_connection(topics[name], number.__msgtype__, typestore=types)
                for time, value in zip(at, table[name], strict=True):
                    if np.isfinite(value):
                        message = types.serialize_cdr(number(data=value), number.__msgtype__)
                        writer.write(topic, time, message)
        (found,) = bag.glob("*.mcap")
        path.write_bytes(found.read_bytes())


def _layout(called: Mapping[str, str]) -> str:
    """Return a layout with a tab for every output: the simulations above the residual."""
    root = ET.Element("root")
    named = {"parent": "main_window", "name": "Main Window"}
    window = ET.SubElement(root, "tabbed_widget", named)
    of_outputs: dict[str, list[str]] = {}
    for name, shown in called.items():
        if OF in name:
            of_outputs.setdefault(name.rpartition(OF)[0], []).append(shown)
    for output, names in of_outputs.items():
        tab = ET.SubElement(window, "Tab", tab_name=output, containers="1")
        box = ET.SubElement(tab, "Container")
        split = ET.SubElement(box, "DockSplitter", orientation="-", count="2", sizes="0.7;0.3")
        for title, curves in ((output, names[:-1]), ("residual", names[-1:])):
            area = ET.SubElement(split, "DockArea", name=title)
            plot = ET.SubElement(area, "plot", mode="TimeSeries", style="Lines")
            plot.extend(ET.Element("curve", name=name) for name in curves)
    return ET.tostring(root, encoding="unicode", xml_declaration=True)
