"""Columnar: what can be taken along as a table, into pandas, Arrow or xarray, and be compared."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from roadlog.errors import MissingExtraError
from roadlog.signals import unit_of

if TYPE_CHECKING:
    import pandas
    import pyarrow
    import xarray


class ByValue:
    """A dataclass with arrays: two are equal when all their fields are, unknown values included."""

    __hash__ = None  # type: ignore[assignment]  # as arrays have none

    def __eq__(self, other: object) -> bool:
        if type(self) is not type(other):
            return NotImplemented
        assert dataclasses.is_dataclass(self)
        names = (f.name for f in dataclasses.fields(self))
        return all(same(getattr(self, name), getattr(other, name)) for name in names)


class Columnar(ByValue):
    """Something with columns of equal length, the first of them `time` in s."""

    def to_columns(self) -> dict[str, NDArray]:
        """Name -> values; SI, NaN where unknown."""
        raise NotImplementedError

    @property
    def attributes(self) -> dict[str, Any]:
        """What tables say beside the units: where it begins, what made it."""
        return {}

    def _repr_html_(self) -> str:
        """The first and last rows, for a notebook."""
        from html import escape

        columns = self.to_columns()
        size = len(columns["time"])
        rows = range(size) if size <= 10 else [*range(5), *range(size - 5, size)]
        head = "".join(f"<th>{escape(n)}<br>{escape(unit_of(n))}</th>" for n in columns)
        body = "".join(
            "<tr>" + "".join(f"<td>{columns[n][k]:.6g}</td>" for n in columns) + "</tr>"
            for k in rows
        )
        return f"<p>{escape(repr(self))}</p><table><tr>{head}</tr>{body}</table>"

    def to_pandas(self) -> pandas.DataFrame:
        """The columns as a data frame, indexed by time; units in `attrs`.

        Raises MissingExtraError.
        """
        try:
            import pandas
        except ModuleNotFoundError:
            raise MissingExtraError("to_pandas", "table") from None
        columns = self.to_columns()
        frame = pandas.DataFrame(columns).set_index("time")
        frame.attrs = {**self.attributes, "units": {name: unit_of(name) for name in columns}}
        return frame

    def to_arrow(self) -> pyarrow.Table:
        """The columns as an Arrow table; units in the fields' metadata.

        Raises MissingExtraError.
        """
        try:
            import pyarrow
        except ModuleNotFoundError:
            raise MissingExtraError("to_arrow", "table") from None
        table = pyarrow.table(self.to_columns())
        fields = [field.with_metadata({"unit": unit_of(field.name)}) for field in table.schema]
        about = {name: str(value) for name, value in self.attributes.items()}
        return table.cast(pyarrow.schema(fields, about))

    def to_xarray(self) -> xarray.Dataset:
        """The columns as a data set over time; units in the variables' `attrs`.

        Raises MissingExtraError.
        """
        try:
            import xarray
        except ModuleNotFoundError:
            raise MissingExtraError("to_xarray", "xarray") from None
        columns = self.to_columns()
        variables = {n: ("time", values, {"units": unit_of(n)}) for n, values in columns.items()}
        return xarray.Dataset(variables, attrs=self.attributes)


def same(one: Any, other: Any) -> bool:
    """Whether two values are equal, arrays in them element by element, NaN to NaN."""
    if isinstance(one, np.ndarray) or isinstance(other, np.ndarray):
        if np.shape(one) != np.shape(other):
            return False
        numeric = np.asarray(one).dtype.kind == "f" and np.asarray(other).dtype.kind == "f"
        return np.array_equal(one, other, equal_nan=numeric)
    if isinstance(one, Mapping) and isinstance(other, Mapping):
        return one.keys() == other.keys() and all(same(one[k], other[k]) for k in one)
    return bool(one == other)


def fixed(values: NDArray) -> NDArray:
    """The same array, not to be changed any more: others look at it too."""
    values.flags.writeable = False
    return values
