"""Databases and traces made at random decode as cantools does, frame by frame, sample by sample."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from roadlog.ingest.formats import can
from roadlog.ingest.formats.can_database import Known

cantools = pytest.importorskip("cantools")
FRAMES = 12
J1939 = (
    'BA_DEF_ BO_ "VFrameFormat" ENUM "StandardCAN","ExtendedCAN","reserved","J1939PG";\n'
    'BA_DEF_DEF_ "VFrameFormat" "StandardCAN";\n'
)
ANYONE = 0xFE  # the address that stands for every sender
GROUP = 0x98FE0000  # a parameter group of J1939, with its message's number and a sender's address
NONE = ("SNA", "not available", "Signal_Invalid", "Error", "Fehler")
FEW = settings(
    max_examples=30,
    deadline=None,
    derandomize=True,
    suppress_health_check=[HealthCheck.too_slow, HealthCheck.data_too_large],
)


@st.composite
def signals(draw, name: str, first: int, size: int, mux: str = "") -> tuple[str, list[str]]:
    """A line of a signal within some bytes, and the lines that say more of it."""
    real = draw(st.sampled_from([0, 0, 0, 32, 64]))
    real = real if real <= 8 * size else 0
    length = real or draw(st.integers(1, min(8 * size, 64)))
    little = draw(st.booleans())
    spare = 8 * size - length
    left = draw(st.integers(0, spare))
    start = 8 * first + left if little else 8 * (first + left // 8) + 7 - left % 8
    signed = draw(st.booleans())
    scale = draw(st.sampled_from(["1", "0.01", "-0.5", "3", "0.00390625", "1e-7"]))
    offset = draw(st.sampled_from(["0", "-40", "0.25", "1000000"]))
    line = (
        f" SG_ {name} {mux}: {start}|{length}@{int(little)}{'-' if signed else '+'} "
        f'({scale},{offset}) [0|0] "km/h" X'
    )
    more = [f"SIG_VALTYPE_ %d {name} : {1 if real == 32 else 2};"] if real else []
    if not real and draw(st.booleans()):
        low = -(1 << (length - 1)) if signed else 0
        codes = draw(st.lists(st.integers(low, low + (1 << length) - 1), max_size=3, unique=True))
        texts = [draw(st.sampled_from([*NONE, "driving", "No error"])) for _ in codes]
        said = " ".join(f'{c} "{t}"' for c, t in zip(codes, texts, strict=True))
        more += [f"VAL_ %d {name} {said} ;"] if codes else []
    return line, more


@st.composite
def messages(draw, number: int, identifier: int) -> str:
    """A message: plain, with pages, or with pages in pages and ranges of them."""
    name = f"M{number}"
    kind = draw(st.sampled_from(["plain", "pages", "nested"]))
    head = f"BO_ {identifier} {name}: 8 X"
    lines: list[str] = []
    more: list[str] = []

    def add(found: tuple[str, list[str]]) -> None:
        lines.append(found[0])
        more.extend(line % identifier for line in found[1])

    if kind == "plain":
        for k in range(draw(st.integers(1, 4))):
            add(draw(signals(f"S{number}_{k}", 0, 8)))
    else:
        lines.append(f' SG_ P{number} M : 0|4@1+ (1,0) [0|0] "" X')
        pages = draw(st.lists(st.integers(0, 3), min_size=1, max_size=3, unique=True))
        for page in pages:
            add(draw(signals(f"S{number}_{page}", 2, 6, f"m{page} ")))
    if kind == "nested":
        lines.append(f' SG_ Q{number} m{pages[0]}M : 4|4@1+ (1,0) [0|0] "" X')
        more.append(f"SG_MUL_VAL_ {identifier} Q{number} P{number} {pages[0]}-{pages[0]};")
        for page in pages:
            other = f", {page + 8}-{page + 9}" if draw(st.booleans()) else ""
            span = f"{page}-{page}{other}"
            more.append(f"SG_MUL_VAL_ {identifier} S{number}_{page} P{number} {span};")
        add(draw(signals(f"N{number}", 1, 1, "m1 ")))
        more.append(f"SG_MUL_VAL_ {identifier} N{number} Q{number} 1-1, 3-5;")
    return "\n".join([head, *lines]), more


@st.composite
def cases(draw) -> tuple[str, list[tuple[str, int, bytes]]]:
    """A database, and frames of two buses that it knows, does not know, or that are short."""
    kinds = draw(st.lists(st.sampled_from(["11 bits", "29 bits", "group"]), min_size=1, max_size=3))
    bases = {"11 bits": 0x100, "29 bits": 0x98FF0000, "group": GROUP | ANYONE}
    identifiers = [bases[kind] + (k << 8) for k, kind in enumerate(kinds)]
    found = [draw(messages(k, i)) for k, i in enumerate(identifiers)]
    text = 'VERSION ""\n\nBU_: X\n\n' + "\n\n".join(head for head, _ in found)
    text += "\n\n" + J1939
    for i, kind in zip(identifiers, kinds, strict=True):
        text += f'BA_ "VFrameFormat" BO_ {i} 3;\n' if kind == "group" else ""
    text += "\n".join(line for _, more in found for line in more) + "\n"
    sent = [
        i - ANYONE + source if kind == "group" else i
        for i, kind in zip(identifiers, kinds, strict=True)
        for source in (0, 11)
    ]
    frames = [
        (
            draw(st.sampled_from(["can0", "can1"])),
            draw(st.sampled_from([*sent, 0x7FF])),
            draw(st.binary(min_size=draw(st.sampled_from([8, 8, 8, 3])), max_size=8)),
        )
        for _ in range(FRAMES)
    ]
    return text, frames


def expected(message, data: bytes) -> dict[str, float]:
    """What cantools decodes of a frame that may be short, without codes of no value."""
    try:
        raw = message.decode(data, decode_choices=False, scaling=False, allow_truncated=True)
        values = message.decode(data, decode_choices=False, allow_truncated=True)
    except (cantools.database.DecodeError, KeyError):  # a page that it does not know
        return {}
    none = {
        s.name
        for s in message.signals
        if (s.choices and str(s.choices.get(raw.get(s.name), "")) in NONE)
        or (message.protocol == "j1939" and s.name in raw and is_none_of_j1939(s, raw[s.name]))
    }
    return {name: np.nan if name in none else float(v) for name, v in values.items()}


def is_none_of_j1939(signal, raw: float) -> bool:
    """SAE J1939-71, table 1: numbers of a byte and more that begin with 0xFE or 0xFF."""
    if signal.is_float or signal.length < 8:
        return False
    if signal.is_signed:
        return raw >= (1 << (signal.length - 1)) - 2
    return int(raw) >> (signal.length - 8) >= 0xFE


def agrees(case) -> None:
    text, frames = case
    database = cantools.database.load_string(text, "dbc", strict=False)
    known = [Known(message, "x.dbc") for message in database.messages]
    by_id = {one.identifier: one.message for one in known}
    by_id |= {i - ANYONE + s: m for i, m in by_id.items() if m.protocol == "j1939" for s in (0, 11)}
    buses = ["can0", "can1"]
    decoder = can.Decoder(known, "x", None)
    for start in (0, FRAMES // 2):  # in two batches
        rows = list(enumerate(frames))[start : start + FRAMES // 2]
        decoder.add(
            can.CanFrames(
                np.array([k for k, _ in rows]),
                np.array([i for _, (_, i, _) in rows], np.uint32),
                np.array([list(d.ljust(8, b"\0")) for _, (*_, d) in rows], np.uint8),
                np.array([len(d) for _, (*_, d) in rows], np.uint8),
                np.array([buses.index(bus) for _, (bus, _, _) in rows], np.uint8),
                buses,
            )
        )
    if not any(i in by_id for _, i, _ in frames):
        return
    found: dict[tuple[str, int], dict[str, float]] = {}
    for frame in decoder.recording().frames:
        whole = next(n for n in (frame.name, *frame.also) if n.startswith("can"))
        for row, k in enumerate(frame.time.tolist()):
            found[whole.partition(".")[0], k] = {n: c[row] for n, c in frame.columns.items()}
    for k, (bus, identifier, data) in enumerate(frames):
        if identifier not in by_id:
            continue
        theirs = expected(by_id[identifier], data)
        ours = found[bus, k]
        if not theirs:
            continue
        for name, value in ours.items():
            np.testing.assert_equal(value, theirs.get(name, np.nan), err_msg=f"{name} {data.hex()}")


@FEW
@given(cases())
def test_random_databases_decode_as_cantools_does(case):
    agrees(case)


@pytest.mark.slow
@settings(FEW, max_examples=200, derandomize=False)
@given(cases())
def test_two_hundred_random_databases_decode_as_cantools_does(case):
    agrees(case)
