"""Why a port cannot be used: the words for each cause, and the facts they need."""

from __future__ import annotations

import errno
import grp
import os
import pwd
import termios
from pathlib import Path

import pytest

from lfs10d.errors import PortBusyError, PortGoneError, PortLostError
from lfs10d.modbus.port_errors import PortErrorFacts, hung_up, look, number_of, refusal

FACTS = PortErrorFacts(user="wind", group="dialout")


@pytest.mark.parametrize(
    ("code", "words"),
    [
        (errno.ENOENT, "there is no such device: is the adapter plugged in and the path right?"),
        (errno.ENOTDIR, "there is no such device: is the adapter plugged in"),
        (errno.ELOOP, "its symbolic links lead in a circle: name the device itself"),
        (errno.EACCES, "add the user wind to the group dialout (sudo usermod -aG dialout wind), then log in"),
        (errno.EPERM, "in a service allow the device (DeviceAllow=)"),
        (errno.ENODEV, "no hardware answers behind it (No such device): is the adapter plugged in"),
        (errno.ENXIO, "no hardware answers behind it (No such device or address)"),
        (errno.EIO, "no hardware answers behind it (Input/output error)"),
        (errno.EISDIR, "is a directory, no serial port"),
        (errno.ENOTTY, "is no serial port"),
        (errno.EINVAL, "is no path of a device"),
        (errno.ENAMETOOLONG, "is no path of a device"),
        (errno.EMFILE, "cannot be used (Too many open files): see its driver's messages in `dmesg`"),
    ],
)
def test_each_cause_has_its_words_and_what_to_do(code: int, words: str) -> None:
    error = refusal("/dev/ttyUSB0", code, FACTS)

    assert isinstance(error, PortLostError)
    assert str(error).startswith("/dev/ttyUSB0: ")
    assert words in error.message


@pytest.mark.parametrize(
    ("code", "gone"),
    [(errno.ENOENT, True), (errno.ENODEV, True), (errno.EIO, True), (errno.EACCES, False), (errno.ENOTTY, False)],
)
def test_a_device_that_is_not_there_is_gone(code: int, *, gone: bool) -> None:
    assert isinstance(refusal("/dev/ttyUSB0", code, FACTS), PortGoneError) is gone
    assert isinstance(hung_up("/dev/ttyUSB0", code), PortGoneError)


def test_a_dangling_link_says_where_it_leads() -> None:
    error = refusal("/dev/serial/by-id/a", errno.ENOENT, PortErrorFacts(target="/dev/ttyUSB1"))

    assert "the link leads to /dev/ttyUSB1, which is not there" in error.message


def test_a_device_that_no_group_may_use_needs_a_udev_rule() -> None:
    error = refusal("/dev/ttyS0", errno.EACCES, PortErrorFacts(user="wind"))

    assert "denied to the user wind, and no group may use it" in error.message
    assert 'GROUP="dialout", MODE="0660"' in error.message


@pytest.mark.parametrize("code", [errno.EBUSY, errno.EWOULDBLOCK])
def test_a_port_in_use_names_who_uses_it(code: int) -> None:
    error = refusal("/dev/ttyUSB0", code, PortErrorFacts(holder="mbpoll (process 4711)"))

    assert isinstance(error, PortBusyError)
    assert error.message == "in use by mbpoll (process 4711): end that, or free the port there"


def test_a_port_in_use_by_nobody_knows_whom_is_told_so() -> None:
    assert "in use by another program" in refusal("/dev/ttyUSB0", errno.EBUSY, PortErrorFacts()).message


def test_a_hang_up_says_why_and_what_to_do() -> None:
    assert hung_up("tty", errno.EIO).message == (
        "hung up (Input/output error): the adapter was unplugged or reset; plug it in again"
    )
    assert hung_up("tty", 0).message == "hung up: the adapter was unplugged or reset; plug it in again"


def test_a_termios_error_has_a_number_too() -> None:
    assert number_of(OSError(errno.ENXIO, "gone")) == errno.ENXIO
    assert number_of(termios.error(errno.ENOTTY, "no tty")) == errno.ENOTTY
    assert number_of(OSError("without a number")) == errno.EIO


def test_the_group_is_the_one_that_may_use_the_device(tmp_path: Path) -> None:
    device = tmp_path / "ttyUSB0"
    device.touch(mode=0o660)
    device.chmod(0o660)

    facts = look(str(device))

    assert facts.group == grp.getgrgid(device.stat().st_gid).gr_name
    assert facts.user == pwd.getpwuid(os.geteuid()).pw_name
    assert facts.target == ""


def test_a_group_that_may_not_use_the_device_is_not_named(tmp_path: Path) -> None:
    device = tmp_path / "ttyUSB0"
    device.touch()
    device.chmod(0o640)

    assert look(str(device)).group == ""


def test_users_and_groups_without_a_name_go_by_number(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def unknown(_number: int) -> None:
        raise KeyError

    monkeypatch.setattr(grp, "getgrgid", unknown)
    monkeypatch.setattr(pwd, "getpwuid", unknown)
    device = tmp_path / "ttyUSB0"
    device.touch()
    device.chmod(0o660)

    facts = look(str(device))

    assert (facts.user, facts.group) == (str(os.geteuid()), str(device.stat().st_gid))


def test_a_link_is_followed_to_its_end_and_made_safe(tmp_path: Path) -> None:
    link = tmp_path / "by-id"
    link.symlink_to("ttyUSB\n0")

    assert look(str(link)).target == f"{tmp_path.resolve()}/ttyUSB\\n0"


@pytest.mark.parametrize("path", ["zero\0byte", "/dev/no-such-port"])
def test_of_a_path_that_is_not_there_nothing_is_known(path: str) -> None:
    facts = look(path)

    assert (facts.target, facts.group) == ("", "")
