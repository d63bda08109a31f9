# SPDX-License-Identifier: Apache-2.0
"""Where compiled code is kept, and what becomes of files that were damaged."""

import os
from pathlib import Path

import numba
import pytest

from riem_planner import kernel_cache
from riem_planner.kernel_cache import Place, cached, place_of


def twice(x):
    return 2.0 * x


def _compiled(place):
    return cached(numba.njit(twice), twice, place)


def _sentences():
    told = []
    kernel_cache.tell(told.append)
    return told


@pytest.fixture(autouse=True)
def _quiet():
    _sentences()
    yield
    _sentences()


@pytest.fixture
def kept(tmp_path):
    place = Place(tmp_path, True)
    first = _compiled(place)
    assert first(2.0) == 4.0
    assert sum(first.stats.cache_misses.values()) == 1
    return place


def test_what_is_compiled_is_loaded_by_the_next_process(kept):
    again = _compiled(kept)
    assert again(3.0) == 6.0
    assert sum(again.stats.cache_hits.values()) == 1
    assert not _sentences()


@pytest.mark.parametrize("suffix", [".nbi", ".nbc"])
@pytest.mark.parametrize("damage", ["empty", "truncated", "altered"])
def test_a_damaged_file_is_named_compiled_anew_and_written_back(kept, suffix, damage):
    (file,) = kept.path.glob(f"*{suffix}")
    data = file.read_bytes()
    changed = bytes([data[-1] ^ 1])
    file.write_bytes(
        {"empty": b"", "truncated": data[: len(data) // 2], "altered": data[:-1] + changed}[damage]
    )
    again = _compiled(kept)
    assert again(3.0) == 6.0
    assert sum(again.stats.cache_misses.values()) == 1
    assert any(str(kept.path) in sentence for sentence in _sentences())
    third = _compiled(kept)
    assert third(3.0) == 6.0
    assert sum(third.stats.cache_hits.values()) == 1
    assert not _sentences()


def test_a_look_at_all_of_them_finds_what_is_damaged(kept):
    kept.complete()
    assert kept.checked()
    (file,) = kept.path.glob("*.nbc")
    file.write_bytes(b"nonsense" * 10)
    assert not kept.checked()
    assert not file.exists()
    assert any(str(kept.path) in sentence for sentence in _sentences())


def test_what_cannot_be_written_is_read_all_the_same(kept):
    (index,) = kept.path.glob("*.nbi")
    before = index.stat().st_mtime_ns
    again = _compiled(Place(kept.path, False))
    assert again(3.0) == 6.0
    assert again(3) == 6.0  # another signature, which is compiled in memory
    assert sum(again.stats.cache_hits.values()) == 1
    assert index.stat().st_mtime_ns == before


def test_the_first_folder_that_has_them_is_read_else_the_first_writable_one_filled(
    tmp_path, monkeypatch
):
    blocked = tmp_path / "file"
    blocked.touch()
    monkeypatch.setenv("NUMBA_CACHE_DIR", str(blocked))
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "home"))
    monkeypatch.setattr(kernel_cache, "__file__", str(tmp_path / "package" / "kernel_cache.py"))
    given, package, home = kernel_cache.candidates("kernels-0")
    assert place_of("kernels-0") == Place(package, True)
    (sentence,) = _sentences()
    assert str(given) in sentence
    home.mkdir(parents=True)
    (home / "twice.nbi").touch()
    assert place_of("kernels-0") == Place(home, True)
    monkeypatch.setattr(os, "access", lambda path, mode: Path(path) != home)
    assert place_of("kernels-0") == Place(home, False)
    (home / "twice.nbi").unlink()
    monkeypatch.setattr(kernel_cache, "_can_be_written", lambda folder: "Read-only file system")
    assert place_of("kernels-0") == Place(None, False)
    told = _sentences()
    assert sum("Read-only file system" in sentence for sentence in told) == 3
    assert "in memory" in told[-1]


def test_in_memory_there_is_no_cache():
    nowhere = _compiled(Place(None, False))
    assert nowhere(2.0) == 4.0
    assert not nowhere.stats.cache_misses or sum(nowhere.stats.cache_misses.values()) <= 1
