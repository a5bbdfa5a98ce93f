"""The generated pages are what the code says now, and their examples are what the daemon promises."""

from __future__ import annotations

import json
import re
import subprocess
import sys
from pathlib import Path

import pytest

from docs.generate import commands
from docs.generate.commands import WALK, recorded
from docs.generate.configuration import parts
from docs.generate.contract import OUTBOUND, check
from docs.generate.examples import HEARD, SENT
from docs.generate.markdown import WIDTH, example, plain
from docs.generate.mqtt import _meanings, examples
from docs.generate.pages import DASHBOARD, PAGES, filled, stale
from lfs10d.command import Command, Result
from lfs10d.commands.handlers.registry import HANDLERS
from lfs10d.commands.message import parameters_of
from lfs10d.config.diff import RESTART_KEYS
from lfs10d.config.models import Config
from lfs10d.modbus.frames import Codec, Framing
from lfs10d.modbus.request import ReadRegisters
from lfs10d.schema.fields import FieldKind

ROOT = Path(__file__).parents[2]
CONFIGURATION = (ROOT / "docs" / "configuration.md").read_text(encoding="utf-8")
MQTT = (ROOT / "docs" / "mqtt.md").read_text(encoding="utf-8")


def section(page: str, heading: str) -> str:
    """Return what stands under a heading of the third level."""
    found = re.search(rf"^### `{re.escape(heading)}`$(.*?)(?=^##|\Z)", page, re.MULTILINE | re.DOTALL)
    assert found, f"no section for {heading}"
    return found[1]


def test_no_page_is_stale() -> None:
    assert stale() == [], "run `make docs` and look at what changed"


def test_a_page_that_differs_or_is_missing_is_stale(tmp_path: Path) -> None:
    (tmp_path / "mqtt.md").write_text(PAGES["mqtt.md"]() + "\n", encoding="utf-8")
    assert stale(tmp_path) == [
        "architecture.md",
        "commands.md",
        "configuration.md",
        "mqtt.md",
        "profiles.md",
        "simulate.md",
        DASHBOARD,
    ]


def test_the_generator_writes_what_is_stale_and_only_names_it_with_check() -> None:
    def ran(*arguments: str) -> subprocess.CompletedProcess[str]:
        command = [sys.executable, "-m", "docs.generate", *arguments]
        return subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=False, timeout=60)

    fresh, wrong = ran("--check"), ran("--chekc")
    assert (fresh.returncode, fresh.stdout, fresh.stderr) == (0, "", "")
    assert (wrong.returncode, wrong.stdout) == (2, "")
    assert "usage:" in wrong.stderr


def test_a_slot_nobody_fills_and_a_part_nobody_wants_are_refused() -> None:
    assert filled("{{a}}\n", {"a": "x"}).endswith("\n\nx\n")
    with pytest.raises(KeyError):
        filled("{{a}}", {})
    with pytest.raises(ValueError, match="no slot for b"):
        filled("{{a}}", {"a": "x", "b": "y"})


def test_a_code_without_words_and_words_without_a_code_are_refused() -> None:
    with pytest.raises(ValueError, match="crc, late"):
        list(_meanings({"timeout": "x", "crc": "y"}, ("timeout", "late")))


@pytest.mark.parametrize("key", sorted(RESTART_KEYS))
def test_a_key_that_needs_a_restart_says_so(key: str) -> None:
    assert "next restart" in section(CONFIGURATION, key)


def test_no_other_key_needs_a_restart() -> None:
    assert CONFIGURATION.count("- **Takes effect at the next restart.**") == len(RESTART_KEYS)


@pytest.mark.parametrize(
    ("key", "words"),
    [
        ("line.port", "**Required.**"),
        ("line.turnaround_delay", "Default: `100ms`"),
        ("poll.response_timeout", "Default: `auto`"),
        ("slaves[].name", r"Default: slave-\<id as in the file>."),
        ("slaves[].enabled", "Default: `true`"),
        ("mqtt.tls", "`null`, or a mapping of the keys below"),
        ("mqtt.version", "Value: 5 or 3.1.1."),
        ("commands", "any of polling, sensors, registers; `[]` for none"),
        ("store.max_size", "Default: `512MB`"),
        ("line.rs485.rts_on_send", "Value: true or false."),
    ],
)
def test_a_key_has_its_default_and_its_values_as_they_are_written(key: str, words: str) -> None:
    assert words in section(CONFIGURATION, key)


def test_every_key_of_the_full_example_has_its_entry() -> None:
    full = (ROOT / "config" / "lfs10d.full.yaml").read_text(encoding="utf-8")
    keys = set(re.findall(r"^(?:  |  - |    )?([a-z0-9_]+):", full, re.MULTILINE))
    told = {key.rpartition(".")[2] for key in re.findall(r"^### `(.*)`$", CONFIGURATION, re.MULTILINE)}
    assert keys - set(Config.model_fields) <= told


def test_the_page_has_a_part_for_every_section_of_the_file() -> None:
    assert set(parts()) == set(Config.model_fields) | {"profiles"}


@pytest.mark.parametrize("topic", [row.topic for row in OUTBOUND])
def test_every_example_is_what_the_daemon_promises(topic: str) -> None:
    shown = examples()[topic]
    assert shown or topic == "response/+", "no example"
    for payload in shown:
        text = payload if isinstance(payload, str) else json.dumps(payload)
        assert check(topic.replace("+", "mast-top"), text) is not None
        assert example(payload) in MQTT


def test_the_frames_of_the_examples_are_frames() -> None:
    codec = Codec(Framing.RTU)
    asked = ReadRegisters(2, 1, 2)
    assert codec.encode(asked) == SENT
    assert [body for _, _, body in codec.frames(HEARD, 2, codec.answer_size(asked))] == [HEARD[:-2]]


@pytest.mark.parametrize("name", sorted(HANDLERS))
def test_every_request_has_its_class_and_parameters(name: str) -> None:
    told = section(MQTT, name)
    form = HANDLERS[name].spec
    assert f"Class `{form.klass}`." in told
    for key, field in form.parameters.model_fields.items():
        assert f"| `{field.alias or key}` |" in told
        kind = next((each for each in field.metadata if isinstance(each, FieldKind)), None)
        assert kind is None or plain(kind.words) in told


def test_every_request_of_the_page_of_examples_is_one_and_its_answer_is_as_promised() -> None:
    for step, response in zip(WALK, recorded(), strict=True):
        assert not isinstance(
            parameters_of(HANDLERS[step.name].spec.parameters, Command(parameters=step.parameters)), Result
        )
        assert check(f"response/{step.name}", json.dumps(response)) is not None


def test_a_request_that_is_not_walked_and_a_code_without_advice_are_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(commands, "HANDLERS", {**HANDLERS, "line/dance": HANDLERS["health"]})
    with pytest.raises(ValueError, match="line/dance"):
        commands.parts()
    monkeypatch.undo()
    monkeypatch.setattr(commands, "ADVICE", {})
    with pytest.raises(ValueError, match="timeout"):
        commands.parts()


@pytest.mark.parametrize(
    "payload",
    [[], {}, 1, None, "word", [{"a": [1, 2], "b": "x" * 80}], {"k": list(range(60))}, {"a": "<b>", "c": {"d": [[]]}}],
)
def test_an_example_is_the_payload_with_line_breaks(payload: object) -> None:
    text = example(payload).partition("\n")[2].removesuffix("\n```")
    assert text == payload or json.loads(text) == payload


def test_an_example_of_short_values_fits_a_narrow_screen() -> None:
    text = example({f"key_{number}": {"deep": list(range(number))} for number in range(30)})
    assert max(map(len, text.splitlines())) <= WIDTH


def test_words_of_the_code_are_not_taken_for_markup() -> None:
    assert plain("slave-<id>, `<id>`, 2*3") == r"slave-\<id>, `<id>`, 2\*3"
