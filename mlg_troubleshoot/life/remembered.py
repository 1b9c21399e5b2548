"""What was read and forecast, remembered in the user's cache folder so as not to be done again.

A file holds the last fit, others what a store's gears look like in their fleet, each under the hash
of all that went into it: this program, the gear, and the records as they stand in the store.
Without them, or where a hash differs, it is computed; the folder may be deleted at any time.
What is remembered of gears is believed only while all records stand as they did, and of a gear
only until it has a new one.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from contextlib import suppress
from dataclasses import replace
from functools import cached_property
from hashlib import sha256
from importlib.metadata import version
from pathlib import Path
from typing import Any, TypeVar

import msgspec
import numpy as np

from mlg_troubleshoot.errors import OutputError
from mlg_troubleshoot.gear.gear import Gear
from mlg_troubleshoot.life.folding import GearKey, GearLife
from mlg_troubleshoot.life.forecast import Forecast, forecast
from mlg_troubleshoot.life.landings_left import FleetLine
from mlg_troubleshoot.outputs import write_bytes
from mlg_troubleshoot.store import Store
from mlg_troubleshoot.wear import WearModel, WearPath, fit_wear

T = TypeVar("T")


class _Fit(msgspec.Struct):
    """A model without the readings that it was learnt from."""

    mark: str
    learnt: dict[str, Any]


_Quantiles = dict[str, float | None]


class _Ahead(msgspec.Struct):
    """The fields of a gear's forecast, its bands as the bytes of their arrays."""

    joints: dict[int, _Quantiles]
    bands: dict[int, bytes]
    landings_to_limit: _Quantiles | None
    limit_joint: int | None
    landings_to_margin: _Quantiles | None
    next_inspection_landings: float | None
    due_now: str
    due_date: str | None
    departures: dict[int, float]

    @classmethod
    def of(cls, ahead: Forecast) -> _Ahead:
        fields = {name: getattr(ahead, name) for name in Forecast.__dataclass_fields__}
        bands = {joint: np.asarray(band).tobytes() for joint, band in ahead.bands.items()}
        return cls(**{**fields, "bands": bands})

    @property
    def forecast(self) -> Forecast:
        fields = {name: getattr(self, name) for name in Forecast.__dataclass_fields__}
        bands = {joint: np.frombuffer(band).reshape(3, -1) for joint, band in self.bands.items()}
        return Forecast(**{**fields, "bands": bands})


class _Seen(msgspec.Struct):
    """A gear in its fleet: what stands of it, and what a model says, if it was asked.

    model: hash of what the model learnt from.
    """

    line: FleetLine
    due: _Ahead
    model: str = ""
    ahead: _Ahead | None = None


class Remembered:
    """The fit of one store for one gear type, and what is known of its gears."""

    def __init__(self, store: Store, gear: Gear) -> None:
        self._store = store
        self._gear = gear
        of = gear.geometry_sha256, gear.ensemble_sha256, gear.joint_numbers, gear.limits_in
        bounds = gear.margin.value, gear.horizon.value, gear.accepted_chance.value
        # What the gate of the store judges contents by.
        judged = type(store.judge), gear.hard_limit, gear.confirm_above, gear.joints, gear.areas
        self._mark = _hash([_program(), *(repr(each).encode() for each in (of, bounds, judged))])
        self._file = _folder() / f"fleet-{_hash([store.place.encode()])[:16]}.msgpack"
        self._model_mark = ""
        self._is_new = False
        # Records that what is known stands on: the newest number, and the hash of all of them.
        self._stands_on = 0, ""

    def fit(self, paths: Sequence[WearPath], progress: Callable[[int, int], None]) -> WearModel:
        """Fit the wear of these paths, or recall it."""
        self._model_mark = mark = _hash(self._of_paths(paths))
        file = _folder() / "fit.msgpack"
        known = _read(file, _Fit)
        if known is not None and known.mark == mark:
            return WearModel.from_learnt(known.learnt, paths)
        model = fit_wear(paths, progress=progress)
        _write(file, _Fit(mark, model.learnt()))
        return model

    def is_known(self, key: GearKey, model: WearModel | None) -> bool:
        """Whether a gear's line is known, and what the model says of it, if there is one."""
        seen = self._seen.get(key)
        return seen is not None and (model is None or seen.model == self._model_mark)

    def look(self, lives: Sequence[GearLife], model: WearModel | None) -> None:
        """Find out what is not known of gears, and remember it."""
        self._is_new = self._is_new or bool(lives)
        found = forecast(lives, model, self._gear)
        for life in lives:
            ahead = found[life.key]
            # Nothing else is known without a model.
            due = _Ahead.of(replace(ahead, departures={}) if ahead.due_now else Forecast())
            seen = _Seen(FleetLine.of(life), due)
            if model is not None:
                seen.model = self._model_mark
                seen.ahead = _Ahead.of(ahead)
            self._seen[life.key] = seen

    def line(self, key: GearKey) -> FleetLine:
        return self._seen[key].line

    def forecast(self, key: GearKey, model: WearModel | None) -> Forecast:
        """The forecast of a gear; without a model only whether it is due now."""
        seen = self._seen[key]
        return (seen.due if model is None or seen.ahead is None else seen.ahead).forecast

    def save(self) -> None:
        """Remember what is new; nothing happens where the folder cannot be written."""
        if self._is_new:
            _write(self._file, (self._mark, *self._stands_on, [*self._seen.values()]))

    @cached_property
    def _seen(self) -> dict[GearKey, _Seen]:
        nothing: tuple[str, int, str, list[_Seen]] = "", 0, "", []
        mark, up_to, digest, gears = _read(self._file, tuple[str, int, str, list[_Seen]]) or nothing
        newest = self._store.count()
        hashed = sha256()
        for block in self._store.raw(0, up_to):
            hashed.update(block)
        stands = (mark, digest) == (self._mark, hashed.hexdigest())
        for block in self._store.raw(up_to, newest):
            hashed.update(block)
        self._stands_on = newest, hashed.hexdigest()
        changed = set(self._store.gears(after=up_to))
        return {seen.line.key: seen for seen in gears if stands and seen.line.key not in changed}

    def _of_paths(self, paths: Iterable[WearPath]) -> Iterable[bytes]:
        yield self._mark.encode()
        for path in paths:
            yield repr((path.unit, path.reading_u)).encode()
            yield np.asarray(path.usage).tobytes()
            yield np.asarray(path.value).tobytes()


def _hash(parts: Iterable[bytes]) -> str:
    found = sha256()
    for part in parts:
        found.update(len(part).to_bytes(8, "big"))
        found.update(part)
    return found.hexdigest()


def _program() -> bytes:
    """The version of this program and its text."""
    files = sorted(Path(__file__).parents[1].rglob("*.py"))
    made = version("mlg-troubleshoot"), version("numpy"), version("scipy")
    texts = [file.read_bytes() for file in files]
    return _hash([repr(made).encode(), *texts]).encode()


def _folder() -> Path:
    from platformdirs import user_cache_path

    return user_cache_path("mlg")


def _read(file: Path, kind: type[T]) -> T | None:
    """What was remembered; None if there is nothing or something else stands there."""
    try:
        return msgspec.msgpack.decode(file.read_bytes(), type=kind)
    except (OSError, msgspec.MsgspecError):
        return None


def _write(file: Path, what: Any) -> None:
    with suppress(OutputError):
        write_bytes(file, msgspec.msgpack.encode(what))
