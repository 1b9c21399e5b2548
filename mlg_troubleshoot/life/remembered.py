"""What was read and forecast, remembered in the user's cache folder so as not to be done again.

A file holds the last fit, others the forecasts of a store's gears and when their inspections took
place, each under the hash of all that went into it: this program, the gear, and what was read.
Without them, or where a hash differs, it is computed; the folder may be deleted at any time.
Verdicts always come from the store.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from contextlib import suppress
from functools import cached_property
from hashlib import sha256
from importlib.metadata import version
from pathlib import Path
from typing import Any, TypeVar

import msgspec
import numpy as np

from mlg_troubleshoot.errors import OutputError
from mlg_troubleshoot.gear.gear import Gear
from mlg_troubleshoot.life.chronology import Moment
from mlg_troubleshoot.life.folding import Event, GearKey, GearLife, KeptInspection, moments_of
from mlg_troubleshoot.life.forecast import Forecast, forecast
from mlg_troubleshoot.outputs import write_bytes
from mlg_troubleshoot.store import Record, Store
from mlg_troubleshoot.wear import WearModel, WearPath, fit_wear

T = TypeVar("T")


class _Fit(msgspec.Struct):
    """A model without the readings that it was learnt from."""

    mark: str
    learnt: dict[str, Any]


class _Times(msgspec.Struct):
    """Days and landings of a gear's inspections and repairs."""

    mark: str
    days: list[str]
    landings: list[float | None]


_Quantiles = dict[str, float | None]


class _Ahead(msgspec.Struct):
    """The fields of a gear's forecast, its bands as the bytes of their arrays."""

    mark: str
    joints: dict[int, _Quantiles]
    bands: dict[int, bytes]
    landings_to_limit: _Quantiles | None
    limit_joint: int | None
    landings_to_margin: _Quantiles | None
    next_inspection_landings: float | None
    due_now: str
    due_date: str | None

    @classmethod
    def of(cls, mark: str, ahead: Forecast) -> _Ahead:
        fields = {name: getattr(ahead, name) for name in Forecast.__dataclass_fields__}
        bands = {joint: np.asarray(band).tobytes() for joint, band in ahead.bands.items()}
        return cls(mark, **{**fields, "bands": bands})

    @property
    def forecast(self) -> Forecast:
        fields = {name: getattr(self, name) for name in Forecast.__dataclass_fields__}
        bands = {joint: np.frombuffer(band).reshape(3, -1) for joint, band in self.bands.items()}
        return Forecast(**{**fields, "bands": bands})


class Remembered:
    """The fit and the forecasts of one store for one gear type."""

    def __init__(self, store: Store, gear: Gear) -> None:
        self._gear = gear
        of = gear.geometry_sha256, gear.ensemble_sha256, gear.joint_numbers, gear.limits_in
        bounds = gear.margin.value, gear.horizon.value, gear.accepted_chance.value
        # What the gate of the store judges contents by.
        judged = type(store.judge), gear.hard_limit, gear.confirm_above, gear.joints, gear.areas
        self._mark = _hash([_program(), *(repr(each).encode() for each in (of, bounds, judged))])
        self._name = _hash([store.place.encode()])[:16]
        self._model_mark = ""
        self._new: dict[str, _Ahead] = {}
        self._new_times: dict[str, _Times] = {}

    def moments(self, key: GearKey, events: Sequence[Event]) -> list[Moment]:
        """Read when the events of a gear took place, or recall it without unpacking them."""
        name = " ".join(key)
        inspected = [isinstance(event, KeptInspection) for event in events]
        records = [e.record if isinstance(e, KeptInspection) else e for e in events]
        mark = _hash([self._mark.encode(), repr(inspected).encode(), _content(records)])
        known = self._known_times.get(name)
        if known is None or known.mark != mark:
            found = moments_of(key, events)
            days = [moment.day for moment in found]
            landings = [moment.landings for moment in found]
            known = self._new_times[name] = _Times(mark, days, landings)
        return [*map(Moment, known.days, known.landings)]

    def fit(self, paths: Sequence[WearPath]) -> WearModel:
        """Fit the wear of these paths, or recall it."""
        self._model_mark = mark = _hash(self._of_paths(paths))
        file = self._file("fit")
        known = _read(file, _Fit)
        if known is not None and known.mark == mark:
            return WearModel.from_learnt(known.learnt, paths)
        model = fit_wear(paths)
        _write(file, _Fit(mark, model.learnt()))
        return model

    def forecast(
        self, lives: Sequence[GearLife], model: WearModel | None
    ) -> dict[GearKey, Forecast]:
        """Forecast gears as `forecast` does, or recall what it said of those that have not
        changed.
        """
        if model is None:
            return forecast(lives, model, self._gear)
        made_by = f"{self._mark} {self._model_mark}".encode()
        marks = {life.key: _hash([made_by, _content(life.records)]) for life in lives}
        known = {life.key: self._known.get(" ".join(life.key)) for life in lives}
        recalled = {
            key: ahead.forecast
            for key, ahead in known.items()
            if ahead is not None and ahead.mark == marks[key]
        }
        computed = forecast([life for life in lives if life.key not in recalled], model, self._gear)
        for key, ahead in computed.items():
            self._new[" ".join(key)] = _Ahead.of(marks[key], ahead)
        return {life.key: (recalled | computed)[life.key] for life in lives}

    def save(self) -> None:
        """Remember what is new; nothing happens where the folder cannot be written."""
        if self._new:
            _write(self._file("forecasts"), self._known | self._new)
        if self._new_times:
            _write(self._file("times"), self._known_times | self._new_times)

    def _file(self, what: str) -> Path:
        return _folder() / f"{what}-{self._name}.msgpack"

    @cached_property
    def _known(self) -> dict[str, _Ahead]:
        return _read(self._file("forecasts"), dict[str, _Ahead]) or {}

    @cached_property
    def _known_times(self) -> dict[str, _Times]:
        return _read(self._file("times"), dict[str, _Times]) or {}

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


def _content(records: Sequence[Record]) -> bytes:
    """All that records of one gear say."""
    columns = [(str(r.kind), r.record_id, r.day, r.digest, len(r.packed)) for r in records]
    return b"".join([repr(columns).encode(), *(r.packed for r in records)])


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
