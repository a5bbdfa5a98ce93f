"""What the bench leaves on the disk is what a daemon would have left."""

from __future__ import annotations

from pathlib import Path

from bench import backlog
from lfs10d.outbox.store.database import Limits
from lfs10d.outbox.store.sample_file import SampleFile


def test_so_many_samples_wait_and_each_run_has_its_own_copy(tmp_path: Path) -> None:
    for name in ("one", "other"):
        backlog.leave(tmp_path / name, 500)
        file = SampleFile(tmp_path / name / "backlog.db", boot="k0000001", limits=Limits(size=10**9, age=10**6))
        assert file.rows == 500
        assert file.losses == ()
        file.close()
