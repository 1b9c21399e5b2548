"""What is refused before a packed workbook is parsed: bombs, declared entities, encrypted or broken archives."""

from __future__ import annotations

import io
import re
import zipfile
import zlib
from collections.abc import Iterator

from mlg_troubleshoot.records.model import FileRefusedError

MAX_EXPANDED_BYTES = 200_000_000
MAX_RATIO = 100
MAX_MEMBERS = 5_000
_SMALL_MEMBER_BYTES = 1_000_000
_CHUNK = 1 << 20
_DECLARATION = re.compile(rb"<!\s*(DOCTYPE|ENTITY)", re.IGNORECASE)
# What zipfile raises: NotImplementedError for compression that it lacks, RuntimeError for encrypted members.
_ZIP_ERRORS = (zipfile.BadZipFile, zlib.error, EOFError, OSError, NotImplementedError, ValueError, RuntimeError)

_DAMAGED = "Open it in a spreadsheet program, save it again as .xlsx, and read the copy."


def damaged(what: str) -> FileRefusedError:
    """Return the refusal of a workbook that is cut off or damaged.

    Parameters
    ----------
    what : str
        What is wrong, in plain words.

    Returns
    -------
    FileRefusedError
        The refusal, to be raised.
    """
    return FileRefusedError(
        "file_damaged", f"the workbook is cut off or damaged ({what})", "a whole workbook", _DAMAGED
    )


class GuardedZip:
    """A packed workbook, checked before anything in it is parsed.

    Parameters
    ----------
    data : bytes
        The file.

    Raises
    ------
    FileRefusedError
        If it is broken, encrypted, would expand too far, or declares entities.
    """

    def __init__(self, data: bytes) -> None:
        try:
            self._zip = zipfile.ZipFile(io.BytesIO(data))
            members = self._zip.infolist()
        except _ZIP_ERRORS:
            raise damaged("its list of parts cannot be read") from None
        if len(members) > MAX_MEMBERS:
            raise _too_large(f"{len(members)} parts in one workbook")
        self._members: dict[str, zipfile.ZipInfo] = {}
        for member in members:
            self._members.setdefault(member.filename.replace("\\", "/").lstrip("/").lower(), member)
        if any(member.flag_bits & 1 for member in members):
            raise FileRefusedError(
                "password_protected",
                "the file is password protected",
                "a workbook without a password",
                "Save a copy without the password and read the copy.",
            )
        if sum(member.file_size for member in members) > MAX_EXPANDED_BYTES:
            raise _too_large(f"{sum(m.file_size for m in members) / 1e6:.0f} MB when unpacked")
        for member in members:
            if member.file_size > max(_SMALL_MEMBER_BYTES, MAX_RATIO * member.compress_size):
                raise _too_large(
                    f"{member.filename} unpacks to {member.file_size / max(member.compress_size, 1):.0f} times its size"
                )
        self._refuse_declarations()

    def _refuse_declarations(self) -> None:
        for name in self._members:
            if name.endswith((".xml", ".rels", ".vml")):
                # A declaration stands before the first element; UTF-16 is searched without its zero bytes.
                head = self.head(name).replace(b"\0", b"")
                if _DECLARATION.search(head):
                    raise FileRefusedError(
                        "xml_declaration",
                        f"{name} declares a document type or entities, which no spreadsheet program writes",
                        "a workbook as a spreadsheet program writes it",
                        _DAMAGED,
                    )

    @property
    def names(self) -> frozenset[str]:
        """Names of the parts, in lower case, with plain slashes."""
        return frozenset(self._members)

    def head(self, name: str, size: int = 65536) -> bytes:
        """Return the start of a part.

        Parameters
        ----------
        name : str
            Part.
        size : int, optional
            Number of bytes at most.

        Returns
        -------
        bytes
            Its first bytes.
        """
        try:
            with self._zip.open(self._members[name]) as part:
                return part.read(size)
        except _ZIP_ERRORS:
            raise damaged(f"{name} cannot be unpacked") from None

    def read(self, name: str) -> bytes:
        """Return a whole part.

        Parameters
        ----------
        name : str
            Part, in lower case.

        Returns
        -------
        bytes
            Its bytes.

        Raises
        ------
        FileRefusedError
            If it is missing, broken or larger than it claims.
        """
        return b"".join(self.chunks(name))

    def chunks(self, name: str) -> Iterator[bytes]:
        """Unpack a part piece by piece.

        Parameters
        ----------
        name : str
            Part, in lower case.

        Yields
        ------
        bytes
            The next piece.

        Raises
        ------
        FileRefusedError
            If it is missing, broken or larger than it claims.
        """
        member = self._members.get(name)
        if member is None:
            raise damaged(f"{name} is missing")
        total = 0
        try:
            with self._zip.open(member) as part:
                while piece := part.read(_CHUNK):
                    total += len(piece)
                    if total > MAX_EXPANDED_BYTES:
                        raise _too_large(f"{name} unpacks to more than it claims")
                    yield piece
        except _ZIP_ERRORS:
            raise damaged(f"{name} cannot be unpacked") from None


def _too_large(what: str) -> FileRefusedError:
    return FileRefusedError(
        "file_too_large",
        f"the workbook is far too large or packed to look small: {what}",
        f"at most {MAX_EXPANDED_BYTES // 1_000_000} MB unpacked and {MAX_RATIO} times the packed size",
        "Copy the inspection table alone into a new workbook and read that.",
    )
