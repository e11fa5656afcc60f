"""Columnar: what can be taken along as a table, into pandas or Arrow."""

from __future__ import annotations

from typing import TYPE_CHECKING

from numpy.typing import NDArray

from roadlog.errors import MissingExtraError

if TYPE_CHECKING:
    import pandas
    import pyarrow


class Columnar:
    """Something with columns of equal length, the first of them `time` in s."""

    def to_columns(self) -> dict[str, NDArray]:
        """Name -> values; SI, NaN where unknown."""
        raise NotImplementedError

    def to_pandas(self) -> pandas.DataFrame:
        """The columns as a data frame, indexed by time. Raises MissingExtraError."""
        try:
            import pandas
        except ModuleNotFoundError:
            raise MissingExtraError("to_pandas", "table") from None
        return pandas.DataFrame(self.to_columns()).set_index("time")

    def to_arrow(self) -> pyarrow.Table:
        """The columns as an Arrow table. Raises MissingExtraError."""
        try:
            import pyarrow
        except ModuleNotFoundError:
            raise MissingExtraError("to_arrow", "table") from None
        return pyarrow.table(self.to_columns())
