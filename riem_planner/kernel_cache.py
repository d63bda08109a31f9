# SPDX-License-Identifier: Apache-2.0
"""Where compiled kernels are kept: read-only installations, images, files that were damaged.

The first of `NUMBA_CACHE_DIR`, the package's `__pycache__` and `$XDG_CACHE_HOME` (`~/.cache`) that
holds kernels of just this source is read, writable or not; else the first that can be written is
filled; else kernels are compiled in memory. Every file begins with the digest of the rest: what is
truncated or altered is thrown away, compiled anew, and written back.
"""

from __future__ import annotations

import hashlib
import os
import pickle
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any, NamedTuple

from numba.core.caching import Cache, CompileResultCacheImpl, IndexDataCacheFile

_DIGEST = hashlib.sha256().digest_size
_WHOLE = "complete"

_notices: list[str] = []


class Place(NamedTuple):
    """A folder of kernels.

    Attributes
    ----------
    path
        None: kernels are compiled in memory.
    writable
        Whether what is missing there can be kept.
    """

    path: Path | None
    writable: bool

    @property
    def whole(self) -> bool:
        """Whether all kernels that are needed first are there."""
        return self.path is not None and (self.path / _WHOLE).is_file()

    def complete(self) -> None:
        """Note that all kernels that are needed first are there."""
        if self.path is not None and self.writable and not self.whole:
            try:
                (self.path / _WHOLE).touch()
            except OSError as error:
                note(f"kernels can't be kept in {self.path}: {error.strerror}")

    def checked(self) -> bool:
        """Throw away what is damaged; whether all that are needed first are there and sound."""
        if self.path is None:
            return False
        for file in sorted(self.path.glob("*.nb?")):
            try:
                sound = _opened(file.read_bytes()) is not None
            except OSError:
                sound = False
            if not sound:
                discard(file)
        return self.whole


def note(sentence: str) -> None:
    """Keep a sentence for whoever can tell it; each once."""
    if sentence not in _notices:
        _notices.append(sentence)


def tell(notify: Callable[[str], None]) -> None:
    """Call with each sentence that has not been told."""
    while _notices:
        notify(_notices.pop(0))


def discard(file: Path) -> None:
    """Delete a damaged file, and name its folder."""
    note(f"damaged kernels in {file.parent} are compiled anew")
    for each in (file, file.parent / _WHOLE):
        try:
            each.unlink(missing_ok=True)
        except OSError as error:
            note(f"they can't be deleted there ({error.strerror}): do so, or they come back")
            return


def candidates(name: str) -> list[Path]:
    """Folders that kernels of a source may be in, the preferred one first."""
    package = Path(__file__).parent
    home = os.environ.get("XDG_CACHE_HOME") or os.path.expanduser("~/.cache")
    given = os.environ.get("NUMBA_CACHE_DIR")
    return [
        *([Path(given) / name] if given else []),
        package / "__pycache__" / name,
        Path(home) / "riem_planner" / name,
    ]


def _can_be_written(folder: Path) -> str:
    """Why a folder can't be filled; empty if it can."""
    try:
        folder.mkdir(parents=True, exist_ok=True)
        probe = folder / f"probe-{os.getpid()}"
        probe.touch()
        probe.unlink()
    except OSError as error:
        return error.strerror or type(error).__name__
    return ""


def place_of(name: str) -> Place:
    """Where kernels of a source are, or are to be."""
    folders = candidates(name)
    for folder in folders:
        if any(folder.glob("*.nbi")):
            return Place(folder, os.access(folder, os.W_OK))
    for folder in folders:
        why = _can_be_written(folder)
        if not why:
            return Place(folder, True)
        note(f"kernels can't be kept in {folder}: {why}")
    note("kernels are compiled in memory, at every start")
    return Place(None, False)


def _sealed(payload: bytes) -> bytes:
    return hashlib.sha256(payload).digest() + payload


def _opened(data: bytes) -> bytes | None:
    """What was sealed; None if it is damaged."""
    digest, payload = data[:_DIGEST], data[_DIGEST:]
    return payload if payload and hashlib.sha256(payload).digest() == digest else None


class _SealedFiles(IndexDataCacheFile):  # type: ignore[misc]  # numba has no types
    """The index and the machine code of one kernel, each with its digest."""

    def _read(self, path: str) -> Any:
        try:
            data = Path(path).read_bytes()
        except OSError:
            return None
        payload = _opened(data)
        if payload is None:
            discard(Path(path))
            return None
        return pickle.loads(payload)

    def _load_index(self) -> dict[Any, str]:
        found = self._read(self._index_path)
        return found[1] if found is not None and found[0] == self._version else {}

    def _save_index(self, overloads: dict[Any, str]) -> None:
        with self._open_for_write(self._index_path) as stream:
            stream.write(_sealed(self._dump((self._version, overloads))))

    def _load_data(self, name: str) -> Any:
        found = self._read(self._data_path(name))
        if found is None:
            raise FileNotFoundError(name)  # so that it is compiled
        return found

    def _save_data(self, name: str, data: Any) -> None:
        with self._open_for_write(self._data_path(name)) as stream:
            stream.write(_sealed(self._dump(data)))


class _Code(CompileResultCacheImpl):  # type: ignore[misc]
    """How numba packs machine code, without its own search for a folder."""

    def __init__(self, function: Callable[..., Any]) -> None:
        self._lineno = function.__code__.co_firstlineno
        version = f"py{sys.version_info[0]}{sys.version_info[1]}"
        self._filename_base = f"{function.__module__}.{function.__name__}-{self._lineno}.{version}"
        self._locator = self
        self._py_file = function.__code__.co_filename  # of numba's warnings


class KernelCache(Cache):  # type: ignore[misc]
    """The cache of one kernel.

    Parameters
    ----------
    function
        The kernel's source.
    place
        Where it is kept.
    """

    def __init__(self, function: Callable[..., Any], place: Place) -> None:
        assert place.path is not None  # what is compiled in memory has no cache
        self._name, self._py_func = repr(function), function
        self._impl = _Code(function)
        self._cache_path = str(place.path)
        self._writable = place.writable
        self._cache_file = _SealedFiles(self._cache_path, self._impl.filename_base, "")
        self.enable()

    def _save_overload(self, sig: Any, data: Any) -> None:
        if not (self._enabled and self._writable and self._impl.check_cachable(data)):
            return
        try:
            Path(self._cache_path).mkdir(parents=True, exist_ok=True)
            self._cache_file.save(self._index_key(sig, data.codegen), self._impl.reduce(data))
        except OSError as error:  # a full disk; what is compiled works all the same
            note(f"kernels can't be kept in {self._cache_path}: {error.strerror}")
            self._writable = False


def cached(dispatcher: Any, function: Callable[..., Any], place: Place) -> Any:
    """The same dispatcher, which looks for its machine code in a place first."""
    if place.path is not None:
        dispatcher._cache = KernelCache(function, place)
    return dispatcher
