"""The parts of docs/profiles.md: the keys of a profile."""

from __future__ import annotations

from collections.abc import Mapping

from pydantic import BaseModel
from pydantic.fields import FieldInfo

from docs.generate.markdown import plain, table
from lfs10d.profiles.device_facts import Barrier, Factory, Identity, IdRegister, RateRegister
from lfs10d.profiles.facts import Fact
from lfs10d.profiles.profile import Profile
from lfs10d.profiles.settings import Setting
from lfs10d.profiles.values import Value

MODELS: Mapping[str, type[BaseModel]] = {
    "A profile": Profile,
    "`values`: a list of": Value,
    "`settings`: a list of": Setting,
    "`barrier`": Barrier,
    "`slave_id`": IdRegister,
    "`baudrate`": RateRegister,
    "`factory`": Factory,
    "`identify`: a list of": Identity,
    "What each of these may have besides": Fact,
}


def parts() -> Mapping[str, str]:
    """Return the generated parts by name."""
    return {"keys": "\n\n".join(f"### {title}\n\n{_keys(model)}" for title, model in MODELS.items())}


def _keys(model: type[BaseModel]) -> str:
    common = () if model is Fact else Fact.model_fields
    rows = [
        (f"`{field.alias or name}`", plain(field.description or ""), _default(field))
        for name, field in model.model_fields.items()
        if model is Profile or name not in common
    ]
    return table(("key", "meaning", "default"), rows)


def _default(field: FieldInfo) -> str:
    if field.is_required():
        return "required"
    match field.default:
        case None | () | {}:
            return "none"
        case bool(flag):
            return "true" if flag else "false"
        case tuple(items):
            return f"[{', '.join(map(str, items))}]"
        case number_or_text:
            return f"{number_or_text:g}" if isinstance(number_or_text, float) else str(number_or_text)
