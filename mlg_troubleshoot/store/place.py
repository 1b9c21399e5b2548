"""Where a store is: a file, or a URL that is shown without its password."""

from __future__ import annotations

import re
import stat
from pathlib import Path

import sqlalchemy as sql
from sqlalchemy.exc import ArgumentError

from mlg_troubleshoot.errors import UsageError

_HIDDEN = "***"
# A scheme or a user with a password: a name of a file that is never meant, and would be shown.
_LIKE_A_URL = re.compile(r"[\w+.\-]+:.*@")
# The words of a connection string of libpq.
_LIBPQ = re.compile(
    r"(?:^|\s)(?:host|hostaddr|port|dbname|user|passfile|password|service|sslpassword)\s*=",
    re.IGNORECASE,
)


class Place:
    """A place as it was given (``--store``, ``MLG_STORE``); `UsageError` if no store can be
    there.
    """

    REMEDY = "Give a file in a folder that you may write to, or the URL of a PostgreSQL store."

    def __init__(self, given: str) -> None:
        if "://" not in given and _LIKE_A_URL.match(given):
            raise UsageError(f"--store {_HIDDEN} looks like a URL without its //", self.REMEDY)
        if "://" not in given and _LIBPQ.search(given):
            raise UsageError(
                f"--store {_HIDDEN} looks like a connection string, not a URL", self.REMEDY
            )
        self.url = _url(given) if "://" in given else sql.URL.create("sqlite", database=given)
        backend = self.url.get_backend_name()
        self._secrets = [
            str(text)
            for text in (
                self.url.password,
                *(v for name, v in self.url.query.items() if "password" in name.lower()),
            )
            if text
        ]
        self.file: Path | None = None
        self.shown = self._rendered() if "://" in given else given
        if backend == "sqlite":
            self.file = _file(self.url, self.shown)
            self.url = sql.URL.create("sqlite", database=str(self.file))
        elif backend != "postgresql":
            raise UsageError(f"--store {self.shown} is neither SQLite nor PostgreSQL", self.REMEDY)

    def _rendered(self) -> str:
        query = {
            name: _HIDDEN if "password" in name.lower() else value
            for name, value in self.url.query.items()
        }
        return (
            self.url.set(query=query)
            .render_as_string(hide_password=True)
            .replace("%2A%2A%2A", _HIDDEN)
        )

    def masked(self, said: str) -> str:
        """What a driver said, without the password."""
        for secret in self._secrets:
            said = said.replace(secret, _HIDDEN)
        return said


def _url(given: str) -> sql.URL:
    """A URL; one that cannot be read is not shown, since the place of the password in it is
    unknown.
    """
    scheme, _, rest = given.partition("://")
    shown = f"--store {scheme}://{_HIDDEN}"
    if rest.partition("?")[0].count("@") > 1:
        raise UsageError(
            f"{shown} holds more than one @", "Write an @ of the password as %40, or use ~/.pgpass."
        )
    try:
        return sql.make_url(given)
    except (ArgumentError, ValueError):
        raise UsageError(
            f"{shown} is not a URL of a database, with a number as its port if it has one",
            Place.REMEDY,
        ) from None


def _file(url: sql.URL, shown: str) -> Path:
    """The file of a SQLite store: a regular one, or one that can be made."""
    name = url.database or ""
    if not name.strip() or name == ":memory:" or "\0" in name or url.query or url.host:
        raise UsageError(f"--store {shown!r} is not a file: nothing would be kept", Place.REMEDY)
    try:
        file = Path(name).expanduser()
        mode = file.stat().st_mode
    except RuntimeError:
        raise UsageError(f"--store {shown!r}: the user is not known", Place.REMEDY) from None
    except (OSError, ValueError):
        return file
    if not stat.S_ISREG(mode):
        kind = "a folder" if stat.S_ISDIR(mode) else "a device, a pipe or a socket"
        raise UsageError(f"--store {shown!r} is {kind}, not a file", Place.REMEDY)
    return file
