"""config/fleet/upgrade installs a version, or leaves the gateway as it was.

The programs it calls are stand-ins: `python3` makes a folder whose `pip` and `lfs10d` do what a test says,
`systemctl` notes what it is asked.
"""

from __future__ import annotations

import os
import subprocess
from dataclasses import dataclass
from pathlib import Path

import pytest

SCRIPT = Path(__file__).parents[2] / "config" / "fleet" / "upgrade"

PYTHON = """#!/bin/sh
mkdir -p "$3/bin"
printf '#!/bin/sh\\nexit %s\\n' "${PIP:-0}" > "$3/bin/pip"
printf '#!/bin/sh\\nexit %s\\n' "${CHECK:-0}" > "$3/bin/lfs10d"
chmod +x "$3/bin/pip" "$3/bin/lfs10d"
exit ${VENV:-0}
"""

SYSTEMCTL = """#!/bin/sh
echo "$1 $(readlink "$LFS10D_ROOT/lfs10d")" >> "$LFS10D_ROOT/asked"
case $1 in
  list-units) echo 'lfs10d.service loaded active running x'; echo 'lfs10d@roof.service loaded active running x' ;;
  restart)
    [ "$2 $3" = 'lfs10d.service lfs10d@roof.service' ] || exit 9
    case $(readlink "$LFS10D_ROOT/lfs10d") in *-2.0) exit ${RESTART:-0} ;; esac ;;
  is-active) exit ${ACTIVE:-0} ;;
  show) echo "${RESTARTS:-0}" ;;
esac
"""


@dataclass
class Gateway:
    """A folder in place of /opt, one in place of /etc/lfs10d, and the stand-ins on the search path."""

    folder: Path

    @property
    def root(self) -> Path:
        return self.folder / "opt"

    def upgrade(self, *arguments: str, **behaviour: int) -> subprocess.CompletedProcess[str]:
        """Run the script with its stand-ins exiting as told."""
        environment = {
            "PATH": f"{self.folder / 'bin'}{os.pathsep}{os.environ['PATH']}",
            "LFS10D_ROOT": str(self.root),
            "LFS10D_CONFIGURATIONS": str(self.folder / "etc"),
            "LFS10D_TRIAL": "0",
            **{name.upper(): str(value) for name, value in behaviour.items()},
        }
        return subprocess.run(
            [SCRIPT, *(arguments or ("2.0", "wheels"))],
            env=environment, capture_output=True, text=True, check=False, timeout=60,
        )  # fmt: skip

    @property
    def versions(self) -> set[str]:
        return {path.name for path in self.root.glob("lfs10d-*")}

    @property
    def runs(self) -> str:
        return (self.root / "lfs10d").readlink().name

    @property
    def asked(self) -> list[str]:
        """What systemctl was asked, and which version the link named then."""
        file = self.root / "asked"
        return file.read_text().splitlines() if file.exists() else []


@pytest.fixture(name="gateway")
def _gateway(tmp_path: Path) -> Gateway:
    """Give a gateway that runs version 1.0 and still has 0.9."""
    for name in ("bin", "etc", "opt/lfs10d-1.0", "opt/lfs10d-0.9"):
        (tmp_path / name).mkdir(parents=True)
    for name, text in (("python3", PYTHON), ("systemctl", SYSTEMCTL)):
        (tmp_path / "bin" / name).write_text(text)
        (tmp_path / "bin" / name).chmod(0o755)
    (tmp_path / "etc" / "lfs10d.yaml").write_text("line: {port: x}\n")
    (tmp_path / "opt" / "lfs10d").symlink_to("lfs10d-1.0")
    return Gateway(tmp_path)


def test_a_good_version_runs_and_the_one_before_is_kept(gateway: Gateway) -> None:
    done = gateway.upgrade()
    assert (done.returncode, done.stderr) == (0, "")
    assert gateway.runs == "lfs10d-2.0"
    assert gateway.versions == {"lfs10d-1.0", "lfs10d-2.0"}
    assert "restart lfs10d-2.0" in gateway.asked


def test_the_version_that_runs_is_not_installed_again(gateway: Gateway) -> None:
    assert gateway.upgrade("1.0", "wheels").returncode == 0
    assert gateway.asked == []
    assert gateway.versions == {"lfs10d-1.0", "lfs10d-0.9"}


@pytest.mark.parametrize("trouble", ["venv", "pip", "check"])
def test_what_fails_before_the_switch_touches_no_service(gateway: Gateway, trouble: str) -> None:
    done = gateway.upgrade(**{trouble: 1})
    assert done.returncode == 1
    assert "2.0 is not installed" in done.stderr
    assert gateway.asked == []
    assert (gateway.runs, gateway.versions) == ("lfs10d-1.0", {"lfs10d-1.0", "lfs10d-0.9"})


@pytest.mark.parametrize("trouble", [{"restart": 1}, {"active": 3}, {"restarts": 1}])
def test_what_fails_after_the_switch_brings_the_old_version_back(gateway: Gateway, trouble: dict[str, int]) -> None:
    done = gateway.upgrade(**trouble)
    assert done.returncode == 1
    assert "back to lfs10d-1.0" in done.stderr
    assert gateway.asked[-1] == "restart lfs10d-1.0"
    assert (gateway.runs, gateway.versions) == ("lfs10d-1.0", {"lfs10d-1.0", "lfs10d-0.9"})


def test_a_first_installation_that_fails_leaves_nothing(gateway: Gateway) -> None:
    (gateway.root / "lfs10d").unlink()
    assert gateway.upgrade(restart=1).returncode == 1
    assert not (gateway.root / "lfs10d").is_symlink()
    assert "lfs10d-2.0" not in gateway.versions


def test_a_folder_in_place_of_the_link_is_left_alone(gateway: Gateway) -> None:
    (gateway.root / "lfs10d").unlink()
    (gateway.root / "lfs10d").mkdir()
    done = gateway.upgrade()
    assert done.returncode == 1
    assert "remove it first" in done.stderr
    assert (gateway.root / "lfs10d").is_dir()


def test_without_its_arguments_it_says_how_it_is_called(gateway: Gateway) -> None:
    done = gateway.upgrade("2.0")
    assert done.returncode == 2
    assert done.stderr.startswith("usage:")
