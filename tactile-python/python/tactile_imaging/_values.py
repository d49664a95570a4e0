"""Results as values: dictionaries, tables, copies and numbers."""

import importlib
import tempfile
from pathlib import Path
from typing import Any

import numpy as np


class PressFrame:
    """A frame of a press, `press[number]`, whose results are computed on demand."""

    def __init__(self, press: Any, number: int) -> None:
        self.press, self.number = press, number

    def __getattr__(self, name: str) -> Any:
        if name not in self.__dir__():
            raise AttributeError(f"a frame of a press has no {name}")
        return getattr(self.press, name)(self.number)

    def __dir__(self) -> Any:
        return ["image", "contact", "surface", "control_points", "matching", "strain", "plot"]

    def __repr__(self) -> str:
        return f"{self.press!r}[{self.number}]"


def _fields(result: Any, names: Any = None) -> Any:
    return {name: getattr(result, name) for name in names or result._fields}


def _is_result(value: Any) -> Any:
    return hasattr(type(value), "_fields") and hasattr(type(value), "_restored")


def _entry(value: Any, plain: Any) -> Any:
    if _is_result(value):
        return to_dict(value, plain)
    if isinstance(value, (list, tuple)):
        entries = [_entry(entry, plain) for entry in value]
        return entries if plain or isinstance(value, list) else tuple(entries)
    if isinstance(value, dict):
        return {name: _entry(entry, plain) for name, entry in value.items()}
    if plain and isinstance(value, (np.ndarray, np.generic)):
        return _entry(value.tolist(), plain)
    # JSON has no number for a missing value.
    return None if plain and isinstance(value, float) and not np.isfinite(value) else value


def to_dict(result: Any, plain: Any, names: Any = None) -> Any:
    names = names or [*result._fields, *result._computed]
    return {name: _entry(value, plain) for name, value in _fields(result, names).items()}


def reduced(result: Any) -> Any:
    return restored, (type(result), result._text, list(_fields(result).values()))


def reduced_gel(sensor: Any) -> Any:
    with tempfile.TemporaryDirectory() as folder:
        sensor.save(Path(folder) / "gel.toml")
        files = {path.name: path.read_bytes() for path in Path(folder).iterdir()}
    return restored_gel, (type(sensor), files, sensor.order)


def restored_gel(cls: Any, files: Any, order: Any) -> Any:
    with tempfile.TemporaryDirectory() as folder:
        for name, content in files.items():
            (Path(folder) / name).write_bytes(content)
        return cls.load(Path(folder) / "gel.toml", order=order)


def restored(cls: Any, text: Any, fields: Any) -> Any:
    for field in fields:
        if isinstance(field, np.ndarray):
            field.flags.writeable = False
    return cls._restored(text, fields)


# Fields that are lists or tuples in a result. Other lists are arrays.
_LISTS = {"flags", "identified", "rotation", "rotation_error", "translation", "translation_error", "counts"}
_TUPLES = {"interval_95", "pixel_size", "origin", "depth_error", "shear"}
# Arrays of other numbers than 64-bit ones.
_TYPES = {"gradient": np.float32, "labels": np.uint16}


def _from_entry(name: Any, value: Any) -> Any:
    """A field of a result, restored from the output of `to_dict`."""
    if name == "grid" and isinstance(value, dict):
        return from_dict(importlib.import_module("tactile_imaging").StrainGrid, value)
    if isinstance(value, dict) and set(value) == {"value", "standard_error", "interval_95"}:
        return from_dict(importlib.import_module("tactile_imaging").Estimate, value)
    if name == "contacts":
        return [from_dict(importlib.import_module("tactile_imaging").GelContact, contact) for contact in value]
    if name in _TYPES and value is not None:
        parts = value if isinstance(value, (list, tuple)) and name == "gradient" else [value]
        arrays = [np.asarray(part, _TYPES[name]) for part in parts]
        return tuple(arrays) if name == "gradient" else arrays[0]
    if name in _TUPLES and isinstance(value, (list, tuple)):
        return tuple(_from_entry("", entry) for entry in value)
    if not isinstance(value, list) or name in _LISTS:
        return value
    array = np.asarray(value)
    return array.astype(float) if array.dtype == object else array


def from_dict(cls: Any, fields: Any) -> Any:
    missing = [name for name in cls._fields if name not in fields]
    if missing:
        raise ValueError(f"{cls.__name__} has the fields {cls._fields}, missing {missing}")
    value, error = fields.get("value"), fields.get("standard_error")
    numbers = isinstance(value, float) and isinstance(error, float)
    text = f"{value:.6e} ± {error:.1e}" if numbers else "from a dictionary"
    try:
        return restored(cls, text, [_from_entry(name, fields[name]) for name in cls._fields])
    except (TypeError, ValueError) as error:
        raise ValueError(f"these are no fields of {cls.__name__}: {error}") from error


def equal(one: Any, other: Any) -> Any:
    if type(one) is not type(other):
        return False
    if _is_result(one):
        return all(equal(a, b) for a, b in zip(_fields(one).values(), _fields(other).values()))
    if isinstance(one, np.ndarray):
        return np.array_equal(one, other, equal_nan=one.dtype.kind == "f")
    if isinstance(one, (list, tuple)):
        return len(one) == len(other) and all(map(equal, one, other))
    return one == other or (one != one and other != other)


def number(result: Any) -> Any:
    value = getattr(result, "value", None)
    if not isinstance(value, float):
        raise TypeError(f"a {type(result).__name__} is no number")
    return value


def formatted(result: Any, spec: Any) -> Any:
    return format(number(result), spec) if spec else repr(result)


def to_dataframe(result: Any) -> Any:
    pd: Any = importlib.import_module("pandas")

    names = [*result._fields, *result._computed]
    arrays = {name: value for name, value in _fields(result, names).items() if isinstance(value, np.ndarray) and value.shape != (3, 3)}
    rows = max((len(value) for value in arrays.values()), default=0)
    columns = {}
    for name, value in arrays.items():
        if len(value) == rows:
            for place in np.ndindex(value.shape[1:]):
                columns["_".join([name, *map(str, place)])] = value[(slice(None), *place)]
    plain = _entry(result, True)
    return pd.DataFrame(columns) if columns else pd.json_normalize(plain)


def to_vtk(result: Any, path: Any) -> None:
    """See `StrainBetween.to_vtk`."""
    places = result if result.grid is None else result.grid
    count, axes = places.points.shape
    counts = list(getattr(places, "counts", []))

    def rows(array: Any) -> str:
        full = np.zeros((len(array), 3, *array.shape[2:]))
        full[:, : array.shape[1]] = array
        return "\n".join(" ".join(f"{x:.17g}" for x in row) for row in full.reshape(-1, 3))

    if counts:
        steps = [np.unique(places.points[:, k])[:2] for k in range(axes)]
        spacing = next((float(step[1] - step[0]) for step in steps if len(step) == 2), 1.0)
        shape, origin = counts + [1] * (3 - axes), rows(places.points[:1])
        head = f"DATASET STRUCTURED_POINTS\nDIMENSIONS {' '.join(map(str, shape))}\nORIGIN {origin}\nSPACING{f' {spacing:.17g}' * 3}"
    else:
        head = f"DATASET POLYDATA\nPOINTS {count} double\n{rows(places.points)}"
    parts = ["# vtk DataFile Version 3.0\ndisplacement and strain\nASCII", head, f"POINT_DATA {count}"]
    fields = [("VECTORS displacement", places.displacements), ("TENSORS strain", places.strains), ("TENSORS standard_error", places.standard_errors)]
    parts += [f"{name} double\n{rows(array)}" for name, array in fields]
    with open(path, "w", encoding="ascii") as file:
        file.write("\n".join(parts) + "\n")
