"""Checks that there is one sensor of a profile at a place, and one only, before anything is written to it. Pure.

Rules
-----
1. *Recognised*: the register of the slave id has answered with the id of the request, the registers of `identify` and
   of the rate (where the profile has them) hold what they can hold, and every value that is available has answered in
   range each time it was read. Optional registers may be absent, but some value is there and available.
2. *One alone*: the value is read three times, and behind each read a silent slave id is read, so that the line is
   listened to for 0.2, 0.2 and 0.6 s. Two sensors share the id where any of these answers collides, is followed by
   another or by bytes that no longer come when the silent id alone is read, or is impossible (not in range, no finite
   number), and where the values are those of two sensors (rule 3).
3. Wind varies: two reads of one sensor may differ by any amount. So values are those of two only if they jump back
   and forth between two groups: nine reads fall into two groups, the distance between these is more than `APART` times
   the width of each and more than `LEAST` of the profile's range, and it was crossed at least `CROSSINGS` times. Where
   the first three do not jump back and forth, six more are not read.
4. Two sensors share the id, too, where a second answer came to earlier requests: such a slave is left alone until
   that one has come, so that nothing of it is received behind a read.
5. Two sensors that answer bit-identically at the same time cannot be told from one.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from itertools import pairwise

from lfs10d.line.jobs.identification import may_lack, rate_fits
from lfs10d.line.jobs.procedure import Steps
from lfs10d.line.read_plan import ILLEGAL_ADDRESS
from lfs10d.profiles.blocks import NO_VALUE_NOW, Block
from lfs10d.profiles.values import Value
from lfs10d.reading import Fault, FaultCode
from lfs10d.reconfiguration.journal import Endpoint
from lfs10d.reconfiguration.procedures.identity_query import QUICK, IdentityQuery, IdentityReply
from lfs10d.system.dataclass import dataclass

READS = 3
"""Number of reads of a value."""
LISTENING = (QUICK, QUICK, 0.6)
"""Seconds for which the line is listened to after each read."""
MORE_READS = 6
"""Number of further reads if the first ones jump back and forth."""
APART = 5.0
"""Least distance between two groups of values, in widths of a group."""
LEAST = 0.02
"""The least distance between two groups, as a part of the range: a display that flickers by one digit is one sensor."""
CROSSINGS = 3
"""Least number of jumps in nine reads that means two sensors; a gust comes and goes once."""
FULL_CIRCLE = 360.0


@dataclass(frozen=True, slots=True)
class Recognition:
    """Whether it is recognised: `why` not, in words, None if it is; `rate_code` is the content of its rate register.

    `spoilt`: its answers collided every time.
    """

    why: str | None = None
    rate_code: int | None = None
    spoilt: bool = False


@dataclass(frozen=True, slots=True)
class Look:
    """The findings at one place. `answers`: the value could be read. `twins`: the sign of two sensors.

    `taken`: something was received from the place that was to be silent. `exception` is the code of a refusal.
    """

    answers: bool = True
    twins: str | None = None
    taken: bool = False
    exception: int | None = None


def recognise(endpoint: Endpoint, identity: IdentityReply, query: IdentityQuery) -> Steps[Recognition]:
    """Check that a sensor of the profile is at a place where `identity` was the reply of its id register."""
    profile = query.profile
    if identity.exception is not None:
        return Recognition(f"it refuses register 0x{query.id_register:04X} (exception {identity.exception:02X})")
    if identity.register != endpoint.slave:
        return Recognition(f"its register 0x{query.id_register:04X} says {identity.register}, not {endpoint.slave}")
    for each in profile.identify:
        reply = yield from query.read_register(endpoint, register=each.register)
        if reply.register not in each.holds:
            held = "does not answer" if reply.register is None else f"holds 0x{reply.register:04X}"
            return Recognition(f"its register 0x{each.register:04X} {held}, which is not this device")
    found = yield from _all_values_fit(endpoint, query)
    if found.why is not None or found.spoilt:
        return found
    if profile.baudrate is None:
        return Recognition()
    return (yield from _rate_fits(profile.baudrate.register, endpoint, query))


def _rate_fits(register: int, endpoint: Endpoint, query: IdentityQuery) -> Steps[Recognition]:
    reply = yield from query.read_patiently(endpoint, register=register)
    if rate_fits(query.profile, reply.register, endpoint.baudrate):
        return Recognition(rate_code=reply.register)
    says = "does not answer" if reply.register is None else f"says {reply.register}, which is no rate"
    return Recognition(f"its register 0x{register:04X} {says}")


def _all_values_fit(endpoint: Endpoint, query: IdentityQuery) -> Steps[Recognition]:
    """Read every value; some may be absent or without a number now, as long as it has others."""
    found, none = None, Recognition(f"it refuses all its values (exception {ILLEGAL_ADDRESS:02X})")
    blocks = list(query.profile.reads())
    while blocks:
        block = blocks.pop(0)
        fit, missing = yield from _values_fit(block, endpoint, query)
        if missing is not None and may_lack(block, missing.exception_code):
            blocks[:0] = query.profile.without_optional(block)
        elif missing is not None and missing.code in NO_VALUE_NOW:
            none = fit
        elif fit.why is not None or fit.spoilt:
            return fit
        else:
            found = fit
    return found or none


def _values_fit(block: Block, endpoint: Endpoint, query: IdentityQuery) -> Steps[tuple[Recognition, Fault | None]]:
    """Read a block of values `READS` times; the first answer that such a device cannot give decides.

    The second is why it has no value: it was refused, or says so.
    """
    spoilt = answered = 0
    exception: int | None = None
    nothing: Fault | None = None
    for timeout in query.patience:
        reply = yield from query.read_values(endpoint, timeout, block=block)
        spoilt += reply.noise
        exception = reply.exception
        if reply.words is None:
            continue
        answered += 1
        values = block.decode(reply.words)
        if isinstance(values, Fault):
            if values.code not in NO_VALUE_NOW:
                return Recognition(values.message), None
            nothing = values
    if spoilt >= READS:
        return Recognition(spoilt=True), None
    if answered:
        return Recognition(nothing.message if nothing else None), nothing
    how = "does not answer for" if exception is None else f"refuses (exception {exception:02X})"
    message = f"it {how} its values at 0x{block.address:04X}"
    return Recognition(message), Fault(FaultCode.EXCEPTION, message, exception)


def look_for_twins(endpoint: Endpoint, silent: Endpoint, query: IdentityQuery) -> Steps[Look]:
    """Check that one sensor is at a place, not two (rules 2 to 4); `silent` is a slave id without a device."""
    look = yield from _read_and_listen(endpoint, silent, query)
    if look.twins is None and query.answered_twice(endpoint):
        return replace(look, twins="a second answer comes to each request")
    return look


def _read_and_listen(endpoint: Endpoint, silent: Endpoint, query: IdentityQuery) -> Steps[Look]:
    blocks = list(query.profile.reads())
    value, block = _number_in(blocks)
    numbers: list[float] = []
    for window in LISTENING:
        look = yield from _measured(value, block, endpoint, query)
        while not numbers and isinstance(look, Look) and may_lack(block, look.exception):
            place = blocks.index(block)
            blocks[place : place + 1] = query.profile.without_optional(block)
            if not blocks:
                return look
            value, block = _number_in(blocks)
            look = yield from _measured(value, block, endpoint, query)
        if isinstance(look, Look):
            return look
        numbers.append(look)
        received, extra = yield from query.listen(silent, window, endpoint.slave)
        if extra:
            return Look(twins="a second answer came behind the first")
        if not received.silent:
            return (yield from _whose(silent, query))
    return (yield from _take_turns(value, block, numbers, endpoint, query))


def _number_in(blocks: Sequence[Block]) -> tuple[Value, Block]:
    """Return the first number of these reads, and the read that brings it; where all is text, the first value."""
    places = [(value, block) for block in blocks for value in block.values]
    return next((place for place in places if not place[0].is_text), places[0])


def _whose(silent: Endpoint, query: IdentityQuery) -> Steps[Look]:
    """Check whether bytes received after a read came from the place that was to be silent."""
    for _ in range(READS - 1):
        reply = yield from query.read_values(silent, QUICK)
        if not reply.silent:
            return Look(taken=True)
    return Look(twins="something is received behind its answer")


def _take_turns(
    value: Value, block: Block, numbers: list[float], endpoint: Endpoint, query: IdentityQuery
) -> Steps[Look]:
    """Read more often if the `numbers` so far jump back and forth; check whether that goes on."""
    if jumps(value, numbers) < READS - 1:
        return Look()
    for _ in range(MORE_READS):
        look = yield from _measured(value, block, endpoint, query)
        if isinstance(look, Look):
            return look
        numbers.append(look)
    if jumps(value, numbers) < CROSSINGS:
        return Look()
    return Look(twins=f"its values jump back and forth between {numbers[0]:g} and {numbers[1]:g} {value.unit}")


def _measured(value: Value, block: Block, endpoint: Endpoint, query: IdentityQuery) -> Steps[Look | float]:
    """Return the value; a `Look` that ends it where there is none."""
    exception: int | None = None
    for timeout in query.patience:
        reply = yield from query.read_values(endpoint, timeout, block=block)
        if reply.noise:
            return Look(twins="answers collide there")
        if reply.words is not None:
            values = block.decode(reply.words)
            if isinstance(values, Fault) and values.code is FaultCode.UNAVAILABLE:
                values = {}
            if isinstance(values, Fault):
                return Look(twins=f"its values are impossible: {values.message}")
            number = values.get(value.name, 0.0)  # an unavailable one jumps nowhere
            return 0.0 if isinstance(number, str) else float(number)
        exception = reply.exception
    return Look(answers=False, exception=exception)


def jumps(value: Value, numbers: Sequence[float]) -> int:
    """Return how often numbers jump between two groups that are as far apart as those of two sensors; 0 if none are.

    There are at least two numbers.
    """
    if value.range is None:
        return 0
    low, high = value.range
    if value.device_class == "wind_direction":  # 359 and 1 are neighbours
        numbers = [(each - numbers[0] + FULL_CIRCLE / 2) % FULL_CIRCLE for each in numbers]
    ordered = sorted(numbers)
    distance, split = max((after - before, n) for n, (before, after) in enumerate(pairwise(ordered)))
    width = max(ordered[split] - ordered[0], ordered[-1] - ordered[split + 1])
    if distance <= max(APART * width, LEAST * (high - low)):
        return 0
    above = [each > ordered[split] for each in numbers]
    return sum(before != after for before, after in pairwise(above))
