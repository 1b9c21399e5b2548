"""The container of old Office files: finding one stream in it."""

from __future__ import annotations

import struct

from mlg_troubleshoot.records.zipguard import damaged

_END = 0xFFFFFFFA


class OleFile:
    """A compound file.

    Parameters
    ----------
    data : bytes
        The file.

    Raises
    ------
    FileRefusedError
        If its tables contradict themselves.
    """

    def __init__(self, data: bytes) -> None:
        self._data = data
        try:
            self._open()
        except (struct.error, IndexError, MemoryError):
            raise damaged("its inner tables are incomplete") from None

    def _open(self) -> None:
        head = self._data[:512]
        (shift, mini_shift) = struct.unpack_from("<HH", head, 30)
        if shift not in (9, 12) or mini_shift != 6:
            raise damaged("its inner tables are incomplete")
        self._size = 1 << shift
        (directory,) = struct.unpack_from("<I", head, 48)
        (self._mini_cutoff, mini_start, _, difat, difat_count) = struct.unpack_from("<5I", head, 56)
        tables = list(struct.unpack_from("<109I", head, 76))
        for _ in range(min(difat_count, len(self._data) // self._size)):
            if difat >= _END:
                break
            entries = struct.unpack(f"<{self._size // 4}I", self._sector(difat))
            tables += entries[:-1]
            difat = entries[-1]
        self._next: list[int] = []
        for table in tables:
            if table < _END:
                self._next += struct.unpack(f"<{self._size // 4}I", self._sector(table))
        entries_data = self._chain(directory)
        self.streams: dict[str, tuple[int, int]] = {}
        root = (0, 0)
        for at in range(0, len(entries_data) - 127, 128):
            (length,) = struct.unpack_from("<H", entries_data, at + 64)
            kind = entries_data[at + 66]
            start, size = struct.unpack_from("<II", entries_data, at + 116)
            name = entries_data[at : at + max(min(length, 64) - 2, 0)].decode("utf-16-le", "replace")
            if kind == 5:
                root = (start, size)
            elif kind == 2:
                self.streams[name.lower()] = (start, size)
        self._mini = self._chain(root[0])[: root[1]] if root[1] else b""
        mini_table = self._chain(mini_start) if mini_start < _END else b""
        self._mini_next = list(struct.unpack(f"<{len(mini_table) // 4}I", mini_table[: len(mini_table) // 4 * 4]))

    def _sector(self, number: int) -> bytes:
        at = (number + 1) * self._size
        piece = self._data[at : at + self._size]
        return piece.ljust(self._size, b"\0") if piece else self._broken()

    @staticmethod
    def _broken() -> bytes:
        raise damaged("it ends too early")

    def _chain(self, start: int) -> bytes:
        pieces: list[bytes] = []
        seen = 0
        while start < _END:
            seen += 1
            if seen > len(self._next) or start >= len(self._next):
                raise damaged("its inner tables run in a circle")
            pieces.append(self._sector(start))
            start = self._next[start]
        return b"".join(pieces)

    def stream(self, name: str) -> bytes:
        """Return the content of a stream.

        Parameters
        ----------
        name : str
            Its name, in lower case.

        Returns
        -------
        bytes
            Its content.

        Raises
        ------
        FileRefusedError
            If its tables contradict themselves.
        """
        start, size = self.streams[name]
        if size >= self._mini_cutoff:
            return self._chain(start)[:size]
        pieces: list[bytes] = []
        while start < _END and len(pieces) * 64 < size:
            if start >= len(self._mini_next):
                raise damaged("its inner tables are incomplete")
            pieces.append(self._mini[start * 64 : start * 64 + 64])
            start = self._mini_next[start]
        return b"".join(pieces)[:size]
