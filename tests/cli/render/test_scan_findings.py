"""What a scan found, in words and as YAML to paste."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

from lfs10d.cli.calibrated import Calibrations
from lfs10d.cli.options import LineOptions
from lfs10d.cli.render.scan_findings import ScanRequest, lasting_name, plain, remarks, row, snippet, usual_rate, what
from lfs10d.config.loader import load
from lfs10d.config.models import SlaveConfig
from lfs10d.line.jobs.identification import FoundDevice
from lfs10d.modbus.frames import Framing
from lfs10d.profiles.library import load_profile

LFS10, LD_E, STATION = (load_profile(name, relative_to=Path()) for name in ("lfs10", "ld-e", "ecowitt-wn90lp"))
VANE, CUPS, PR_3000 = (
    load_profile(name, relative_to=Path()) for name in ("renke-rs-fxjt", "renke-rs-fsjt", "pr-3000-fsjt")
)
RTU = LineOptions("/dev/ttyUSB0", "none", 8, 1, Framing.RTU, None)


def sensor(slave: int, baudrate: int = 9600, *, suspect: bool = False, duplicate: bool = False) -> FoundDevice:
    return FoundDevice(
        slave,
        baudrate,
        answers=True,
        rtt=0.0234,
        profile=LFS10,
        values={"wind_speed": 5.5},
        id_register=slave,
        suspect=suspect,
        duplicate=duplicate,
    )


STRANGER = FoundDevice(9, 9600, answers=True, rtt=0.02, exception=2)


def test_a_row_says_id_rate_time_device_and_value() -> None:
    assert row(sensor(3)) == ("3", "9600", "23 ms", "LFS10 wind speed sensor, 5.5 m/s", "")


def test_a_bare_count_has_no_unit() -> None:
    assert what(FoundDevice(3, 9600, answers=True, profile=LD_E, values={"displacement": 7})).endswith("sensor, 7")


@pytest.mark.parametrize(
    ("finding", "text"),
    [
        (STRANGER, "unknown device, answers function 03 (exception 02 illegal register address)"),
        (
            FoundDevice(9, 9600, answers=True, exception=99),
            "unknown device, answers function 03 (exception 63 of its own)",
        ),
        (
            FoundDevice(9, 9600, answers=True, exception=1),
            "unknown device, refuses function 03 (exception 01 illegal function)",
        ),
        (FoundDevice(9, 9600, answers=True), "unknown device, answers function 03"),
        (FoundDevice(9, 9600, duplicate=True), "something that gives no valid reply"),
        (FoundDevice(9, 9600, answers=True, profile=LFS10), "LFS10 wind speed sensor, no plausible value"),
        (sensor(9, duplicate=True), "LFS10 wind speed sensor"),
    ],
)
def test_what_it_is_is_told_as_far_as_it_is_known(finding: FoundDevice, text: str) -> None:
    assert what(finding) == text


@pytest.mark.parametrize(
    ("finding", "texts"),
    [
        (sensor(3), []),
        (sensor(1), ["the factory id"]),
        (FoundDevice(1, 9600, answers=True), []),
        (FoundDevice(3, 9600, spoilt=2, tries=5), ["2 of 5 replies garbled"]),
        (
            FoundDevice(3, 9600, spoilt=4, tries=5, duplicate=True),
            ["DUPLICATE? 4 of 5 replies garbled: two sensors with this id?"],
        ),
        (sensor(250, suspect=True), ["SUSPECT: others answer too, so it may be no sensor of its own"]),
        (FoundDevice(255, 9600, suspect=True, id_register=2), ["SUSPECT: probably sensor 2, which answers 255 too"]),
        (FoundDevice(3, 9600, id_register=7), ["its id register holds 7"]),
        (FoundDevice(3, 9600, profile=LFS10, id_register=7), ["its id register holds 7: is the DIP switch set?"]),
        (FoundDevice(3, 9600, profile=CUPS, id_register=7), ["its id register holds 7"]),
        (FoundDevice(144, 9600, profile=STATION), ["the factory id"]),
        (FoundDevice(1, 9600, profile=STATION), []),
        (
            FoundDevice(3, 9600, profile=VANE, alternatives=(CUPS, PR_3000)),
            [
                (
                    "or Renke RS-FSJT-N01 wind speed sensor or PR-3000-FSJT / SN-3000-FSJT wind speed sensor: its "
                    "answers do not tell which"
                )
            ],
        ),
    ],
)
def test_remarks_tell_what_a_newcomer_should_know(finding: FoundDevice, texts: list[str]) -> None:
    assert list(remarks(finding)) == texts


def test_nothing_is_timed_that_never_answered() -> None:
    assert row(FoundDevice(9, 9600, duplicate=True))[2] == "-"
    assert plain(FoundDevice(9, 9600, duplicate=True))["rtt_ms"] is None


def test_the_refusal_of_a_known_device_is_no_news() -> None:
    known = FoundDevice(3, 9600, answers=True, profile=LD_E, exception=2)
    assert plain(known)["exception_code"] is None
    assert plain(STRANGER)["exception_code"] == 2


def test_the_snippet_is_a_valid_file_that_polls_what_can_be_polled(tmp_path: Path) -> None:
    ascii_line = LineOptions("/dev/ttyUSB0", "even", 7, 2, Framing.ASCII, 0.5)
    device = FoundDevice(4, 19200, answers=True, profile=LD_E)
    file = tmp_path / "lfs10d.yaml"
    file.write_text("\n".join(snippet([device, FoundDevice(5, 19200, answers=True)], ascii_line, tmp_path)))
    config = load(file).config
    assert (config.line.baudrate, config.line.parity, config.line.databits) == (19200, "even", 7)
    assert (config.line.stopbits, config.line.framing) == (2, "ascii")
    assert [(slave.id, slave.profile, slave.response_timeout) for slave in config.slaves] == [(4, "ld-e", 0.5)]


def test_a_profile_of_ones_own_is_named_by_its_file_and_another_check_by_its_key() -> None:
    eh600 = load_profile("eh600", relative_to=Path())
    found = [FoundDevice(4, 9600, answers=True, profile=eh600), FoundDevice(5, 9600, answers=True, profile=LD_E)]
    lines = list(snippet(found, RTU, Path("/nowhere"), ScanRequest("sum", {"ld-e": "my, laser.yaml"})))
    assert "  - {id: 4, profile: eh600, checksum: sum}" in lines
    assert '  - {id: 5, profile: "my, laser.yaml", checksum: sum}' in lines


def test_what_cannot_be_polled_as_it_is_stands_in_comments() -> None:
    found = [
        sensor(2),
        sensor(3, duplicate=True),
        STRANGER,
        sensor(255, suspect=True),
        sensor(4, 19200),
    ]
    lines = list(snippet(found, RTU, Path("/nowhere")))
    assert [line.split("    ")[0] for line in lines if "- " in line] == [
        "  - 2",
        "  # - 3",
        "  # - 9",
        "  # - 255",
        "  # - 4",
    ]


def test_without_anybody_to_poll_the_list_is_empty() -> None:
    assert "slaves: []" in list(snippet([STRANGER], RTU, Path("/nowhere")))


def test_the_rate_is_the_one_of_most_and_the_slower_of_equals() -> None:
    assert usual_rate([sensor(1), sensor(2, 19200), sensor(3, 19200)]) == 19200
    assert usual_rate([sensor(2, 19200), sensor(1)]) == 9600
    assert usual_rate([FoundDevice(9, 19200, duplicate=True)]) == 9600


def test_an_adapter_is_called_by_the_name_that_lasts(tmp_path: Path) -> None:
    port = tmp_path / "ttyUSB0"
    port.touch()
    links = tmp_path / "by-id"
    assert lasting_name(str(port), links) == str(port)
    links.mkdir()
    assert lasting_name(str(port), links) == str(port)
    (links / "usb-FTDI-port0").symlink_to(port)
    assert lasting_name(str(port), links) == str(links / "usb-FTDI-port0")


def test_a_relative_port_is_called_by_its_absolute_name(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "line0").symlink_to("/dev/null")
    assert lasting_name("line0", tmp_path / "none") == str(tmp_path / "line0")
    assert lasting_name("../x/ttyUSB0", tmp_path / "none") == str(tmp_path.parent / "x/ttyUSB0")


def test_a_calibrated_device_is_shown_raw_and_calibrated() -> None:
    assert what(sensor(3), {"wind_speed": 5.63}) == "LFS10 wind speed sensor, 5.5 m/s, calibrated 5.63 m/s"
    assert what(sensor(3), {"wind_speed": None}) == "LFS10 wind speed sensor, 5.5 m/s, calibrated out of range"
    found = plain(sensor(3), {"wind_speed": 5.63})
    assert (found["values"], found["calibrated"]) == ({"wind_speed": 5.5}, {"wind_speed": 5.63})


def test_what_answers_cannot_tell_apart_is_named_beside_the_entry_and_in_json() -> None:
    own = VANE.model_copy(update={"name": "own"})
    finding = FoundDevice(3, 9600, answers=True, profile=VANE, alternatives=(CUPS, own), values={"sector": 3})
    entry = next(
        text for text in snippet([finding], RTU, asked=ScanRequest(files={"own": "my vane.yaml"})) if "id: 3" in text
    )
    assert (
        entry == '  - {id: 3, profile: renke-rs-fxjt}    # or profile renke-rs-fsjt, "my vane.yaml": look at the device'
    )
    assert plain(finding)["alternatives"] == ["renke-rs-fsjt", "own"]


def configured(**more: Any) -> Calibrations:  # noqa: ANN401 - keys of a slave
    """Return what a configuration knows of slave 3 at 9600 baud."""
    return Calibrations({}, 9600, slaves={3: SlaveConfig.model_validate({"id": 3, "name": "mast-top", **more})})


CERTIFICATE = {"wind_speed": {"scale": 1.013, "offset": -0.06}}


def test_what_is_configured_of_a_slave_is_kept_in_what_is_written(tmp_path: Path) -> None:
    more = {"label": "Mast: 10 m", "interval": "250ms", "request_gap": "50ms", "calibration": CERTIFICATE}
    known = configured(**more, response_timeout="300ms")
    file = tmp_path / "site.yaml"
    file.write_text("\n".join(snippet([sensor(3), sensor(4)], RTU, tmp_path, known=known)))
    first, second = load(file).config.slaves
    assert (first.name, first.label, first.interval, first.request_gap) == ("mast-top", "Mast: 10 m", 0.25, 0.05)
    assert (first.response_timeout, first.certificates) == (0.3, {"wind_speed": (1.013, -0.06)})
    assert (second.name, second.calibration) == ("slave-4", {})


@pytest.mark.parametrize(
    ("finding", "entry"),
    [
        (sensor(3, 19200), "  - 3"),
        (FoundDevice(3, 9600, answers=True, profile=LD_E), "  - {id: 3, name: mast-top, profile: ld-e, interval: 0}"),
        (sensor(5), "  - 5"),
    ],
)
def test_what_is_configured_elsewhere_or_of_another_kind_is_not_kept(finding: FoundDevice, entry: str) -> None:
    assert entry in list(snippet([finding], RTU, known=configured(interval=0, calibration=CERTIFICATE)))


def test_a_slave_of_which_nothing_is_configured_is_written_as_its_id() -> None:
    known = Calibrations({}, 9600, slaves={3: SlaveConfig.model_validate({"id": 3, "name": "slave-3"})})
    assert "  - 3" in list(snippet([sensor(3)], RTU, known=known))
