"""Results as values: dictionaries, tables, copies and numbers."""

import importlib
from typing import Any

import numpy as np


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
    # JSON has no number for what is not there.
    return None if plain and isinstance(value, float) and not np.isfinite(value) else value


def to_dict(result: Any, plain: Any, names: Any = None) -> Any:
    return {name: _entry(value, plain) for name, value in _fields(result, names).items()}


def reduced(result: Any) -> Any:
    return restored, (type(result), result._text, list(_fields(result).values()))


def restored(cls: Any, text: Any, fields: Any) -> Any:
    for field in fields:
        if isinstance(field, np.ndarray):
            field.flags.writeable = False
    return cls._restored(text, fields)


# Fields that are lists or tuples in a result. Other lists are arrays.
_LISTS = {"flags", "identified", "rotation", "rotation_error", "translation", "translation_error"}
_TUPLES = {"interval_95", "pixel_size", "origin"}


def _from_entry(name: Any, value: Any) -> Any:
    """A field of a result from what `to_dict` made of it."""
    if isinstance(value, dict) and set(value) == {"value", "standard_error", "interval_95"}:
        return from_dict(importlib.import_module("tactile_imaging").Estimate, value)
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

    arrays = {name: value for name, value in _fields(result).items() if isinstance(value, np.ndarray) and value.shape != (3, 3)}
    rows = max((len(value) for value in arrays.values()), default=0)
    columns = {}
    for name, value in arrays.items():
        if len(value) == rows:
            for place in np.ndindex(value.shape[1:]):
                columns["_".join([name, *map(str, place)])] = value[(slice(None), *place)]
    plain = _entry(result, True)
    return pd.DataFrame(columns) if columns else pd.json_normalize(plain)
