"""`changes.yaml`: what is written is read back, what is foreign is put aside, and no power cut leaves half of it."""

from __future__ import annotations

import errno
import os
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from lfs10d.config.changes import OPTIONS, Changes, DeviceChange, Place, Rate, Verified
from lfs10d.config.changes_file import ASIDE, FILE_NAME, ChangesFile, FoundChanges, in_words, understood, written
from lfs10d.config.models import SlaveConfig
from lfs10d.errors import ConfigError, StateError
from lfs10d.system.disk import Disk, Files
from tests.support.volatile_disk import ForgetfulFiles, PowerCutError

STATE = Path("/state")
FILE = STATE / FILE_NAME
DRAFT = STATE / f".{FILE_NAME}.new"

ONE = Changes({"roof": DeviceChange(added={"id": 9, "interval": 0.25}, added_at=Place(9))})
OTHER = Changes({"mast": DeviceChange(options={"enabled": False})}, Rate(9600, 19200))


def test_it_is_made_to_be_read_by_people() -> None:
    changes = Changes(
        {
            "roof": DeviceChange(added={"id": 9, "interval": 0.25, "response_timeout": None}, added_at=Place(9)),
            "mast": DeviceChange(
                options={"label": "Mast, 10 m", "interval": 0.0},
                instead_of={"interval": 90.0},
                verified=Verified(Place(7, 19200), 2),
            ),
            "old": DeviceChange(removed={"id": 4}, verified=Verified(Place(5))),
        },
        Rate(9600, 19200),
    )
    text = written(changes).decode()
    assert "\n".join(line for line in text.splitlines() if not line.startswith("#")) == (
        """\
version: 1
line:
  baudrate:
    file: 9600
    now: 19200
devices:
  roof:
    added:
      id: 9
      interval: 250ms
      response_timeout: auto
    added_at:
      id: 9
  mast:
    options:
      label: Mast, 10 m
      interval: 0
    instead_of:
      interval: 90s
    verified:
      id: 7
      baudrate: 19200
      file: 2
  old:
    removed:
      id: 4
    verified:
      id: 5"""
    )
    assert understood(text.encode(), "x") == changes


PLACES = st.builds(Place, st.integers(1, 255), st.none() | st.sampled_from([9600, 19200, 115200]))
VALUES = {
    "interval": st.just(0.0) | st.floats(0.02, 86400),
    "enabled": st.booleans(),
    "label": st.none() | st.text(st.characters(exclude_categories=["Cc", "Cs", "Zl", "Zp"]), min_size=1, max_size=9),
    "response_timeout": st.none() | st.floats(0.01, 10),
}
SAYINGS = st.fixed_dictionaries({}, optional=VALUES)
WHOLES = st.builds(lambda number, saying: {"id": number, **saying}, st.integers(1, 255), SAYINGS)
DEVICES = st.builds(
    DeviceChange,
    removed=st.none() | WHOLES,
    added=st.none() | WHOLES,
    added_at=st.none() | PLACES,
    options=SAYINGS,
    instead_of=SAYINGS,
    verified=st.none() | st.builds(Verified, PLACES, st.none() | st.integers(1, 255)),
)
CHANGES = st.builds(
    Changes,
    st.dictionaries(st.from_regex(r"[a-z0-9_-]{1,32}", fullmatch=True), DEVICES, max_size=4),
    st.none() | st.builds(Rate, st.just(9600), st.just(19200)),
)


@given(CHANGES)
def test_what_is_written_is_read_back(changes: Changes) -> None:
    assert understood(written(changes), "x") == changes


@pytest.mark.parametrize(
    ("content", "place"),
    [
        (b"", "1:1"),
        (b"\xff", "1:1"),
        (b"a: [", "1:5"),
        (b"- 1", "1:1"),
        (b"{}", "1:1: version"),
        (b"version: 1\nversion: 1", "2:1: version"),
        (b"version: one", "1:10: version"),
        (b"version: 2\nelsewhere: {}", "1:10: version: is 2: a newer lfs10d wrote this file"),
        (b"version: 1\nelsewhere: {}", "2:1: elsewhere"),
        (b"version: 1\nline: {baudrate: {file: 9600, now: 4}}", "2:36: line.baudrate.now"),
        (b"version: 1\ndevices: {A: {}}", "2:11: devices.A"),
        (b"version: 1\ndevices: {a: {options: {id: 1}}}", "2:24: devices.a.options"),
        (b"version: 1\ndevices: {a: {options: [1]}}", "2:24: devices.a.options"),
        (b"version: 1\ndevices: {a: {options: {interval: -1}}}", "2:35: devices.a.options.interval"),
        (b"version: 1\ndevices: {a: {added: {label: x}}}", "2:22: devices.a.added"),
        (b"version: 1\ndevices: {a: {added: {id: 1, name: x}}}", "2:22: devices.a.added"),
        (b"version: 1\ndevices: {a: {verified: {id: 0}}}", "2:30: devices.a.verified.id"),
    ],
)
def test_what_is_not_ours_is_told_with_its_place(content: bytes, place: str) -> None:
    with pytest.raises(ConfigError) as caught:
        understood(content, "x")
    assert str(caught.value.problems[0]).startswith(f"x:{place}")


@given(st.binary(max_size=60) | st.text(max_size=60).map(lambda text: f"version: 1\n{text}".encode("utf-8", "replace")))
def test_no_content_whatever_breaks_the_reader(content: bytes) -> None:
    files = ForgetfulFiles()
    Disk(files).replace(FILE, content)
    found = ChangesFile(STATE, Disk(files)).take()
    assert (found.trouble is None) is files.exists(FILE)
    assert files.exists(STATE / ASIDE) is not files.exists(FILE)


def kept(files: ForgetfulFiles) -> FoundChanges:
    return ChangesFile(STATE, Disk(files)).read()


def test_where_there_is_no_file_nothing_was_changed() -> None:
    assert kept(ForgetfulFiles()) == FoundChanges(Changes(), missing=True)


def test_what_was_kept_is_found() -> None:
    files = ForgetfulFiles()
    ChangesFile(STATE, Disk(files)).save(ONE)
    assert kept(files) == ChangesFile(STATE, Disk(files)).take() == FoundChanges(ONE)


def test_that_nothing_is_changed_any_more_is_not_as_if_there_never_was_a_file() -> None:
    files = ForgetfulFiles()
    ChangesFile(STATE, Disk(files)).save(Changes())
    assert kept(files) == FoundChanges(Changes(), missing=False)


@pytest.mark.parametrize("before", [None, ONE])
@pytest.mark.parametrize("surviving", [(), (FILE,), (DRAFT,), (FILE, DRAFT)])
@pytest.mark.parametrize("cut", range(6))
def test_after_a_power_cut_at_any_step_the_old_or_the_new_is_there_and_what_was_answered_is_the_new(
    before: Changes | None, surviving: tuple[Path, ...], cut: int
) -> None:
    files = ForgetfulFiles()
    if before is not None:
        ChangesFile(STATE, Disk(files)).save(before)
    files.steps_left = files.steps + cut
    answered = True
    try:
        ChangesFile(STATE, Disk(files)).save(OTHER)
    except PowerCutError:
        answered = False
    files.power_cut(surviving)
    found = kept(files)
    assert found.trouble is None
    assert found.changes in (OTHER, before or Changes())
    if answered:
        assert found.changes == OTHER
    assert answered is (cut >= 4)  # write, sync, rename, sync of the folder


@pytest.mark.parametrize("before", [None, ONE])
def test_on_a_full_disk_nothing_is_changed(before: Changes | None) -> None:
    files = ForgetfulFiles()
    if before is not None:
        ChangesFile(STATE, Disk(files)).save(before)
    files.full = 10
    with pytest.raises(StateError, match=r"/state/changes\.yaml cannot be written: no space left on device"):
        ChangesFile(STATE, Disk(files)).save(OTHER)
    assert kept(files).changes == (before or Changes())
    files.power_cut(())
    assert kept(files).changes == (before or Changes())


class FailingFolder(ForgetfulFiles):
    """A disk on which, from some time on, the names of a folder cannot be synced."""

    failing = False

    def sync_folder(self, folder: Path) -> None:
        if self.failing:
            raise OSError(errno.EIO, os.strerror(errno.EIO))
        super().sync_folder(folder)


@pytest.mark.parametrize("before", [None, ONE])
def test_what_could_not_be_synced_is_taken_back_for_it_was_refused(before: Changes | None) -> None:
    files = FailingFolder()
    if before is not None:
        ChangesFile(STATE, Disk(files)).save(before)
    files.failing = True
    with pytest.raises(StateError):
        ChangesFile(STATE, Disk(files)).save(OTHER)
    assert kept(files).changes == (before or Changes())


def test_more_than_can_be_read_again_is_not_written() -> None:
    label = "\N{SNOWMAN}" * 200
    many = {f"d{number}": DeviceChange(added={"id": 1, "label": label}) for number in range(500)}
    with pytest.raises(StateError, match="would be too large"):
        ChangesFile(STATE, Disk(ForgetfulFiles())).save(Changes(many))


def test_what_cannot_be_understood_is_put_aside_and_a_new_file_begun() -> None:
    files = ForgetfulFiles()
    Disk(files).replace(FILE, b"nonsense")
    file = ChangesFile(STATE, Disk(files))
    assert (file.read().trouble is not None, files.exists(FILE)) == (True, True)
    found = file.take()
    assert found.changes == Changes()
    assert found.trouble is not None
    assert found.trouble.endswith("the file is now /state/changes.yaml.unreadable, and its changes do not hold")
    file.save(ONE)
    files.power_cut(())
    assert files.read(STATE / ASIDE) == b"nonsense"
    assert kept(files) == FoundChanges(ONE)


class StuckFiles(ForgetfulFiles):
    """A disk on which nothing can be renamed."""

    def rename(self, source: Path, target: Path) -> None:
        raise OSError(errno.EROFS, os.strerror(errno.EROFS), str(source), None, str(target))


def test_what_cannot_be_put_aside_is_not_overwritten() -> None:
    files = StuckFiles()
    files.write(FILE, b"nonsense", mode=0o600)
    file = ChangesFile(STATE, Disk(files))
    assert file.take().trouble is not None
    with pytest.raises(StateError, match="must be a mapping"):
        file.save(ONE)
    assert files.read(FILE) == b"nonsense"


def test_what_cannot_be_read_is_reported_and_not_overwritten(tmp_path: Path) -> None:
    (tmp_path / FILE_NAME).mkdir()
    file = ChangesFile(tmp_path, Disk())
    with pytest.raises(StateError, match="cannot be read: is a directory"):
        file.read()
    found = file.take()
    assert found.trouble is not None
    assert found.trouble.endswith("is a directory; the changes made by request are not known")
    with pytest.raises(StateError, match="cannot be read"):
        file.save(ONE)


def test_whoever_may_read_the_folder_may_read_it(tmp_path: Path) -> None:
    before = os.umask(0o022)
    try:
        ChangesFile(tmp_path, Disk(Files())).save(ONE)
    finally:
        os.umask(before)
    assert (tmp_path / FILE_NAME).stat().st_mode & 0o777 == 0o640


def test_values_are_told_as_one_writes_them() -> None:
    values = {"interval": 0.25, "enabled": True, "label": None, "response_timeout": None}
    assert tuple(values) == OPTIONS
    assert in_words(values) == {"interval": "250ms", "enabled": True, "label": None, "response_timeout": "auto"}


def test_a_removed_device_keeps_its_calibration() -> None:
    entry = SlaveConfig.model_validate({"id": 4, "calibration": {"wind_speed": {"scale": 1.013, "offset": 0.06}}})
    changes = Changes({"old": DeviceChange(removed={"id": 4, "calibration": entry.calibration})})
    assert b"scale: 1.013" in written(changes)
    assert understood(written(changes), "changes.yaml") == changes
