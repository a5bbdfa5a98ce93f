"""Any sample that the line can bring goes through the store as it was: partial ones, text, booleans, ages."""

from __future__ import annotations

import json
import sqlite3
from collections.abc import Iterator
from contextlib import closing
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from docs.generate import contract
from docs.generate.payloads import SamplePayload
from lfs10d.outbox.store.database import APPLICATION_ID, SCHEMA, WIDE_SCHEMA, number
from lfs10d.outbox.store.row import DamagedError
from lfs10d.outbox.store.sample_file import SampleFile, StoreBatch
from lfs10d.reading import Fault, FaultCode, Reading, Value
from lfs10d.system.clock import Instant
from lfs10d.telemetry.device_state import DeviceState
from lfs10d.telemetry.info import DeviceInfo
from lfs10d.telemetry.publication import TELEMETRY, Sample
from tests.support.rows import BOOT, ROOMY, START, entries, sample

NAMES = ("wind_speed", "direction", "weather", "heating", "humidity")
ERRORS = st.sampled_from([FaultCode.UNAVAILABLE, FaultCode.NOT_FINITE, FaultCode.OUT_OF_RANGE, FaultCode.EXCEPTION])
VALUES: st.SearchStrategy[Value] = st.one_of(
    st.floats(-1e6, 1e6),
    st.integers(),
    st.booleans(),
    st.text(max_size=9),
    st.sampled_from(["", "ok", "12", "true", "["]),
)
AGES = st.integers(0, 10**8).map(lambda ms: ms / 1000)


@st.composite
def readings(draw: st.DrawFn) -> Reading:
    """Return a poll that failed as a frame, has no value at all, or any mixture of values, ages and errors."""
    mixture: dict[str, Any] = {name: draw(st.one_of(VALUES, st.tuples(VALUES, AGES), ERRORS)) for name in NAMES}
    errors = {name: kind for name, kind in mixture.items() if isinstance(kind, FaultCode)}
    usual: dict[str, Any] = {"device": "mast", "at": draw(st.floats(1, 1000)), "online": True, "response_timeout": 0.2}
    if len(errors) == len(NAMES) or draw(st.integers(0, 9)) == 0:
        fault = Fault(next(iter(errors.values()), FaultCode.CRC), "nothing")
        return Reading(values=None, fault=fault, rtt=None, value_errors=errors, **usual)
    values = {
        name: None if name in errors else kind[0] if isinstance(kind, tuple) else kind for name, kind in mixture.items()
    }
    ages = {name: kind[1] for name, kind in mixture.items() if isinstance(kind, tuple)}
    return Reading(values=values, fault=None, rtt=0.0182, value_errors=errors, ages=ages, **usual)


@pytest.fixture
def path(tmp_path: Path) -> Path:
    """Give the path of a file that is not there yet."""
    return tmp_path / "backlog.db"


@pytest.fixture(scope="module")
def shared(tmp_path_factory: pytest.TempPathFactory) -> Iterator[SampleFile]:
    """Give one file for all examples of this module: each would be synchronised to the disk."""
    file = SampleFile(tmp_path_factory.mktemp("kinds") / "backlog.db", boot=BOOT, limits=ROOMY)
    yield file
    file.close()


@settings(max_examples=60)
@given(st.lists(readings(), min_size=1, max_size=8))
def test_what_telemetry_says_history_says_later(shared: SampleFile, polls: list[Reading]) -> None:
    units = dict.fromkeys(NAMES, "1")
    info = DeviceInfo("mast", 3, None, "station", 1.0, True, None, NAMES, units, offline_after=3)  # noqa: FBT003 - enabled
    now = Instant(1000.0, START / 1000, "synced")
    device = DeviceState(info, line="line0", boot=BOOT, seq=0, now=now)
    told: list[tuple[Sample, dict[str, Any]]] = []
    for poll in polls:
        published, _ = device.on_reading(poll, now, masked=False)
        for each in published:
            text = json.dumps(each.payload, allow_nan=False) if not isinstance(each.payload, str) else each.payload
            model = contract.check(each.topic, text)
            if each.sample is not None:
                assert each.topic.endswith(TELEMETRY)
                assert isinstance(model, SamplePayload)
                assert list(model.values) == list(NAMES)
                told.append((each.sample, json.loads(text)))
    first = shared.next
    shared.append(StoreBatch(entries(*(sample for sample, _ in told)), losses=(), now=START, mono=0))
    history = [row.sample.payload("line0", historical=True) for row in shared.read(first - 1, 99)]
    text = json.dumps(history, allow_nan=False)
    assert contract.check("device/mast/history", text)
    assert repr(json.loads(text)) == repr([payload | {"historical": True} for _, payload in told])


def schema_of(path: Path) -> int:
    with closing(sqlite3.connect(path)) as db:
        return number(db, "PRAGMA user_version")


def test_a_file_says_that_an_earlier_lfs10d_must_leave_it_alone_only_once_it_must(path: Path) -> None:
    file = SampleFile(path, boot=BOOT, limits=ROOMY)
    file.append(StoreBatch(entries(sample(1), sample(2, error="crc")), losses=(), now=START, mono=0))
    file.close()
    assert schema_of(path) == SCHEMA
    file = SampleFile(path, boot=BOOT, limits=ROOMY)
    file.append(StoreBatch(entries(sample(3, values={"weather": "rain"})), losses=(), now=START, mono=0))
    file.append(StoreBatch(entries(sample(4, values={"weather": "snow"})), losses=(), now=START, mono=0))
    file.close()
    assert schema_of(path) == WIDE_SCHEMA
    file = SampleFile(path, boot=BOOT, limits=ROOMY)
    assert [row.sample.values for row in file.read(2, 9)] == [{"weather": "rain"}, {"weather": "snow"}]
    file.close()


def test_what_fails_to_be_kept_does_not_change_the_schema(path: Path) -> None:
    file = SampleFile(path, boot=BOOT, limits=ROOMY)

    def fail(_: object) -> None:
        raise sqlite3.OperationalError("disk full")

    with pytest.raises(sqlite3.OperationalError):
        file.append(StoreBatch(entries(sample(1, values={"on": True})), losses=(), now=START, mono=0), fail)
    file.close()
    assert schema_of(path) == SCHEMA


def test_a_partial_sample_takes_no_more_than_a_good_one(tmp_path: Path) -> None:
    sizes = []
    for quality in ("good", "partial"):
        path = tmp_path / quality
        file = SampleFile(path, boot=BOOT, limits=ROOMY)
        for start in range(0, 10_000, 1000):
            values: dict[str, Value | None] = {"wind_speed": 12.99, "humidity": 40.5 if quality == "good" else None}
            errors = {} if quality == "good" else {"humidity": FaultCode.UNAVAILABLE}
            measured = [
                Sample("a", BOOT, seq, START + seq, "synced", values, {}, tuple(values), quality, None, 18.2, errors)
                for seq in range(start + 1, start + 1001)
            ]
            file.append(StoreBatch(entries(*measured), losses=(), now=START, mono=0))
        file.close()
        sizes.append(path.stat().st_size)
    assert sizes[1] <= sizes[0]


# A file as version 0.1 wrote it (`sqlite3 backlog.db .dump`).
EARLIER = """
CREATE TABLE era (id INTEGER PRIMARY KEY, boot TEXT NOT NULL, clock TEXT NOT NULL, base INTEGER NOT NULL,
                  shift INTEGER NOT NULL, checked INTEGER NOT NULL);
INSERT INTO era VALUES(1,'k0000002','synced',1795298023000,1795298022000,2385);
CREATE TABLE further (sample INTEGER NOT NULL, place INTEGER NOT NULL, value, PRIMARY KEY (sample, place))
    WITHOUT ROWID;
INSERT INTO further VALUES(2,1,270);
INSERT INTO further VALUES(2,2,'1180591620717411303424');
INSERT INTO further VALUES(4,1,5);
INSERT INTO further VALUES(4,2,X'CDCCCC3D');
CREATE TABLE life (boot TEXT NOT NULL);
INSERT INTO life VALUES('k0000002');
CREATE TABLE loss (device TEXT NOT NULL, boot TEXT NOT NULL, from_seq INTEGER NOT NULL, to_seq INTEGER NOT NULL,
                   count INTEGER NOT NULL);
CREATE TABLE sample (id INTEGER PRIMARY KEY, series INTEGER NOT NULL, seq INTEGER NOT NULL, at INTEGER NOT NULL,
                     rtt, value, checked INTEGER NOT NULL);
INSERT INTO sample VALUES(1,1,1,0,182,X'0000003E',-9853);
INSERT INTO sample VALUES(2,2,1,0,182,X'0AD74F41',25026);
INSERT INTO sample VALUES(3,3,2,1000,NULL,NULL,15432);
INSERT INTO sample VALUES(4,2,2,1000,182,X'00000080',-322);
CREATE TABLE series (id INTEGER PRIMARY KEY, era INTEGER NOT NULL, facts TEXT NOT NULL);
INSERT INTO series VALUES(1,1,'["k0000002","a","good",null,["wind_speed"],[["wind_speed","m/s"]],false]');
INSERT INTO series VALUES(2,1,'["k0000002","b","good",null,["wind_speed","direction","total"],'
    || '[["wind_speed","m/s"],["direction","m/s"],["total","m/s"]],false]');
INSERT INTO series VALUES(3,1,'["k0000002","a","bad","timeout",["wind_speed"],[["wind_speed","m/s"]],false]');
"""


def test_a_file_of_an_earlier_version_is_read_and_gone_on_with(path: Path) -> None:
    with closing(sqlite3.connect(path)) as db:
        db.executescript(f"PRAGMA application_id = {APPLICATION_ID}; PRAGMA user_version = 1; {EARLIER}")
    file = SampleFile(path, boot="k0000003", limits=ROOMY)
    told = [
        sample(1),
        sample(1, "b", values={"wind_speed": 12.99, "direction": 270, "total": 2**70}),
        sample(2, error="timeout"),
        sample(2, "b", values={"wind_speed": -0.0, "direction": 5, "total": 0.1}),
    ]
    assert [row.sample for row in file.read(0, 9)] == told
    more = sample(3, "b", boot="k0000003", values={"wind_speed": 1.5, "direction": "N", "total": 7})
    file.append(StoreBatch(entries(more), losses=(), now=START, mono=0))
    assert [row.sample for row in file.read(0, 9)] == [*told, more]
    file.close()


@pytest.mark.parametrize("cell", ["X'06'", "'perhaps'", "'[1]'"])
def test_a_value_that_none_of_ours_ever_said_is_damage(path: Path, cell: str) -> None:
    file = SampleFile(path, boot=BOOT, limits=ROOMY)
    file.append(StoreBatch(entries(sample(1)), losses=(), now=START, mono=0))
    file.close()
    with closing(sqlite3.connect(path)) as db:
        db.execute(f"UPDATE sample SET value = {cell}")  # noqa: S608 - the test's own
        db.commit()
    file = SampleFile(path, boot=BOOT, limits=ROOMY)
    with pytest.raises(DamagedError):
        file.read(0, 9)
    file.close()
