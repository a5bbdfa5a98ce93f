"""The file and the changes as one configuration: what holds, where it comes from, and what cannot hold."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from lfs10d import profiles
from lfs10d.config.changes import Changes, DeviceChange, Place, Rate, Verified
from lfs10d.config.effective import effective, file_values_of, merged_data
from lfs10d.config.loader import LoadedConfig, load
from lfs10d.schema.yaml12 import render

TEXT = """\
line: {port: /dev/x}
poll: {interval: 2s}
slaves:
  - 2
  - {id: 3, name: mast, interval: 1s, label: Mast, checksum: null}
  - {id: 4, profile: fuling-dzb}
"""


@pytest.fixture(name="file")
def _file(tmp_path: Path) -> Callable[[str], LoadedConfig]:
    path = tmp_path / "lfs10d.yaml"
    own = (Path(profiles.__file__).parent / "ld-e.yaml").read_text().replace("name: ld-e", "name: own")
    (tmp_path / "own.yaml").write_text(own + "\nmin_interval: 1s\n")

    def file(text: str = TEXT) -> LoadedConfig:
        path.write_text(text)
        return load(path, environment={}, host="gateway")

    return file


def test_what_the_file_says_is_told_key_by_key(file: Callable[[str], LoadedConfig]) -> None:
    file_values = file_values_of(file(TEXT))
    assert file_values.slaves == {
        "slave-2": {"id": 2},
        "mast": {"id": 3, "interval": 1.0, "label": "Mast", "checksum": None},
        "slave-4": {"id": 4, "profile": "fuling-dzb"},
    }
    assert file_values.usual == {
        "interval": 2.0,
        "enabled": True,
        "label": None,
        "response_timeout": None,
        "profile": "lfs10",
        "checksum": None,
    }


def test_without_changes_the_file_holds(file: Callable[[str], LoadedConfig]) -> None:
    loaded = file(TEXT)
    now = effective(loaded, Changes())
    assert (now.config, now.loaded.origins, now.loaded.profiles) == (loaded.config, loaded.origins, loaded.profiles)
    assert (now.dropped, now.conflicts, now.suspended, now.changes) == ((), {}, {}, Changes())
    assert now.places == {"slave-2": (Place(2, 9600),), "mast": (Place(3, 9600),), "slave-4": (Place(4, 9600),)}
    assert now.polled == now.config


def test_every_value_has_its_origin_wherever_its_device_stands_now(file: Callable[[str], LoadedConfig]) -> None:
    loaded = file(TEXT)
    changes = (
        Changes(baudrate=Rate(9600, 19200))
        .removing("slave-2", file_values_of(loaded))
        .setting("mast", {"interval": 5.0, "enabled": False}, file_values_of(loaded))
        .adding("roof", {"id": 9, "label": "Roof"}, Place(9))
    )
    now = effective(loaded, changes)
    origins = {key: str(origin).rpartition("/")[2] for key, origin in now.loaded.origins.items()}
    assert [slave.name for slave in now.config.slaves] == ["mast", "slave-4", "roof"]
    assert now.config.slaves[0].interval == 5.0
    assert now.config.slaves[2].interval == 2.0
    assert now.config.line.baudrate == 19200
    assert {key: origins[key] for key in origins if key.startswith("slaves[0]")} == {
        "slaves[0].id": "lfs10d.yaml:5",
        "slaves[0].name": "lfs10d.yaml:5",
        "slaves[0].label": "lfs10d.yaml:5",
        "slaves[0].profile": "default",
        "slaves[0].interval": "changes.yaml",
        "slaves[0].enabled": "changes.yaml",
        "slaves[0].response_timeout": "default",
        "slaves[0].checksum": "lfs10d.yaml:5",
        "slaves[0].request_gap": "default",
        "slaves[0].calibration": "default",
    }
    assert origins["slaves[2].name"] == origins["slaves[2].id"] == origins["slaves[2].label"] == "changes.yaml"
    assert origins["slaves[2].interval"] == "lfs10d.yaml:2 (poll.interval)"
    assert origins["slaves[2].response_timeout"] == origins["slaves[2].enabled"] == "default"
    assert origins["line.baudrate"] == "changes.yaml"
    assert len(origins) == len(set(origins))


def test_a_list_that_becomes_empty_has_an_origin(file: Callable[[str], LoadedConfig]) -> None:
    loaded = file("line: {port: x}\nslaves: [2]")
    now = effective(loaded, Changes().removing("slave-2", file_values_of(loaded)))
    assert str(now.loaded.origins["slaves"]) == "default"
    assert now.config.slaves == ()


def test_a_device_is_found_by_its_name(file: Callable[[str], LoadedConfig]) -> None:
    now = effective(file(TEXT), Changes())
    assert now.slave("mast") == now.config.slaves[1]
    assert now.slave("nobody") is None


def test_the_profile_of_what_was_added_is_loaded(file: Callable[[str], LoadedConfig]) -> None:
    now = effective(file(TEXT), Changes().adding("roof", {"id": 9, "profile": "own.yaml"}))
    assert now.loaded.profiles[now.config.slaves[-1].profile].name == "own"


@pytest.mark.parametrize(
    ("entry", "why"),
    [
        ({"id": 9, "profile": "gone.yaml"}, "profile"),
        ({"id": 9, "profile": "own.yaml", "interval": 0.5}, "interval: must be at least"),
    ],
)
def test_what_was_added_and_cannot_be_polled_is_kept_but_does_not_hold(
    file: Callable[[str], LoadedConfig], entry: dict[str, Any], why: str
) -> None:
    changes = Changes().adding("roof", entry)
    now = effective(file(TEXT), changes)
    assert now.slave("roof") is None
    assert why in now.suspended["roof"]
    assert now.changes == changes
    assert merged_data(now) == now.file.document.data


def test_options_that_the_profile_does_not_allow_do_not_hold_but_where_it_is_does(
    file: Callable[[str], LoadedConfig],
) -> None:
    loaded = file(TEXT.replace("fuling-dzb", "own.yaml"))
    moved = Changes({"slave-4": DeviceChange(verified=Verified(Place(7), 4), options={"interval": 0.5})})
    now = effective(loaded, moved)
    slave = now.slave("slave-4")
    assert slave is not None
    assert (slave.id, slave.interval) == (7, 2.0)
    assert now.suspended["slave-4"].startswith("interval: must be at least")
    assert now.changes == moved


ROOF = Changes().adding("roof", {"id": 3}, Place(3))
UNPROVEN = Changes().adding("roof", {"id": 3})


@pytest.mark.parametrize(
    ("changes", "yielding"),
    [
        (ROOF, {"mast": "slave id 3 is taken by roof; change the id of one, or remove one"}),
        (UNPROVEN, {"roof": "slave id 3 is taken by mast; change the id of one, or remove one"}),
        (
            ROOF.with_device("mast", DeviceChange(verified=Verified(Place(3), 2))),
            {"mast": "slave id 3 is taken by roof; change the id of one, or remove one"},
        ),
    ],
)
def test_of_two_with_one_id_the_one_verified_there_is_polled_and_else_the_file_s(
    file: Callable[[str], LoadedConfig], changes: Changes, yielding: dict[str, str]
) -> None:
    now = effective(file(TEXT), changes)
    assert now.conflicts == yielding
    assert len(now.config.slaves) == 4
    assert [slave.name for slave in now.config.slaves if slave not in now.polled.slaves] == list(yielding)


def test_where_file_and_fact_differ_both_places_are_told_the_file_s_first(file: Callable[[str], LoadedConfig]) -> None:
    changes = Changes({"mast": DeviceChange(verified=Verified(Place(7), 2))})
    now = effective(file(TEXT), changes)
    assert now.places["mast"] == (Place(3, 9600), Place(7, 9600))
    assert now.places["slave-2"] == (Place(2, 9600),)


def test_a_default_name_is_written_out_when_the_id_is_another(file: Callable[[str], LoadedConfig]) -> None:
    loaded = file(TEXT)
    changes = Changes({"slave-2": DeviceChange(verified=Verified(Place(7), 2))}, Rate(9600, 19200))
    data = merged_data(effective(loaded, changes))
    assert data["slaves"][0] == {"id": 7, "name": "slave-2"}
    assert data["line"] == {"port": "/dev/x", "baudrate": 19200}
    assert data["slaves"][1:] == loaded.document.data["slaves"][1:]  # type: ignore[index]  # any YAML


IDS = st.sampled_from([5, 6, 7, 8])
OPTIONS = st.fixed_dictionaries(
    {},
    optional={
        "interval": st.sampled_from([0.0, 2.0, 2.5]),
        "enabled": st.booleans(),
        "label": st.none() | st.sampled_from(["x", "on", "1:30"]),
        "response_timeout": st.none() | st.just(0.1),
    },
)
DEEDS = st.lists(
    st.tuples(st.sampled_from(["slave-2", "mast", "slave-4", "roof", "slave-9"]), st.booleans(), IDS, OPTIONS),
    max_size=8,
)


@given(DEEDS)
def test_put_into_the_file_no_change_is_left_and_the_same_holds(
    tmp_path_factory: pytest.TempPathFactory, deeds: list[tuple[str, bool, int, dict[str, Any]]]
) -> None:
    path = tmp_path_factory.getbasetemp() / "law.yaml"
    path.write_text(TEXT)
    loaded = load(path, environment={}, host="gateway")
    now = effective(loaded, Changes())
    for name, removing, number, options in deeds:
        changes = now.changes
        if now.slave(name) is None:
            if number not in {slave.id for slave in now.config.slaves}:
                changes = changes.adding(name, {"id": number, **options}, Place(number))
        elif removing:
            changes = changes.removing(name, now.file_values)
        else:
            changes = changes.setting(name, options, now.file_values)
        now = effective(loaded, changes)
        assert (now.dropped, now.conflicts, now.suspended) == ((), {}, {})
    path.write_text(render(merged_data(now)))
    after = effective(load(path, environment={}, host="gateway"), now.changes)
    assert (after.changes, after.dropped) == (Changes(), ())
    assert after.config == now.config
