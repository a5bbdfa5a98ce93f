"""Where profiles come from: the built-in files, a user's own, and what is said about a broken one."""

from __future__ import annotations

from pathlib import Path

import pytest

from lfs10d.errors import ConfigError
from lfs10d.profiles import library
from lfs10d.profiles.library import builtin_names, load_profile, parse_profile
from lfs10d.profiles.profile import Profile
from lfs10d.reading import Fault
from lfs10d.simulator.blueprint import blueprint_of

ROOT = Path(__file__).parents[2]
WIND_VANE = ROOT / "config" / "profiles" / "wind-vane.yaml"
PAGE = ROOT / "docs" / "profiles.md"

MINIMAL = """\
name: tank
title: Tank
values:
  - {name: level, register: 0x0001, type: uint16, unit: m}
"""

BROKEN = """\
name: Bad Name
title: ""
ids: [10, 1]
colour: red
framings: [rtu, rtu]
checksums: [md5]
min_interval: soon
factory: {id: 300, baudrate: 9601}
slave_id: {register: 5}
baudrate: {register: 5, codes: {9600: 1, 9601: 2, x: 3, true: 4}}
values:
  - {name: seq, register: 70000, type: int16, unit: x}
  - {name: a, register: 0xFFFF, type: int32, unit: x, word_order: low_first}
  - {name: a, register: 1, type: int32, unit: x}
  - {name: b, register: 1, type: int16, unit: 1, range: [3, 2], scale: 0, word_order: low_first, function: 6}
  - {name: b, type: int17}
  - 7
settings:
  - {name: q, register: 3, values: {off: 3, 70000: x, 1: y}}
  - {name: q, register: 3, values: {}, writable: on}
barrier: {register: 1, register: 2, count: 0, cuont: 1}
provenance: {hair: x}
"""

PROBLEMS = """\
1:7: name: must be a name of 1 to 32
2:8: title: must be text of 1 to 500 characters
3:6: ids: the first id is greater than the last
4:1: colour: is not a known key
5:11: framings: must name at least one, each once
6:13: checksums[0]: must be one of
7:15: min_interval: must be a duration
8:15: factory.id: must be a whole number from 1 to 255, not 300
8:30: factory.baudrate: must be one of
10:48: baudrate.codes.9601: is no baud rate; write one of 1200 2400 4800 9600
10:54: baudrate.codes.x: is no baud rate; write one of 1200 2400 4800 9600
10:57: baudrate.codes: a key must be
12:12: values[0].name: is a key of every sample already
12:27: values[0].register: must be a whole number from 0 to 65535, not 70000
13:39: values[1].type: int32 fills two registers
14:5: values[2].word_order: is missing; write high_first or low_first
15:47: values[3].unit: must be a unit ('1' for a bare number)
15:57: values[3].range: the first number of a range must be less
15:72: values[3].scale: must be a number from 1e-12
15:87: values[3].word_order: int16 fills one register
15:108: values[3].function: must be one of
16:5: values[4].register: is missing
16:5: values[4].unit: is missing; write here: the unit of the number
16:21: values[4].type: must be one of
17:5: values[5]: must be a mapping of keys to values, not 7
19:42: settings[0].values.off: is no register content
19:52: settings[0].values.70000: is no register content
20:36: settings[1].values: names no value
20:50: settings[1].writable: must be true or false, not text "on"
21:24: barrier.register: is given twice
21:44: barrier.count: must be a whole number from 1 to 125, not 0
21:47: barrier.cuont: is not a known key; did you mean count?
22:20: provenance.hair: is no key of a profile
"""


def reads(profile: Profile) -> list[tuple[int, int, int]]:
    return [(block.function, block.address, block.count) for block in profile.reads()]


def decoded(profile: Profile, *answers: str) -> dict[str, object]:
    """Return the values of one poll whose answers carry these register bytes, in hex."""
    numbers: dict[str, object] = {}
    for block, answer in zip(profile.reads(), answers, strict=True):
        content = bytes.fromhex(answer)
        registers = tuple(int.from_bytes(content[at : at + 2], "big") for at in range(0, len(content), 2))
        values = block.decode(registers)
        assert not isinstance(values, Fault)
        numbers |= values
    return numbers


def builtin(name: str) -> Profile:
    return load_profile(name, relative_to=Path("/nowhere"))


def test_every_data_file_of_the_package_is_a_built_in_profile_of_its_name() -> None:
    files = {file.stem for file in Path(library.__file__).parent.glob("*.yaml")}
    assert files == set(builtin_names())
    assert [builtin(name).name for name in builtin_names()] == list(builtin_names())


def test_the_default_profile_of_a_slave_is_the_first() -> None:
    assert builtin_names()[0] == "lfs10"


def test_a_built_in_profile_is_loaded_once() -> None:
    assert builtin("lfs10") is builtin("lfs10")


def test_lfs10_is_what_its_protocol_document_says() -> None:
    profile = builtin("lfs10")
    assert profile.ids == (1, 255)
    assert profile.framings == ("rtu",)
    assert profile.checksums == ("crc",)
    assert reads(profile) == [(3, 0x0001, 2)]
    assert profile.units == {"wind_speed": "m/s"}
    assert profile.values[0].range == (0.0, 100.0)
    assert decoded(profile, "41 4F D7 0A") == {"wind_speed": 12.99}
    assert profile.barrier is not None
    assert (profile.barrier.function, profile.barrier.register, profile.barrier.count) == (3, 0x0005, 1)
    assert profile.slave_id is not None
    assert (profile.slave_id.register, profile.slave_id.locked_by) == (0x0005, "DIP switch")
    assert profile.baudrate is not None
    assert (profile.baudrate.register, profile.baudrate.codes) == (0x0004, {9600: 1, 19200: 2})
    assert profile.factory is not None
    assert (profile.factory.id, profile.factory.baudrate) == (1, 9600)


def test_nothing_of_an_lfs10_is_ever_written_but_id_and_rate() -> None:
    profile = builtin("lfs10")
    assert profile.slave_id is not None
    assert profile.baudrate is not None
    assert {profile.slave_id.register, profile.baudrate.register} == {0x0004, 0x0005}
    assert profile.settings == ()
    assert profile.setting_at(0x0003) is None


def test_ld_e_reads_the_printed_displacement_low_word_first() -> None:
    profile = builtin("ld-e")
    assert profile.framings == ("rtu", "ascii")
    assert reads(profile) == [(3, 0x1004, 2)]
    assert profile.units == {"displacement": "1"}
    assert decoded(profile, "D0 F5 00 00") == {"displacement": 53493}
    setting = profile.setting_at(0x1000)
    assert setting is not None
    assert setting.refusal(1) is None
    assert setting.refusal(2) is not None


def test_fuling_dzb_reads_in_two_reads_within_its_limits() -> None:
    profile = builtin("fuling-dzb")
    assert profile.ids == (1, 247)
    assert profile.broadcast
    assert profile.framings == ("rtu", "ascii")
    assert (profile.max_words, profile.ascii_max_data) == (5, 16)
    assert reads(profile) == [(3, 0x3001, 4), (3, 0x5000, 2)]
    assert decoded(profile, "1388 007B 00E6 05DC", "0000 0008") == {
        "running_frequency": 50.0,
        "output_current": 12.3,
        "output_voltage": 230,
        "speed": 1500,
        "fault": 0,
        "communication_fault": 8,
    }


def test_eh600_has_two_checks_and_says_when_it_is_busy() -> None:
    profile = builtin("eh600")
    assert profile.ids == (1, 247)
    assert profile.framings == ("rtu",)
    assert profile.checksums == ("crc", "sum")
    assert profile.max_words == 5
    assert profile.busy_exceptions == (6,)
    assert reads(profile) == [(3, 0x1001, 1), (3, 0x8000, 1)]
    assert decoded(profile, "1388", "0000") == {"frequency_reference": 50.0, "fault": 0}


@pytest.mark.parametrize("name", ["fuling-dzb", "eh600"])
def test_nothing_of_an_inverter_may_be_written(name: str) -> None:
    profile = builtin(name)
    assert profile.settings
    assert all(setting.refusal(0) is not None for setting in profile.settings)
    assert (profile.slave_id, profile.baudrate) == (None, None)


@pytest.mark.parametrize("name", ["ld-e", "fuling-dzb", "eh600"])
def test_what_only_the_fuller_manuals_say_is_marked_unverified(name: str) -> None:
    assert all(value.unverified for value in builtin(name).values)


@pytest.mark.parametrize("name", builtin_names())
def test_every_fact_of_a_built_in_profile_has_its_source(name: str) -> None:
    profile = builtin(name)
    facts = [profile.slave_id, profile.baudrate, profile.factory, profile.barrier, *profile.values, *profile.settings]
    assert all(fact.source for fact in facts if fact is not None)
    assert {"ids", "framings", "max_words"} <= set(profile.provenance)


def test_a_file_of_the_user_is_found_relative_to_a_folder(tmp_path: Path) -> None:
    (tmp_path / "profiles").mkdir()
    (tmp_path / "profiles" / "tank.yaml").write_text(MINIMAL)
    assert load_profile("profiles/tank.yaml", relative_to=tmp_path) == parse_profile(MINIMAL, "tank.yaml")


def test_a_name_that_is_no_file_is_answered_with_the_built_in_names(tmp_path: Path) -> None:
    with pytest.raises(ConfigError) as caught:
        load_profile("lsf10", relative_to=tmp_path)
    (problem,) = caught.value.problems
    assert str(problem) == (
        f'{tmp_path}/lsf10:1:1: profile "lsf10": No such file or directory; '
        f"write {', '.join(builtin_names())}, or the path of a profile's YAML file"
    )


def test_a_path_that_cannot_be_one_is_a_problem_and_no_crash(tmp_path: Path) -> None:
    with pytest.raises(ConfigError, match="is no path"):
        load_profile("tank\0.yaml", relative_to=tmp_path)


def test_a_folder_is_no_profile(tmp_path: Path) -> None:
    with pytest.raises(ConfigError, match="Is a directory"):
        load_profile(".", relative_to=tmp_path)


@pytest.mark.parametrize(
    ("content", "place"),
    [
        (b"name: tank\ntitle: T\xe4nk\n", "2:9: byte 0xe4 is not UTF-8"),
        (b"", "1:1: the file is empty"),
        (b"- name\n", "1:1: must be a mapping of keys to values"),
        (b"name: [tank\n", "2:1: is not valid YAML"),
        (b"#" * 300_000, "1:1: the file is too large"),
    ],
)
def test_a_file_that_is_no_profile_at_all_is_told_with_its_place(tmp_path: Path, content: bytes, place: str) -> None:
    (tmp_path / "tank.yaml").write_bytes(content)
    with pytest.raises(ConfigError) as caught:
        load_profile("tank.yaml", relative_to=tmp_path)
    (problem,) = caught.value.problems
    assert str(problem).startswith(f"{tmp_path}/tank.yaml:{place}")


def test_every_problem_of_a_file_is_told_at_once_in_order_of_place() -> None:
    with pytest.raises(ConfigError) as caught:
        parse_profile(BROKEN, "bad.yaml")
    found = str(caught.value).splitlines()
    wanted = [f"bad.yaml:{line}" for line in PROBLEMS.splitlines()]
    assert [line[: len(want)] for line, want in zip(found, wanted, strict=True)] == wanted


def test_a_key_given_twice_is_a_problem_though_all_else_is_right() -> None:
    with pytest.raises(ConfigError) as caught:
        parse_profile(MINIMAL + "title: Tank again\n", "tank.yaml")
    (problem,) = caught.value.problems
    assert (problem.line, problem.column, problem.path) == (5, 1, "title")


def test_the_wind_vane_of_the_page_is_a_profile_that_a_simulated_vane_plays() -> None:
    profile = load_profile(str(WIND_VANE), relative_to=ROOT)
    direction, point = blueprint_of(profile).signals
    (block,) = profile.reads()
    registers = direction.words(217.3) + point.words(10)
    assert block.decode(registers) == {"wind_direction": 217.3, "compass_point": 10}


def test_the_page_shows_the_wind_vane_as_it_is() -> None:
    assert f"```yaml\n{WIND_VANE.read_text()}```\n" in PAGE.read_text()


def test_every_included_profile_names_its_model_and_its_maker_where_one_is_known() -> None:
    """Home Assistant shows both; the inverters' and lasers' documents name no maker, the PR-3000 has many."""
    profiles = [load_profile(name, relative_to=Path()) for name in builtin_names()]
    assert [profile.name for profile in profiles if profile.model is None] == []
    without = {profile.name for profile in profiles if profile.manufacturer is None}
    assert without == {"lfs10", "ld-e", "eh600", "pr-3000-fsjt"}
