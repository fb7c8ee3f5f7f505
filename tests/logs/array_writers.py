"""Arrays as files of MATLAB, HDF5, Parquet, Feather, NumPy and Excel."""

from collections.abc import Iterable, Mapping, Sequence
from io import BytesIO
from typing import Any

import h5py
import numpy as np
import openpyxl
import pyarrow as pa
from pyarrow import feather, parquet
from scipy.io import savemat

SIGNATURE = b"MATLAB 7.3 MAT-file, Platform: GLNXA64, Created on: Mon Jan  1 00:00:00 2024 HDF5 schema 1.00 ."


def matlab(variables: Mapping[str, Any], packed: bool = True) -> bytes:
    """As `save` does; mappings become structs, and vectors are rows."""
    file = BytesIO()
    savemat(file, dict(variables), do_compression=packed)
    return file.getvalue()


def matlab_73(variables: Mapping[str, Any]) -> bytes:
    """As `save -v7.3` does: HDF5 behind a block of 512 bytes, with matrices transposed."""
    file = BytesIO()
    with h5py.File(file, "w", userblock_size=512) as hdf:
        _matlab_group(hdf, variables)
    content = bytearray(file.getvalue())
    content[: len(SIGNATURE)] = SIGNATURE
    content[len(SIGNATURE) : 124] = b" " * (124 - len(SIGNATURE))
    content[124:128] = b"\x00\x02IM"
    return bytes(content)


def _matlab_group(group: h5py.Group, variables: Mapping[str, Any]) -> None:
    for name, value in variables.items():
        if isinstance(value, Mapping):
            made: Any = group.create_group(name)
            made.attrs["MATLAB_class"] = np.bytes_("struct")
            _matlab_group(made, value)
        elif isinstance(value, str):
            made = group.create_dataset(name, data=np.array([[ord(letter)] for letter in value], np.uint16))
            made.attrs["MATLAB_class"] = np.bytes_("char")
        else:
            made = group.create_dataset(name, data=np.atleast_2d(np.asarray(value)).T)
            made.attrs["MATLAB_class"] = np.bytes_("double")


def hdf5(arrays: Mapping[str, Any], units: Mapping[str, str] = {}, **how: Any) -> bytes:
    file = BytesIO()
    with h5py.File(file, "w") as hdf:
        for name, values in arrays.items():
            hdf.create_dataset(name, data=values, **how)
            if name in units:
                hdf[name].attrs["units"] = units[name]
    return file.getvalue()


def arrow(kind: str, columns: Mapping[str, Any], units: Mapping[str, str] = {}) -> bytes:
    arrays = {name: values if isinstance(values, pa.Array) else pa.array(values) for name, values in columns.items()}
    fields = [
        pa.field(name, array.type, metadata={"unit": units[name]} if name in units else None)
        for name, array in arrays.items()
    ]
    table = pa.Table.from_arrays(list(arrays.values()), schema=pa.schema(fields))
    file = BytesIO()
    write = parquet.write_table if kind == "parquet" else feather.write_feather
    write(table, file)
    return file.getvalue()


def npz(arrays: Mapping[str, Any], packed: bool = False) -> bytes:
    file = BytesIO()
    (np.savez_compressed if packed else np.savez)(file, **arrays)
    return file.getvalue()


def npy(array: Any) -> bytes:
    file = BytesIO()
    np.save(file, array)
    return file.getvalue()


def xlsx(rows: Iterable[Sequence[Any]], **others: Iterable[Sequence[Any]]) -> bytes:
    """A workbook of a sheet `log`, and others by name."""
    book = openpyxl.Workbook()
    for number, (title, cells) in enumerate({"log": rows, **others}.items()):
        sheet = book.create_sheet(title, number)
        for row in cells:
            sheet.append(row)
    del book["Sheet"]
    file = BytesIO()
    book.save(file)
    return file.getvalue()
