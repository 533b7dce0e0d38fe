"""Claims: one owner a block, found when lost, never two at a time by mistake."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import time
from pathlib import Path
from typing import Any

import pytest
from store_tools import claim_and_tell, process_context

from chimera_hpc.base import files, processes
from chimera_hpc.base.processes import is_gone, process_identity
from chimera_hpc.store import claims
from chimera_hpc.store.claims import (
    Claim,
    claim_block,
    forget_points,
    live_claims,
    remove_stale,
)


def claim_file(store: Path, block: int | str, attempt: int = 1) -> Path:
    return store / "claims" / f"{block}.{attempt}.json"


def make_foreign(claim: Claim) -> None:
    """Have the claim look as if made on another machine, where no one can look for its process."""
    info = json.loads(claim.path.read_bytes())
    claim.path.write_text(json.dumps({**info, "process": "00000000-1-1", "host": "elsewhere"}))


def expire(claim: Claim) -> None:
    age = time.time() - 2 * claim.expiry
    os.utime(claim.path, (age, age))


def taken(store: Path, block: int = 3, **options: Any) -> Claim:
    claim = claim_block(store, block, 7, **options)
    assert claim is not None
    return claim


def test_a_block_has_one_owner_until_he_releases_it(tmp_path: Path) -> None:
    claim = taken(tmp_path)
    assert (claim.attempts, claim.lost) == (1, ())
    assert claim_block(tmp_path, 3, 8) is None
    assert claim_block(tmp_path, 4, 8) is not None
    claim.release()
    assert not claim_file(tmp_path, 3).exists()
    assert taken(tmp_path).attempts == 1


def test_claim_file_says_who_works_there(tmp_path: Path) -> None:
    claim = taken(tmp_path, note={"first": 12})
    info = json.loads(claim.path.read_bytes())
    assert (info["run"], info["pid"], info["attempt"]) == (7, os.getpid(), 1)
    assert info["note"] == {"first": 12}
    assert live_claims(tmp_path).keys() == {3}
    assert live_claims(tmp_path)[3]["process"] == process_identity()


def test_expired_claim_is_taken_over_with_the_attempt_counted(tmp_path: Path) -> None:
    first = taken(tmp_path, note={"first": 0})
    make_foreign(first)
    assert claim_block(tmp_path, 3, 8) is None
    expire(first)
    assert live_claims(tmp_path) == {}
    second = taken(tmp_path)
    assert second.attempts == 2
    assert [(lost.attempt, lost.handed_back) for lost in second.lost] == [(1, False)]
    assert second.lost[0].info["note"] == {"first": 0}
    assert second.still_mine()
    assert not first.still_mine()


def test_late_awakened_owner_neither_refreshes_nor_releases_what_he_lost(tmp_path: Path) -> None:
    first = taken(tmp_path, expiry=1e-3)
    make_foreign(first)
    time.sleep(0.01)
    second = taken(tmp_path)
    assert not first.refresh()
    first.release()
    first.hand_back()
    assert second.still_mine()
    assert claim_block(tmp_path, 3, 9) is None
    second.release()
    first.hand_back()
    assert list((tmp_path / "claims").iterdir()) == []


def test_claim_made_again_after_a_release_is_not_the_old_owners(tmp_path: Path) -> None:
    first = taken(tmp_path)
    claim_file(tmp_path, 3).unlink()
    second = taken(tmp_path)
    assert (first.attempts, second.attempts) == (1, 1)
    assert second.still_mine()
    assert not first.still_mine()


def test_refresh_keeps_a_claim_alive_and_is_cheap(tmp_path: Path, monkeypatch: Any) -> None:
    claim = taken(tmp_path, expiry=60.0)
    make_foreign(claim)
    expire(claim)
    assert claim.refresh()
    assert claim_block(tmp_path, 3, 8) is not None, "refresh is due only after a fifth of expiry"
    claim = taken(tmp_path, block=5)
    make_foreign(claim)
    expire(claim)
    monkeypatch.setattr(time, "monotonic", lambda moment=time.monotonic: moment() + 13)
    assert claim.refresh()
    assert claim_block(tmp_path, 5, 8) is None


def test_handed_back_block_is_free_at_once_but_counted(tmp_path: Path) -> None:
    claim = taken(tmp_path)
    claim.hand_back()
    second = taken(tmp_path)
    assert second.attempts == 2
    assert [lost.handed_back for lost in second.lost] == [True]
    second.release()
    assert list((tmp_path / "claims").iterdir()) == []


def test_last_word_of_a_process_that_used_too_much_memory_is_heard(tmp_path: Path) -> None:
    first = taken(tmp_path)
    first.blame_memory()
    second = taken(tmp_path)
    assert [(lost.handed_back, lost.out_of_memory) for lost in second.lost] == [(False, True)]
    second.release()
    second.blame_memory()
    assert list((tmp_path / "claims").iterdir()) == []


def test_claims_on_single_points_are_forgotten_with_their_block(tmp_path: Path) -> None:
    for name in (3, "3_0", "3_11", "31_0", "13_1"):
        assert claim_block(tmp_path, name, 1) is not None
    assert set(live_claims(tmp_path)) == {3}
    forget_points(tmp_path, 3)
    names = sorted(path.name for path in (tmp_path / "claims").iterdir())
    assert names == ["13_1.1.json", "3.1.json", "31_0.1.json"]


def test_claim_of_a_killed_process_is_free_at_once(tmp_path: Path) -> None:
    process = subprocess.Popen([sys.executable, "-c", CLAIM_AND_WAIT, str(tmp_path)], stdout=-1)
    assert process.stdout is not None
    with process, process.stdout:
        assert process.stdout.readline() == b"claimed\n"
        assert claim_block(tmp_path, 3, 8) is None
        process.send_signal(signal.SIGKILL)
        deadline = time.monotonic() + 10
        # Not reaped yet: a zombie is gone, too.
        while (claim := claim_block(tmp_path, 3, 8)) is None and time.monotonic() < deadline:
            time.sleep(0.01)
        assert process.returncode is None
    assert claim is not None
    assert claim.attempts == 2


CLAIM_AND_WAIT = """
import sys, time, pathlib
from chimera_hpc.store.claims import claim_block
assert claim_block(pathlib.Path(sys.argv[1]), 3, 7)
print("claimed", flush=True)
time.sleep(60)
"""


def test_attempts_count_every_worker_that_the_block_killed(tmp_path: Path) -> None:
    for attempt in range(1, 4):
        claim = taken(tmp_path)
        assert claim.attempts == attempt
        assert len(claim.lost) == attempt - 1
        info = json.loads(claim.path.read_bytes())
        dead = info["process"].replace(str(os.getpid()), "4194303")
        claim.path.write_text(json.dumps({**info, "process": dead}))


@pytest.mark.parametrize("state", ["free", "expired"])
def test_of_many_runners_one_gets_the_block(tmp_path: Path, state: str) -> None:
    context = process_context()
    n_runners, n_blocks = 4, 25
    if state == "expired":
        for block in range(n_blocks):
            claim = taken(tmp_path, block=block)
            make_foreign(claim)
            expire(claim)
    gate, answers = context.Barrier(n_runners), context.Queue()
    arguments = (tmp_path, n_blocks, gate, answers)
    runners = [context.Process(target=claim_and_tell, args=arguments) for _ in range(n_runners)]
    for runner in runners:
        runner.start()
    won = [block for _ in runners for block in answers.get(timeout=60)]
    for runner in runners:
        runner.join()
    assert sorted(won) == list(range(n_blocks))


def test_unreadable_claim_is_free_only_when_old(tmp_path: Path) -> None:
    path = claim_file(tmp_path, 3)
    path.parent.mkdir()
    path.write_bytes(b"")
    assert claim_block(tmp_path, 3, 8) is None
    os.utime(path, (1, 1))
    assert taken(tmp_path).attempts == 2


def test_a_wrong_clock_does_not_expire_others_claims(tmp_path: Path, monkeypatch: Any) -> None:
    claim = taken(tmp_path)
    make_foreign(claim)
    monkeypatch.setattr(time, "time", lambda: 1e12)
    assert claim_block(tmp_path, 3, 8) is None


@pytest.mark.parametrize("now", [0.0, 1e12])
def test_a_wrong_clock_does_not_change_which_claims_are_live(
    tmp_path: Path, monkeypatch: Any, now: float
) -> None:
    live, expired = taken(tmp_path, 3), taken(tmp_path, 4)
    make_foreign(live)
    make_foreign(expired)
    expire(expired)
    monkeypatch.setattr(time, "time", lambda: now)
    assert live_claims(tmp_path).keys() == {3}
    assert remove_stale(tmp_path, [3, 4]) == 1
    assert os.listdir(tmp_path / "claims") == ["3.1.json"]


def test_stale_claims_of_unfinished_blocks_stay(tmp_path: Path) -> None:
    for block in (3, 4):
        expire(taken(tmp_path, block))
    assert remove_stale(tmp_path, [4]) == 1
    assert os.listdir(tmp_path / "claims") == ["3.1.json"]


@pytest.mark.parametrize("end", ["release", "remove_stale"])
def test_the_highest_attempt_is_removed_last(tmp_path: Path, monkeypatch: Any, end: str) -> None:
    for attempt in range(1, 12):
        claim = taken(tmp_path)
        assert claim.attempts == attempt
        if attempt < 11:
            claim.hand_back()
    unlink, removed = Path.unlink, []

    def note(path: Path, missing_ok: bool = False) -> None:
        if path.name.startswith("3."):
            removed.append(path.name)
        unlink(path, missing_ok)

    monkeypatch.setattr(Path, "unlink", note)
    if end == "release":
        claim.release()
    else:
        claim.hand_back()
        remove_stale(tmp_path, [3])
    assert removed == [f"3.{attempt}.json" for attempt in range(1, 12)]


def test_stale_listing_gives_no_second_owner(tmp_path: Path, monkeypatch: Any) -> None:
    taken(tmp_path).path.rename(claim_file(tmp_path, 3, 3))
    listings = [[], os.listdir(tmp_path / "claims")]
    monkeypatch.setattr(claims, "_names", lambda _: listings.pop(0))
    assert claim_block(tmp_path, 3, 9) is None
    assert sorted(p.name for p in (tmp_path / "claims").iterdir()) == ["3.3.json"]


def test_lost_answer_of_the_file_server_is_recognised(tmp_path: Path, monkeypatch: Any) -> None:
    def link(source: Path, target: Path, link: Any = os.link) -> None:
        link(source, target)
        raise FileExistsError(str(target))

    monkeypatch.setattr(os, "link", link)
    assert files.create_exclusively(tmp_path / "a", b"1")
    assert not files.create_exclusively(tmp_path / "a", b"2")
    assert (tmp_path / "a").read_bytes() == b"1"


def test_without_hard_links_files_are_opened_exclusively(tmp_path: Path, monkeypatch: Any) -> None:
    def link(source: Path, target: Path) -> None:
        raise PermissionError(1, "Operation not permitted")

    monkeypatch.setattr(os, "link", link)
    assert files.create_exclusively(tmp_path / "a", b"1")
    assert not files.create_exclusively(tmp_path / "a", b"2")
    assert (tmp_path / "a").read_bytes() == b"1"
    assert [p.name for p in tmp_path.iterdir()] == ["a"]


def test_only_processes_of_this_machine_are_declared_gone() -> None:
    machine, pid, start = process_identity().split("-")
    assert not is_gone(f"{machine}-{pid}-{start}")
    assert is_gone(f"{machine}-{pid}-{int(start) + 1}"), "the number was given to another process"
    assert is_gone(f"{machine}-4194303-{start}")
    assert not is_gone(f"00000000-4194303-{start}")
    for odd in ("", "x", f"{machine}-", f"{machine}-a-b", f"{machine}-{pid}"):
        assert not is_gone(odd)


def test_a_forked_process_has_a_mark_of_its_own() -> None:
    ours = process_identity()
    reader, writer = os.pipe()
    child = os.fork()
    if not child:
        os.write(writer, process_identity().encode())
        os._exit(0)
    os.waitpid(child, 0)
    machine = ours.partition("-")[0]
    mark = os.read(reader, 100).decode()
    os.close(reader)
    os.close(writer)
    assert mark.startswith(f"{machine}-{child}-")
    assert mark != ours
    assert is_gone(mark)


def test_without_proc_only_the_number_counts(tmp_path: Path, monkeypatch: Any) -> None:
    monkeypatch.setattr(processes, "_PROC", tmp_path)
    for known in (processes._machine, processes._mark):
        known.cache_clear()
    mark = process_identity()
    assert mark.endswith(f"-{os.getpid()}-0")
    assert not is_gone(mark)
    assert is_gone(mark.replace(f"-{os.getpid()}-", "-4194303-"))
    for known in (processes._machine, processes._mark):
        known.cache_clear()
