"""The parts of docs/mqtt.md: every topic with its payload and a real example, every request, every code."""

from __future__ import annotations

import inspect
import json
from collections.abc import Iterator, Mapping
from typing import Any, get_args, get_origin

from pydantic import BaseModel, TypeAdapter
from pydantic.fields import FieldInfo

from docs.generate import events
from docs.generate.configuration import kind_of, kinds_within, written
from docs.generate.contract import OUTBOUND, Outbound
from docs.generate.examples import EVENT_TS, Story, responses, trace
from docs.generate.markdown import example, plain, table
from docs.generate.meanings import ERROR_CODES, FAULT_CODES
from docs.generate.payloads import Availability
from docs.generate.uplink import bytes_table
from docs.generate.wind import wind_examples
from lfs10d.cli.request_words import KEEPING, PRESENT
from lfs10d.command import ErrorCode
from lfs10d.commands.context import Handler
from lfs10d.commands.handlers.registry import HANDLERS
from lfs10d.reading import FaultCode
from lfs10d.telemetry.publication import EVENT

SHOWN_BEFORE = {"device/+/telemetry": "device/+/state", "device/+/history": "device/+/state"}
SHOWN_BEFORE |= {"device/+/error": "line/error", "response/+": "response/+/+"}
"""Topics whose payload has the same keys as another's."""

SHOWN_LATER = {EVENT, "response/+/+", "response/+"}
"""Topics whose examples have a chapter of their own."""

CLASSES = ("always", "polling", "sensors", "registers")
"""Classes of requests, as they are listed."""


def parts() -> Mapping[str, str]:
    """Return the generated parts by name."""
    return {
        "topics": table(("topic under `B`", "retained", "QoS", "when"), map(_topic, OUTBOUND)),
        "payloads": "\n\n".join(_payloads()),
        "events": "\n\n".join(events.sections(EVENT_TS)),
        "requests": "\n\n".join(_requests()),
        "fault_codes": table(("code", "it means"), _meanings(FAULT_CODES, tuple(FaultCode))),
        "error_codes": table(("code", "it means"), _meanings(ERROR_CODES, get_args(ErrorCode))),
        "responses": "\n\n".join(map(example, responses())),
        "bytes_a_day": bytes_table(),
    }


def shown(topic: str) -> str:
    """Return a topic of the table with names in place of its wildcards."""
    return topic.replace("response/+/+", "response/<noun>/<verb>").replace("response/+", "response/<verb>").replace(
        "+", "<name>"
    )  # fmt: skip


def _topic(row: Outbound) -> tuple[str, ...]:
    return f"`{shown(row.topic)}`", "yes" if row.retain else "no", str(row.qos), row.when


def _meanings(words: Mapping[str, str], codes: tuple[str, ...]) -> Iterator[tuple[str, ...]]:
    """Yield the codes in their order; ValueError where one has no words or words have no code."""
    if set(words) != set(codes):
        raise ValueError(f"words and codes differ in {', '.join(sorted(set(words) ^ set(codes)))}")
    yield from ((f"`{code}`", words[code]) for code in map(str, codes))


# -- payloads


def examples() -> Mapping[str, tuple[object, ...]]:
    """Return payloads by the topic of the table."""
    story, wind = Story(), wind_examples()
    return {
        "info": (story.newest("info"),),
        "devices": (story.newest("devices"),),
        "line/state": (story.newest("line/state"),),
        "line/error": (story.newest("line/error"),),
        "line/stats": (story.newest("line/stats"),),
        "device/+/state": (story.newest("device/mast-top/state"), story.newest("device/slave-3/state")),
        "device/+/telemetry": (story.newest("device/mast-top/telemetry"),),
        "device/+/history": (story.history(),),
        "device/+/config": (story.newest("device/mast-top/config"),),
        "device/+/availability": (story.newest("device/mast-top/availability"),),
        "device/+/error": (story.newest("device/slave-3/error"), story.cleared()),
        "device/+/stats": (story.newest("device/slave-3/stats"),),
        "device/+/wind": (wind.wind,),
        "device/+/record": (wind.record,),
        "event": tuple(events.payloads(EVENT_TS)),
        "response/+/+": tuple(responses()),
        "response/+": (),
        "trace": (trace(),),
    }


def _payloads() -> Iterator[str]:
    samples = examples()
    for row in OUTBOUND:
        yield f"### `{shown(row.topic)}`"
        yield f"{'Retained' if row.retain else 'Not retained'}, QoS {row.qos}. Sent: {row.when}."
        if row.form is Availability:
            yield f"One bare word: {' or '.join(f'`{word}`' for word in get_args(Availability))}."
        elif row.topic == EVENT:
            yield "An object with `v`, `type`, `ts` and the keys of its type: [Events](#events)."
        elif row.topic in SHOWN_BEFORE:
            yield f"The keys are those of `{shown(SHOWN_BEFORE[row.topic])}`."
        else:
            yield from _keys_of(row)
        yield from map(example, () if row.topic in SHOWN_LATER else samples[row.topic])


def _keys_of(row: Outbound) -> Iterator[str]:
    """Yield a table of keys for each model that a payload can be."""
    for model in _models(row.form):
        words = (inspect.getdoc(model) or "").partition("\n")[0]
        yield f"An array. Each: {words}" if get_origin(row.form) is list else words
        schema = TypeAdapter(model).json_schema()
        yield table(("key", "type", "meaning"), _rows(schema, schema.get("$defs", {}), ""))


def _models(form: Any) -> Iterator[type[BaseModel]]:  # noqa: ANN401  # any annotation
    """Yield the models within a form, in order."""
    if get_origin(form) is None and isinstance(form, type) and issubclass(form, BaseModel):
        yield form
    for inner in get_args(form):
        yield from _models(inner)


Schema = dict[str, Any]


def _rows(schema: Schema, defs: Schema, prefix: str) -> Iterator[tuple[str, ...]]:
    """Yield the keys of an object, those of objects within it as `gap_us.min`."""
    for key, inner in schema["properties"].items():
        optional = "" if key in schema.get("required", ()) else " (not always there)"
        yield f"`{prefix}{key}`", type_words(inner, defs), f"{_description(inner)}{optional}".strip()
        nested = _object(inner, defs)
        if nested is not None:
            yield from _rows(nested, defs, f"{prefix}{key}.")


def _description(schema: Schema) -> str:
    """Return what the model says of a key, or of what it is when it is not null."""
    said: Iterator[str] = (each["description"] for each in (schema, *schema.get("anyOf", ())) if "description" in each)
    return next(said, "")


def _object(schema: Schema, defs: Schema) -> Schema | None:
    """Return the schema of the object that a key holds, perhaps beside null; None where it has no keys of its own."""
    for each in (schema, *schema.get("anyOf", ())):
        found: Schema = defs.get(each.get("$ref", "").rpartition("/")[2], {})
        if "properties" in found:
            return found
    return None


def type_words(schema: Schema, defs: Schema) -> str:
    """Return what a value is, in words for a person who reads JSON."""
    match schema:
        case {"anyOf": [*choices]}:
            words = " or ".join(type_words(each, defs) for each in choices)
        case {"const": value}:
            words = f"`{_json_word(value)}`"
        case {"enum": [*values]}:
            words = " or ".join(f"`{_json_word(value)}`" for value in values)
        case {"$ref": str(ref)}:
            words = "error code" if ref.endswith(f"/{FaultCode.__name__}") else "object"
        case {"type": "array", "items": items}:
            words = f"array of {type_words(items, defs)}s"
        case {"type": "object", "propertyNames": {"$ref": _}}:
            words = "object: error code to number"
        case _:
            words = _JSON_TYPES[schema.get("type", "")]
    return words


_JSON_TYPES = {
    "": "anything",
    "integer": "whole number",
    "number": "number",
    "boolean": "true or false",
    "string": "text",
    "object": "object",
    "null": "null",
}


def _json_word(value: object) -> str:
    return value if isinstance(value, str) else json.dumps(value)


# -- requests


def _requests() -> Iterator[str]:
    for name, request in sorted(HANDLERS.items(), key=lambda item: (CLASSES.index(item[1].spec.klass), item[0])):
        yield f"### `{name}`"
        yield f"Class `{request.spec.klass}`. {_does(request)}"
        fields = request.spec.parameters.model_fields
        if fields:
            rows = (
                (f"`{field.alias or key}`", _parameter(field, keeping=name in KEEPING), field.description or "")
                for key, field in fields.items()
            )
            yield table(("parameter", "value", "meaning"), rows)
        else:
            yield "No parameters."


def _does(request: Handler) -> str:
    """Return the first sentence of what performs it; ValueError where it says nothing."""
    words = inspect.getdoc(request.work)
    if not words:
        raise ValueError(f"{request.work} has no docstring")
    return " ".join(words.partition("\n\n")[0].split())


def _parameter(field: FieldInfo, *, keeping: bool) -> str:
    kind = kind_of(field)
    beside_null = next(kinds_within(field.annotation), None)  # `Annotated[int, Whole(1, 255)] | None`
    if kind is not None:
        words = kind.words
    elif beside_null is not None:
        words = f"{beside_null.words}, or null"
    else:
        words = type_words(TypeAdapter[object](field.annotation or object).json_schema(), {})
    if field.is_required():
        return f"{plain(words)}; required"
    return f"{plain(words)}; default: {PRESENT}" if keeping else f"{plain(words)}; default `{written(field)}`"
