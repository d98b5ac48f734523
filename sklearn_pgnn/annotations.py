"""Types in the signatures of public names."""

from os import PathLike
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import ArrayLike

__all__ = ["ArrayLike", "Column", "FilePath", "RandomState", "Table"]

#: a DataFrame or Series of pandas, polars or others, or an array; none of them has a common type
Table: TypeAlias = Any
#: a column, by place or by name
Column: TypeAlias = int | str
#: a seed, or what draws
RandomState: TypeAlias = int | np.random.RandomState | np.random.Generator | None
#: a file or a folder
FilePath: TypeAlias = str | PathLike[str]
