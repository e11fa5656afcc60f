"""What the types of messages say goes into a draft before any name is looked at."""

from __future__ import annotations

from dataclasses import replace

from roadlog.ingest import kinds, typed
from roadlog.ingest.drafting.draft import Draft, Guess


def by_type(draft: Draft) -> set[int]:
    """Put the signals of known message types into the draft; the ids of their frames.

    Alternatives are named with topic and type; what is only offered stands in comments.
    """
    found = kinds.meanings(draft.frames)
    taken = {m.role: m for m in typed.chosen(found, draft.frames)}
    everything = [m for ranked in found.values() for m in ranked]
    shown = typed.with_derived(draft.frames, everything)
    frames = {id(old): new for old, new in zip(draft.frames, shown, strict=True)}
    draft.frames = shown
    said: set[str] = set()
    for role, ranked in found.items():
        meaning = taken.get(role, ranked[0])
        others = [other for other in ranked if other.source != meaning.source]
        doubts = [meaning.doubt] if meaning.doubt else []
        doubts += [f"or: {', '.join(map(typed.alternative, others))}"] if others else []
        if meaning.kind.offer:
            doubts.append(f"offered: {meaning.kind.frame}")
        doubts = [doubt for doubt in doubts if doubt not in said]
        said.update(doubts)
        line = meaning.line
        frame = frames[id(meaning.frame)]
        guess = Guess(role, frame, meaning.column, line.unit, stated=True, typed=True)
        draft.guesses.append(
            replace(
                guess,
                scale=line.scale,
                offset=line.offset,
                valid=line.valid,
                doubts=tuple(doubts),
                off=meaning.kind.offer,
            )
        )
    return {id(frames[id(m.frame)]) for m in everything}
