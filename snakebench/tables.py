"""Tables of results: CSV files whose columns a study declares once; they are checked when they are read back.

A declaration maps names of columns to `str`, `int`, `float` or `bool`, or to one of these `| None` where a cell may be
empty. Further columns are allowed, such as parameters of gaits and metrics of plug-ins.
"""

import gzip
import zlib
from collections.abc import Mapping
from pathlib import Path
from typing import Any, get_args

import pandas as pd

from snakebench.controllers import Fourier, Gait
from snakebench.errors import StoreError
from snakebench.evaluation import Evaluation

Columns = dict[str, Any]

# The columns of an evaluation. A diverged run has no metrics.
EVALUATION: Columns = {
    field.alias or name: bool if name == "steady" else str if name == "status" else field.annotation
    for name, field in Evaluation.model_fields.items()
}
_LARGE = 100_000  # size from which a table is compressed [bytes]
_DTYPES: dict[Any, Any] = {int: "int64", float: "float64", bool: "bool", str: "object"}


def table_text(table: pd.DataFrame) -> str:
    """A table as CSV; floats keep every digit, so that equal results are equal bytes."""
    return table.to_csv(index=False, lineterminator="\n")


def table_files(tables: Mapping[str, pd.DataFrame]) -> dict[str, bytes]:
    """Tables as files, by their names: NAME.csv, or NAME.csv.gz from 100 kB on; equal tables are equal bytes."""
    texts = {f"{name}.csv": table_text(table).encode() for name, table in tables.items()}
    large = {f"{name}.gz": gzip.compress(text, mtime=0) for name, text in texts.items() if len(text) >= _LARGE}
    return {name: text for name, text in texts.items() if len(text) < _LARGE} | large


def table_file(path: Path) -> Path:
    """Where the table NAME.csv is: there, or compressed in NAME.csv.gz beside it."""
    packed = path.with_name(f"{path.name}.gz")
    return packed if packed.exists() and not path.exists() else path


def read_table(path: Path, columns: Columns | None = None) -> pd.DataFrame:
    """Read the table NAME.csv, or NAME.csv.gz in its place; it must have the columns, if any are given."""
    texts = {name: str for name, kind in (columns or {}).items() if str in (kind, *get_args(kind))}
    try:
        table = pd.read_csv(  # a name may be NA or null, and a column of mixed types warns
            table_file(path), low_memory=False, dtype=texts, keep_default_na=False, na_values=[""]
        )
    except (OSError, EOFError, ValueError, zlib.error) as error:
        raise StoreError(f"cannot read the table {path}: {error}") from None
    return table if columns is None else checked(table, columns, str(path))


def read_tables(directory: Path, tables: Mapping[str, Columns]) -> dict[str, pd.DataFrame]:
    """The declared tables of a study, by name; one without a file had no rows."""
    return {
        name: read_table(path, columns)
        if table_file(path := directory / f"{name}.csv").exists()
        else checked(pd.DataFrame(columns=list(columns)), columns, name)
        for name, columns in tables.items()
    }


def checked(table: pd.DataFrame, columns: Columns, label: str) -> pd.DataFrame:
    """A table that has the declared columns, with their types.

    A column that may be empty is added where it is missing.
    """
    table = table.copy()
    for name, kind in columns.items():
        types = set(get_args(kind) or (kind,))
        dtype = next(_DTYPES[found] for found in types - {type(None)})
        try:
            if type(None) in types:
                values = table[name] if name in table else pd.Series(None, table.index, dtype=object)
                table[name] = values.astype(dtype if dtype == "object" else "float64")
            elif table[name].isna().any():
                raise ValueError("a cell is empty")
            else:
                table[name] = table[name].astype(dtype)
        except KeyError:
            raise StoreError(f"cannot use the table {label}: it has no column {name}: run its study again") from None
        except (TypeError, ValueError) as error:
            raise StoreError(f"cannot use the table {label}: {name}: {error}: run its study again") from None
    return table


def parametric_gait(kind: type[Gait], row: pd.Series) -> Gait:
    """The gait of the parameters in a row of a table."""
    return kind(**{name: float(row[name]) for name in kind.SPACE})


def fourier_gait(rows: pd.DataFrame) -> Fourier:
    """The gait of a table of coefficients: columns frequency, harmonic, joint, cosine, sine."""
    cosine, sine = (
        tuple(map(tuple, rows.pivot(index="harmonic", columns="joint", values=name).to_numpy().tolist()))
        for name in ("cosine", "sine")
    )
    return Fourier(frequency=float(rows["frequency"].to_numpy()[0]), cosine=cosine, sine=sine)
